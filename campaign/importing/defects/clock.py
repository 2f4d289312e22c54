"""The clock of a table's rows: step, rounding, gaps, restarts.

A missing sample shifts everything behind it for good, a late stamp only itself: that tells a gap
from jitter. Stamps of a coarse clock jump by its step, which is neither.

A trial is sampled evenly. Times that are rounded are no reason to touch anything; times that
stand still, run back, jump or wander are told with their rows, and nothing is done about them that
the mapping does not ask for.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from campaign.importing.defects.defect import Array, counted

SHORTEST = 10
"""Samples that a recording has at least: fewer tell no motion."""
_BESIDE = 5
"""Samples on either side by which a lasting shift is told from a late stamp."""
TOLERANCE = 0.25
"""of a sample by which a time may be off an even clock: half of what would name another sample."""
WORTH_TELLING = 0.02
"""of a sample; less is the rounding of times that are written with few digits."""
GAP = 1.5
"""of the usual step, beyond which rows are missing."""
LONGEST = 50_000_000
"""rows of a trial whose times are repaired: that is done in memory."""
BLOCK = 1 << 20
Times = Callable[[int, int], Array]
"""The times (s) of rows [first, stop), shape (stop - first,)."""


@dataclass(frozen=True)
class Ticks:
    """What the stamps of a recording tell of its clock.

    Attributes:
        step: s between samples, as most of them have it; 0 where that cannot be told.
        resolution: s that all stamps are multiples of; 0 where they are as fine as numbers.
        gaps: rows behind which samples are missing.
        scatter: standard deviation of the steps beside gaps, beyond what rounding explains; s.
    """

    step: float
    resolution: float
    gaps: tuple[int, ...]
    scatter: float


def ticks(time: Array) -> Ticks:
    """The clock behind stamps, shape (n,), s, all finite."""
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
    # Of two rounded stamps the difference scatters by their step / sqrt(6).
    scatter = float(np.sqrt(max(scatter**2 - resolution**2 / 6, 0.0)))
    if resolution and np.all(np.abs(kept - step) <= resolution + slack):
        scatter = 0.0
    return Ticks(step, resolution, tuple(gaps), scatter)


def _resolution(steps: Array, step: float) -> float:
    """What all steps are multiples of, where that is coarse enough to be seen in them."""
    noise = 1e-5 * step
    levels = np.unique(np.round(steps / noise) * noise)
    if len(levels) < 2 or len(levels) > max(3, len(steps) // 4):
        return 0.0
    apart = np.diff(levels)
    apart = apart[apart > 3 * noise]
    finest = float(apart.min()) if len(apart) else 0.0
    if finest <= 1e-3 * step:
        return 0.0
    off = levels / finest - np.round(levels / finest)
    # With samples missing, the steps of an even clock are multiples of its own.
    regular = abs(finest / step - 1) < 0.02
    return 0.0 if regular or np.abs(off).max() > 0.1 else finest


def restarts(times: Array) -> list[int]:
    """Rows at which times, shape (n,), begin anew: they fall back past half of what went before.

    A clock that is set back, and rows that were exchanged, fall back by less.
    """
    steps = np.diff(times)
    forward = steps[steps > 0]
    if not len(forward):
        return []
    found, begin = [], 0
    for fall in np.flatnonzero(steps < -SHORTEST * float(np.median(forward))):
        if times[fall] - times[fall + 1] > 0.5 * (times[fall] - times[begin]):
            begin = int(fall) + 1
            found.append(begin)
    return found


@dataclass(frozen=True)
class EvenClock:
    """Samples at k / rate, and which rows they come from.

    Attributes:
        rate: Hz.
        start: time of the first row (s).
        samples: how many.
        positions: the row that each sample comes from, from the trial's first, shape (samples,);
            a fraction between two rows, NaN where a gap is marked. None: sample k is row k.
        remarks: what was done, and what was seen, in sentences.
    """

    rate: float
    start: float
    samples: int
    positions: Array | None = None
    remarks: tuple[str, ...] = ()


def even_clock(times: Times, first: int, rows: int, repairs: Sequence[str] = ()) -> EvenClock:
    """The clock of `rows` rows from row `first`.

    Args:
        repairs: what may be done: `drop repeated`, `mark gaps`, `resample`.

    Raises ValueError for times that are no even clock: in which rows, and what would help.
    """
    if rows < 2:
        raise ValueError(f"{counted(rows, 'row')} hold{'s' if rows == 1 else ''} no recording")
    start, last = (float(times(k, k + 1)[0]) for k in (first, first + rows - 1))
    if np.isfinite(last - start) and last > start:
        rate = (rows - 1) / (last - start)
        worst, row, level, bend = _furthest(times, first, rows, start, rate)
        if WORTH_TELLING < worst <= 4.0 * TOLERANCE:  # the two ends may be the worst of all
            start += (level - 0.5 * (rows - 1) * bend) / rate
            rate /= 1.0 + bend
            worst, row, *_ = _furthest(times, first, rows, start, rate)
        if worst <= TOLERANCE:
            told = f"times are off an even clock by up to {worst:.2g} of a sample (row {row})"
            remarks = (told,) if worst > WORTH_TELLING else ()
            return EvenClock(rate, start, rows, None, remarks)
    if rows > LONGEST:
        raise ValueError(f"its times are no even clock, and {rows} rows are too many to repair")
    return _repaired(times(first, first + rows), first, repairs)


def _furthest(
    times: Times, first: int, rows: int, start: float, rate: float
) -> tuple[float, int, float, float]:
    """How far a row is off sample k of the clock, at most, and which row it is; samples.

    Also the mean of all of them, and their slope over k: what start and rate are off by.
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
    """Of times, shape (n,), all finite."""
    steps = np.diff(clock)
    if not (steps > 0).any():
        raise ValueError("its times do not go on: all rows have one time")
    # Of rounded times no step is the usual one: 2 and 3 ms at 430 Hz.
    told = ticks(np.unique(clock))
    return told.step if told.resolution else float(np.median(steps[steps > 0]))


def _repaired(clock: Array, first: int, repairs: Sequence[str]) -> EvenClock:
    """Raises ValueError where `repairs` do not allow for what is wrong."""
    remarks: list[str] = []
    undefined = np.flatnonzero(~np.isfinite(clock)) + first
    if len(undefined):
        has = "has" if len(undefined) == 1 else "have"
        raise ValueError(f"row {_told(undefined)} {has} no time")
    step = _usual_step(clock)
    back = np.flatnonzero(np.diff(clock) <= 0) + 1 + first
    rows = np.arange(len(clock))
    if len(back):
        if anew := restarts(clock):
            raise ValueError(
                f"time begins anew in row {_told(np.array(anew) + first)}: {len(anew) + 1} "
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
        told = f"{len(left)} rows were left out, whose time was no later: row {_told(left)}"
        remarks.append(told)
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
    """Each row on the sample it belongs to, and nothing where there is no row."""
    steps = np.diff(clock)
    number = np.concatenate([[0.0], np.cumsum(np.maximum(1.0, np.rint(steps / step)))])
    # The usual step is rounded as the times are; the line through all of them is not.
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
    """What to say of times that an even clock explains, but for their rounding; "" of others."""
    told = ticks(clock)
    if not told.resolution or told.scatter or told.gaps or np.any(np.diff(clock) < 0):
        return ""
    step = float(np.polyfit(np.arange(len(clock)), clock, 1)[0])
    return (
        f"its times are rounded to {told.resolution:.3g} s, too coarse for steps of {step:.3g} s; "
        f"give the 'sample_rate' in place of their column, about {1 / step:.4g} Hz"
    )


def _resampled(clock: Array, rows: Array, step: float, remarks: list[str]) -> EvenClock:
    """Samples on lines between rows; where rows are missing, nothing."""
    # Jitter may double a step; more than that is a hole, across which no line is put. The usual
    # step is told by all of them: single ones jitter.
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
    told = (
        f"resampled at {1 / step:.6g} Hz on lines between rows; steps varied by up to {moved:.2g}"
    )
    remarks.append(f"{told} of a sample")
    if hole.any():
        remarks.append(f"{int(hole.sum())} samples lie in gaps and are marked as lost")
    return EvenClock(1.0 / step, float(clock[0]), samples, positions, tuple(remarks))


def _told(rows: NDArray[np.intp]) -> str:
    """`17, 18, 40 and 12 more`, as people count: from 1."""
    told = ", ".join(str(row + 1) for row in rows[:3])
    return told if len(rows) <= 3 else f"{told} and {len(rows) - 3} more"
