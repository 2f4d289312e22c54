"""What is wrong with the times of a recording: gaps, repetitions, jitter, rounding, drift.

A missing sample shifts everything behind it for good, a late stamp only itself: that tells a gap
from jitter. Stamps of a coarse clock jump by its step, which is neither.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from campaign.importing.defects.defect import (
    MOST,
    Array,
    Defect,
    Severity,
    counted,
    rows_in_words,
)

FEWEST = 8
"""Samples below which nothing is said of a clock."""
JITTER = 0.05
"""Share of a step: the scatter of steps from which on a time base counts as irregular."""
RATE_ERROR = 1e-3
"""Share by which a rate may differ from the stated one."""
CLOCK_ERROR = 20e-6
"""Share by which two clocks may differ unnoticed: twice what a crystal's data sheet allows."""
DROP, MARK, RESAMPLE = "drop repeated", "mark gaps", "resample"
"""What a mapping may have done to times."""
_BESIDE = 5
"""Samples on either side by which a lasting shift is told from a late stamp."""


@dataclass(frozen=True)
class Ticks:
    """What the stamps of a recording tell of its clock.

    Attributes:
        step: s between samples, as most of them have it; 0 where that cannot be told.
        resolution: s that all stamps are multiples of; 0 where they are as fine as numbers.
        gaps: rows behind which samples are missing.
        missing: of each gap, how many.
        scatter: standard deviation of the steps beside gaps, beyond what rounding explains; s.
    """

    step: float
    resolution: float
    gaps: tuple[int, ...]
    missing: tuple[int, ...]
    scatter: float


def ticks(time: Array) -> Ticks:
    """The clock behind stamps, shape (n,), s, all finite."""
    steps = np.diff(time)
    wide = max(1, min(64, len(steps) // 4))
    step = float(np.median(time[wide:] - time[:-wide])) / wide if len(steps) else 0.0
    if step <= 0:
        return Ticks(0.0, 0.0, (), (), 0.0)
    resolution = _resolution(steps, step)
    beyond = np.maximum(np.abs(steps - step) - resolution, 0.0)
    usual = float(np.quantile(beyond, 0.9))
    slack = 1e-6 * step
    late = steps - step > max(0.5 * step, resolution + slack + 3 * usual)
    gaps, missing = [], []
    shifted = time - step * np.arange(len(time))
    for row in np.flatnonzero(late).tolist():
        before = np.median(shifted[max(0, row - _BESIDE + 1) : row + 1])
        after = np.median(shifted[row + 1 : row + 1 + _BESIDE])
        lost = round(min(float(after - before), float(steps[row]) - step) / step)
        if lost >= 1:
            gaps.append(row)
            missing.append(lost)
    kept = np.delete(steps, gaps)
    scatter = float(np.std(kept)) if len(kept) else 0.0
    # Of two rounded stamps the difference scatters by their step / sqrt(6).
    scatter = float(np.sqrt(max(scatter**2 - resolution**2 / 6, 0.0)))
    if resolution and np.all(np.abs(kept - step) <= resolution + slack):
        scatter = 0.0
    return Ticks(step, resolution, tuple(gaps), tuple(missing), scatter)


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


def of_time(time: Array, rate: float | None = None) -> Iterator[Defect]:
    """What is wrong with times, shape (n,), s. `rate`: what the clock's is said to be, Hz."""
    last = len(time) - 1
    lost = np.flatnonzero(~np.isfinite(time))
    if len(lost):
        what = f"{counted(len(lost), 'sample')} without a time, the first in row {lost[0] + 1}"
        yield Defect("lost time", (), what, _ends(lost), float(len(lost)), Severity.REFUSED)
        time = time[np.isfinite(time)]
    if len(time) < FEWEST:
        return
    steps = np.diff(time)
    clock = ticks(time)
    if clock.step <= 0:
        same = len(time) - len(np.unique(time))
        what = (
            f"{same} of {len(time)} samples have the time of another: the stamps are coarser "
            "than the sampling, or no times"
        )
        yield Defect("no clock", (), what, (0, last), float(same), Severity.REFUSED)
        return
    yield from _repeated(steps, clock)
    yield from _gaps(time, clock)
    if clock.resolution:
        what = f"stamps are rounded to {clock.resolution:.3g} s, of steps of {clock.step:.4g} s"
        yield Defect("rounded", (), what, (0, last), clock.resolution, Severity.NOTED)
    if clock.scatter > JITTER * clock.step:
        share = clock.scatter / clock.step
        what = f"steps scatter by {100 * share:.3g} % of {clock.step:.4g} s (standard deviation)"
        yield Defect("jitter", (), what, (0, last), share, Severity.REPAIRABLE, RESAMPLE)
    yield from _drift(time, clock, rate)


def _ends(rows: np.ndarray) -> tuple[int, int]:
    return int(rows[0]), int(rows[-1])


def _repeated(steps: Array, clock: Ticks) -> Iterator[Defect]:
    """Stamps that stand still or go back; the row is the second of the two."""
    back = np.flatnonzero(steps < 0) + 1
    if len(back):
        most = -float(steps.min())
        what = (
            f"time goes back {counted(len(back), 'time')}, by up to {most:.3g} s, the first in "
            f"row {back[0] + 1}"
        )
        yield Defect("backward", (), what, _ends(back), float(len(back)), Severity.REPAIRABLE, DROP)
    same = np.flatnonzero(steps == 0) + 1
    if len(same):
        coarse = clock.resolution > clock.step
        why = ": the clock is coarser than the sampling" if coarse else ""
        what = (
            f"{counted(len(same), 'sample')} with the time of the one before, the first in row "
            f"{same[0] + 1}{why}"
        )
        repair = "sample_rate" if coarse else DROP
        yield Defect(
            "duplicate", (), what, _ends(same), float(len(same)), Severity.REPAIRABLE, repair
        )


def _gaps(time: Array, clock: Ticks) -> Iterator[Defect]:
    told = list(zip(clock.gaps, clock.missing, strict=True))
    for row, missing in told[:MOST]:
        what = (
            f"{counted(missing, 'sample')} missing behind {rows_in_words(row, row)}: "
            f"{time[row + 1] - time[row]:.4g} s, where steps are {clock.step:.4g} s"
        )
        where = (row, row + 1)
        yield Defect("gap", (), what, where, float(missing), Severity.REPAIRABLE, MARK)
    if len(told) > MOST:
        rest = told[MOST:]
        missing = sum(each for _, each in rest)
        what = f"{counted(missing, 'sample')} missing in {counted(len(rest), 'further gap')}"
        where = (rest[0][0], rest[-1][0] + 1)
        yield Defect("gap", (), what, where, float(missing), Severity.REPAIRABLE, MARK)


def _drift(time: Array, clock: Ticks, rate: float | None) -> Iterator[Defect]:
    """A rate that is not the stated one, or that changes while it is recorded."""
    rows = (0, len(time) - 1)
    if rate is not None and abs(clock.step * rate - 1) > RATE_ERROR:
        what = (
            f"the stamps tell of {1 / clock.step:.6g} Hz where {rate:.6g} Hz is stated, "
            f"{100 * (1 / (clock.step * rate) - 1):+.3g} %"
        )
        size = 1 / clock.step - rate
        yield Defect("stated rate", (), what, rows, size, Severity.REPAIRABLE, RESAMPLE)
    count = np.arange(len(time), dtype=np.float64)
    for row, missing in zip(clock.gaps, clock.missing, strict=True):
        count[row + 1 :] += missing
    if len(time) < 100 or clock.scatter > JITTER * clock.step:
        return
    # A bend of the whole, in samples: what a line leaves of a parabola.
    x = 2 * count / count[-1] - 1
    bend = np.polynomial.legendre.legfit(x, time, 2)[2]
    straight = time - np.polynomial.polynomial.polyval(x, np.polyfit(x, time, 1)[::-1])
    if abs(bend) > max(clock.step, 2 * clock.resolution) and np.std(straight) < 2 * abs(bend):
        what = (
            f"the clock's rate changes: in the middle stamps are {1.5 * abs(bend):.3g} s "
            "off an even clock that fits both ends"
        )
        size = 1.5 * float(abs(bend))
        yield Defect("drift", (), what, rows, size, Severity.REPAIRABLE, RESAMPLE)


def drift_between(time: Array, other: Array) -> Iterator[Defect]:
    """How one clock runs against another that stamped the same samples, both shape (n,), s."""
    told = np.isfinite(time) & np.isfinite(other)
    if told.sum() < FEWEST or np.ptp(time[told]) <= 0:
        return
    slope = float(np.polyfit(time[told] - time[told][0], other[told], 1)[0])
    if abs(slope - 1) > CLOCK_ERROR:
        size = slope - 1
        apart = abs(size) * float(np.ptp(time[told]))
        what = f"the other clock runs {1e6 * size:+.4g} ppm against this one, {apart:.3g} s in all"
        step = ticks(time[told]).step
        severity = Severity.REPAIRABLE if step and apart > step else Severity.NOTED
        yield Defect("drift", (), what, (0, len(time) - 1), size, severity)
