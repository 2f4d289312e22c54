"""The clock of a table's rows: step, rounding, gaps, restarts.

A missing sample shifts all later stamps; a late stamp shifts only itself. This distinguishes a gap
from jitter. Stamps of a coarse clock jump by its resolution, which is neither.

A trial is sampled evenly. Rounded times need no repair. Times that repeat, decrease, jump or drift
are reported with their rows, and repaired only as the mapping requests.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from campaign.importing.defects.defect import Array
from campaign.text import count

SHORTEST = 10
"""Minimum number of samples of a recording: fewer show no motion."""
_BESIDE = 5
"""Samples on either side that distinguish a lasting shift from a late stamp."""
TOLERANCE = 0.25
"""Permitted offset of a time from an even clock, in samples: half of the rounding limit, 0.5."""
WORTH_TELLING = 0.02
"""Offset in samples above which a remark is made; less is rounding to few digits."""
GAP = 1.5
"""Step, in usual steps, above which rows are missing."""
LONGEST = 50_000_000
"""Maximum number of rows of a trial with repaired times: the repair is in memory."""
BLOCK = 1 << 20
Times = Callable[[int, int], Array]
"""The times (s) of rows [first, stop), shape (stop - first,)."""


@dataclass(frozen=True)
class Ticks:
    """Clock estimated from the time stamps of a recording.

    Attributes:
        step: median time between samples (s); 0 if it cannot be estimated.
        resolution: common divisor of all stamps (s); 0 if they are not visibly rounded.
        gaps: rows after which samples are missing.
        scatter: standard deviation of the steps without gaps and without rounding (s).
    """

    step: float
    resolution: float
    gaps: tuple[int, ...]
    scatter: float


def ticks(time: Array) -> Ticks:
    """Estimate the clock of stamps, shape (n,), s, all finite."""
    steps = np.diff(time)
    wide = max(1, min(64, len(steps) // 4))
    step = float(np.median(time[wide:] - time[:-wide])) / wide if len(steps) else 0.0
    if step <= 0:
        return Ticks(0.0, 0.0, (), 0.0)
    resolution = _resolution(steps, step)
    beyond = np.maximum(np.abs(steps - step) - resolution, 0.0)
    usual = float(np.quantile(beyond, 0.9))
    slack = 1e-6 * step
    late = steps - step > max(0.5 * step, resolution + slack + 3 * usual)
    gaps = []
    shifted = time - step * np.arange(len(time))
    for row in np.flatnonzero(late).tolist():
        before = np.median(shifted[max(0, row - _BESIDE + 1) : row + 1])
        after = np.median(shifted[row + 1 : row + 1 + _BESIDE])
        lost = round(min(float(after - before), float(steps[row]) - step) / step)
        if lost >= 1:
            gaps.append(row)
    kept = np.delete(steps, gaps)
    scatter = float(np.std(kept)) if len(kept) else 0.0
    # The difference of two rounded stamps has the standard deviation resolution / sqrt(6).
    scatter = float(np.sqrt(max(scatter**2 - resolution**2 / 6, 0.0)))
    if resolution and np.all(np.abs(kept - step) <= resolution + slack):
        scatter = 0.0
    return Ticks(step, resolution, tuple(gaps), scatter)


def _resolution(steps: Array, step: float) -> float:
    """Common divisor of all steps (s); 0 if it is too fine to be visible in them."""
    noise = 1e-5 * step
    levels = np.unique(np.round(steps / noise) * noise)
    if len(levels) < 2 or len(levels) > max(3, len(steps) // 4):
        return 0.0
    spacing = np.diff(levels)
    spacing = spacing[spacing > 3 * noise]
    finest = float(spacing.min()) if len(spacing) else 0.0
    if finest <= 1e-3 * step:
        return 0.0
    off = levels / finest - np.round(levels / finest)
    # If samples are missing, the steps of an even clock are multiples of the usual step.
    regular = abs(finest / step - 1) < 0.02
    return 0.0 if regular or np.abs(off).max() > 0.1 else finest


def restarts(times: Array) -> list[int]:
    """Rows at which times, shape (n,), restart: they decrease by over half of the time before.

    A clock that is set back decreases by less, and so do exchanged rows.
    """
    steps = np.diff(times)
    forward = steps[steps > 0]
    if not len(forward):
        return []
    rows, begin = [], 0
    for fall in np.flatnonzero(steps < -SHORTEST * float(np.median(forward))):
        if times[fall] - times[fall + 1] > 0.5 * (times[fall] - times[begin]):
            begin = int(fall) + 1
            rows.append(begin)
    return rows


@dataclass(frozen=True)
class EvenClock:
    """Samples at k / rate, and their source rows.

    Attributes:
        rate: Hz.
        start: time of the first row (s).
        samples: number of samples.
        positions: source row of each sample, from the trial's first, shape (samples,); a fraction
            between two rows, NaN in a marked gap. None: sample k is row k.
        remarks: repairs and observations, in sentences.
    """

    rate: float
    start: float
    samples: int
    positions: Array | None = None
    remarks: tuple[str, ...] = ()


def even_clock(times: Times, first: int, rows: int, repairs: Sequence[str] = ()) -> EvenClock:
    """The clock of `rows` rows from row `first`.

    Args:
        repairs: permitted repairs: `drop repeated`, `mark gaps`, `resample`.

    Raises ValueError for times that are no even clock, with the rows and a remedy.
    """
    if rows < 2:
        raise ValueError(f"{count(rows, 'row')} hold{'s' if rows == 1 else ''} no recording")
    start, last = (float(times(k, k + 1)[0]) for k in (first, first + rows - 1))
    if np.isfinite(last - start) and last > start:
        rate = (rows - 1) / (last - start)
        worst, row, level, bend = _furthest(times, first, rows, start, rate)
        if WORTH_TELLING < worst <= 4.0 * TOLERANCE:  # the two end rows may have the largest errors
            start += (level - 0.5 * (rows - 1) * bend) / rate
            rate /= 1.0 + bend
            worst, row, *_ = _furthest(times, first, rows, start, rate)
        if worst <= TOLERANCE:
            note = f"times are off an even clock by up to {worst:.2g} of a sample (row {row})"
            remarks = (note,) if worst > WORTH_TELLING else ()
            return EvenClock(rate, start, rows, None, remarks)
    if rows > LONGEST:
        raise ValueError(f"its times are no even clock, and {rows} rows are too many to repair")
    return _repaired(times(first, first + rows), first, repairs)


def _furthest(
    times: Times, first: int, rows: int, start: float, rate: float
) -> tuple[float, int, float, float]:
    """Largest offset of a row k from sample k of the clock, and its row; in samples.

    Also the mean of all offsets and their slope over k: the errors of start and rate.
    """
    worst, row, total, moment, square = 0.0, first, 0.0, 0.0, 0.0
    middle = 0.5 * (rows - 1)
    for k in range(0, rows, BLOCK):
        block = times(first + k, first + min(k + BLOCK, rows))
        number = np.arange(k, k + len(block), dtype=np.float64)
        off = (block - start) * rate - number
        if not np.isfinite(off).all():
            return np.inf, first + k + int(np.argmin(np.isfinite(off))), 0.0, 0.0
        at = int(np.argmax(np.abs(off)))
        if abs(off[at]) > worst:
            worst, row = float(abs(off[at])), first + k + at
        total += float(off.sum())
        moment += float((number - middle) @ off)
        square += float((number - middle) @ (number - middle))
    return worst, row, total / rows, moment / square


def _usual_step(clock: Array) -> float:
    """The usual step (s) of times, shape (n,), all finite; ValueError if none increases."""
    steps = np.diff(clock)
    if not (steps > 0).any():
        raise ValueError("its times do not go on: all rows have one time")
    # Rounded times have no usual step: 2 and 3 ms at 430 Hz.
    fit = ticks(np.unique(clock))
    return fit.step if fit.resolution else float(np.median(steps[steps > 0]))


def _repaired(clock: Array, first: int, repairs: Sequence[str]) -> EvenClock:
    """The repaired clock. Raises ValueError for errors that `repairs` do not cover."""
    remarks: list[str] = []
    undefined = np.flatnonzero(~np.isfinite(clock)) + first
    if len(undefined):
        has = "has" if len(undefined) == 1 else "have"
        raise ValueError(f"row {_told(undefined)} {has} no time")
    step = _usual_step(clock)
    back = np.flatnonzero(np.diff(clock) <= 0) + 1 + first
    rows = np.arange(len(clock))
    if len(back):
        if begins := restarts(clock):
            raise ValueError(
                f"time begins anew in row {_told(np.array(begins) + first)}: {len(begins) + 1} "
                "recordings; in [[test.recording]] write 'restarts = true', or 'each' with a "
                "column that numbers them"
            )
        if not repairs and (coarse := _coarse(clock)):
            raise ValueError(coarse)
        if "drop repeated" not in repairs:
            raise ValueError(
                f"the time of row {_told(back)} is not after that of the row before; "
                'repair = ["drop repeated"] leaves such rows out'
            )
        later = clock[1:] > np.maximum.accumulate(clock)[:-1]
        rows = np.flatnonzero([True, *later])
        left = np.flatnonzero(~later) + 1 + first
        note = f"{len(left)} rows were left out, whose time was no later: row {_told(left)}"
        remarks.append(note)
        clock = clock[rows]
        if len(clock) < 2:
            raise ValueError("its times do not go on")
    if "resample" in repairs:
        return _resampled(clock, rows.astype(np.float64), step, remarks)
    return _marked(clock, rows, first, step, repairs, remarks)


def _marked(
    clock: Array,
    rows: NDArray[np.intp],
    first: int,
    step: float,
    repairs: Sequence[str],
    remarks: list[str],
) -> EvenClock:
    """The clock with each row at its nearest sample; samples without a row are NaN."""
    steps = np.diff(clock)
    number = np.concatenate([[0.0], np.cumsum(np.maximum(1.0, np.rint(steps / step)))])
    # The usual step is rounded like the times; the line through all times is not.
    slope = float(np.polynomial.Polynomial.fit(number, clock, 1).convert().coef[1])
    number = np.rint((clock - clock[0]) / slope)
    off = np.abs((clock - clock[0]) / slope - number)
    if len(np.unique(number)) < len(number) or float(off.max()) > TOLERANCE:
        if coarse := _coarse(clock):
            raise ValueError(coarse)
        spread = float(np.std(steps) / step)
        worst = int(np.argmax(np.abs(steps - step)))
        raise ValueError(
            f"its times are no even clock: steps of {step:.6g} s vary by {100 * spread:.3g} %, to "
            f"{steps[worst]:.6g} s before row {first + rows[worst + 1] + 1}; "
            'repair = ["resample"] interpolates'
        )
    positions = np.full(int(number[-1]) + 1, np.nan)
    positions[number.astype(int)] = rows
    if missing := len(positions) - len(rows):
        before = _told(rows[1:][np.diff(number) > 1] + first)
        if "mark gaps" not in repairs:
            raise ValueError(
                f"{missing} samples are missing, before row {before}; "
                "repair = [\"mark gaps\"] marks them as lost; 'start' and 'stop' cut them out"
            )
        remarks.append(f"{missing} samples are missing and marked as lost, before row {before}")
    return EvenClock(1.0 / slope, float(clock[0]), len(positions), positions, tuple(remarks))


def _coarse(clock: Array) -> str:
    """Message for times of an even clock that are too coarsely rounded; "" for other times."""
    fit = ticks(clock)
    if not fit.resolution or fit.scatter or fit.gaps or np.any(np.diff(clock) < 0):
        return ""
    step = float(np.polyfit(np.arange(len(clock)), clock, 1)[0])
    return (
        f"its times are rounded to {fit.resolution:.3g} s, too coarse for steps of {step:.3g} s; "
        f"give the 'sample_rate' in place of their column, about {1 / step:.4g} Hz"
    )


def _resampled(clock: Array, rows: Array, step: float, remarks: list[str]) -> EvenClock:
    """The clock with samples interpolated between rows; NaN where rows are missing."""
    # Jitter may double a step; a longer step is a hole, which is not interpolated. The usual
    # step is the mean of all others, because single steps jitter.
    steps = np.diff(clock)
    holes = steps > 2.0 * GAP * step
    step = float(steps[~holes].mean()) if not holes.all() else step
    samples = int(np.floor((clock[-1] - clock[0]) / step + 1e-9)) + 1
    wanted = clock[0] + step * np.arange(samples)
    positions = np.interp(wanted, clock, rows)
    after = np.clip(np.searchsorted(clock, wanted, side="right"), 1, len(clock) - 1)
    on_row = np.isin(wanted, clock)
    hole = (clock[after] - clock[after - 1] > 2.0 * GAP * step) & ~on_row
    positions[hole] = np.nan
    moved = float(np.max(np.abs(np.diff(clock) - step))) / step
    note = (
        f"resampled at {1 / step:.6g} Hz on lines between rows; steps varied by up to {moved:.2g}"
    )
    remarks.append(f"{note} of a sample")
    if hole.any():
        remarks.append(f"{int(hole.sum())} samples lie in gaps and are marked as lost")
    return EvenClock(1.0 / step, float(clock[0]), samples, positions, tuple(remarks))


def _told(rows: NDArray[np.intp]) -> str:
    """Row numbers from 1 as text: `17, 18, 40 and 12 more`."""
    text = ", ".join(str(row + 1) for row in rows[:3])
    return text if len(rows) <= 3 else f"{text} and {len(rows) - 3} more"
