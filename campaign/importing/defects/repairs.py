"""What can be done about defects: each function returns what is left, and says what it did.

Nothing here is invented unseen: where no sample was taken there is NaN, which stands for lost ones;
what is drawn between two samples is drawn because somebody asked for it, and is counted.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from campaign.importing.defects.clock import ticks
from campaign.importing.defects.defect import Array, counted


@dataclass(frozen=True)
class Repaired:
    """Samples after a repair.

    Attributes:
        values: shape as they were.
        what: a sentence about what was done.
        touched: samples that are not what was read.
    """

    values: Array
    what: str
    touched: int


@dataclass(frozen=True)
class Retimed:
    """A recording whose times were repaired: `time` shape (n,), s; `values` shape (n, channels)."""

    time: Array
    values: Array
    what: str
    touched: int


def drop(time: Array, values: Array) -> Retimed:
    """Without samples that have no time, or one that is not after all before them.

    Args:
        time: shape (n,), s.
        values: shape (n, channels).
    """
    known = np.isfinite(time)
    latest = np.maximum.accumulate(np.where(known, time, -np.inf))
    kept = known.copy()
    kept[1:] &= time[1:] > latest[:-1]
    gone = int((~kept).sum())
    what = f"{counted(gone, 'sample')} with a time that is not after the ones before: dropped"
    return Retimed(time[kept], values[kept], what, gone)


def restamp(time: Array) -> Repaired:
    """Rounded stamps as those of an even clock that fits them; gaps stay.

    Raises ValueError where an even clock does not fit to within the rounding.
    """
    clock = ticks(time)
    if clock.step <= 0:
        raise ValueError("the stamps tell of no clock")
    count = np.arange(len(time), dtype=np.float64)
    for row, missing in zip(clock.gaps, clock.missing, strict=True):
        count[row + 1 :] += missing
    rate, start = np.polyfit(count, time, 1)
    even: Array = start + rate * count
    moved = float(np.abs(even - time).max())
    if moved > max(clock.resolution, 1e-3 * clock.step) * 1.01:
        raise ValueError(
            f"an even clock is up to {moved:.3g} s off the stamps: they are not rounded"
        )
    what = (
        f"times are those of an even clock of {1 / rate:.6g} Hz, up to {moved:.3g} s off the stamps"
    )
    return Repaired(even, what, int((even != time).sum()))


def resample(
    time: Array,
    values: Array,
    step: float | None = None,
    fill: Literal["hold", "linear", "refuse"] = "hold",
) -> Retimed:
    """On an even grid that begins with the first sample.

    Args:
        time: shape (n,), s, increasing.
        values: shape (n, channels).
        step: of the grid, s; as most of the samples have it.
        fill: what a grid point gets at which no sample was taken: the last one before it (`hold`),
            or what lies between the two beside it (`linear`); with `refuse` there must be none.
            Where samples are missing it gets NaN, whatever is asked.

    Raises ValueError where times do not increase, or with `refuse`, or where the grid would be
    more than ten times as long as the recording has samples.
    """
    if len(time) < 2 or not np.all(np.diff(time) > 0):
        raise ValueError("only a recording whose times increase can be resampled")
    clock = ticks(time)
    own = clock.step if clock.step > 0 else float(np.median(np.diff(time)))
    step = own if step is None else step
    length = float(time[-1] - time[0]) / step
    if not step > 0 or length > 10 * len(time):
        raise ValueError(f"an even grid of {step:.3g} s would be longer than its recording by far")
    # Sums of rounded steps must not cost the last sample its place.
    grid: Array = time[0] + step * np.arange(int(np.floor(length + 1e-6)) + 1)
    slack = 1e-3 * step
    at = np.clip(np.searchsorted(time, grid + slack, side="right") - 1, 0, len(time) - 1)
    after = np.minimum(at + 1, len(time) - 1)
    exact = np.abs(grid - time[at]) <= slack
    # Late stamps are no gap; the step before them and twice its scatter are due all the same.
    apart = time[after] - time[at]
    known = exact | (apart <= 1.5 * max(own, step) + 3 * clock.scatter + clock.resolution)
    if fill == "refuse" and not exact.all():
        count = counted(int((~exact).sum()), "point")
        raise ValueError(f"{count} of an even grid of {step:.4g} s have no sample of their own")
    found = values[at].astype(np.float64)
    between = ~exact & known
    if fill == "linear":
        part = ((grid - time[at]) / np.where(apart > 0, apart, 1.0))[between, None]
        found[between] = (1 - part) * found[between] + part * values[after[between]]
    found[~known] = np.nan
    lost, filled = int((~known).sum()), int(between.sum())
    how = "hold the last one before" if fill == "hold" else "are drawn between two"
    what = (
        f"on an even grid of {step:.6g} s: {counted(filled, 'sample')} {how}, "
        f"{counted(lost, 'sample')} {'is' if lost == 1 else 'are'} lost"
    )
    return Retimed(grid, found, what, lost + filled)


def unwrap(values: Array, scale: float) -> Repaired:
    """An angle whose scale began anew, made continuous; lost samples stay lost."""
    known = np.isfinite(values)
    made = values.copy()
    made[known] = np.unwrap(values[known], period=scale)
    touched = int((made[known] != values[known]).sum())
    turns = int((np.abs(np.diff(values[known])) > scale / 2).sum())
    what = f"made continuous at {counted(turns, 'place')} where its scale of {scale:.6g} began anew"
    return Repaired(made, what, touched)


def swap_sign(values: Array) -> Repaired:
    """With the other sign."""
    return Repaired(-values, "its sign is swapped", int(np.isfinite(values).sum()))


def scale(values: Array, factor: float) -> Repaired:
    """Times a factor. Raises ValueError for one that is none."""
    if not np.isfinite(factor) or factor == 0:
        raise ValueError(f"{factor} is no factor")
    return Repaired(values * factor, f"multiplied by {factor:.9g}", int(np.isfinite(values).sum()))


def shift(values: Array, delay: float, step: float) -> Repaired:
    """Earlier by a delay, s, on an even grid of `step` s; what is shifted in at the end is lost.

    A delay of whole samples moves them; any other draws lines between them.
    """
    samples = delay / step
    whole = round(samples)
    if abs(samples - whole) < 1e-6:
        made = np.full_like(values, np.nan)
        if abs(whole) < len(values):
            source = values[max(whole, 0) : len(values) + min(whole, 0)]
            first = max(-whole, 0)
            made[first : first + len(source)] = source
        how = f"moved by {counted(abs(whole), 'sample')}"
    else:
        places = np.arange(len(values)) + samples
        low = np.floor(places).astype(np.intp)
        inside = (low >= 0) & (low + 1 < len(values))
        part = places[inside] - low[inside]
        made = np.full_like(values, np.nan)
        made[inside] = (1 - part) * values[low[inside]] + part * values[low[inside] + 1]
        how = f"moved by {abs(samples):.4g} samples, drawn between two each"
    earlier = "earlier" if delay > 0 else "later"
    lost = int((np.isnan(made) & ~np.isnan(values)).sum())
    what = (
        f"{1000 * abs(delay):.4g} ms {earlier}: {how}; {counted(lost, 'sample')} lost at the edge"
    )
    return Repaired(made, what, len(values) if delay else 0)


def lose(values: Array, stretches: Iterable[tuple[int, int]]) -> Repaired:
    """With stretches of rows (first, last) marked as lost: NaN."""
    made = values.copy()
    for first, last in stretches:
        made[first : last + 1] = np.nan
    touched = int((np.isnan(made) & ~np.isnan(values)).sum())
    return Repaired(made, f"{counted(touched, 'sample')} marked as lost", touched)


def unfill(values: Array, period: int) -> Repaired:
    """What was drawn between every `period`-th row replaced by the last value before it."""
    bends = np.abs(np.diff(values, 2))
    corners = np.flatnonzero(bends > 1e-6 * max(float(np.quantile(bends, 0.99)), 1e-300)) + 1
    phase = int(np.argmax(np.bincount(corners % period, minlength=period))) if len(corners) else 0
    rows = np.arange(len(values))
    source = np.maximum(rows - (rows - phase) % period, 0)
    made = values[source]
    made[: phase if phase < len(values) else 0] = values[0]
    touched = int((made != values).sum())
    what = f"only every {period}. row was measured, from row {phase + 1}: held in between"
    return Repaired(made, what, touched)
