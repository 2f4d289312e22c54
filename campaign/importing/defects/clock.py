"""The clock behind the stamps of a recording: its step, its rounding, its gaps, its restarts.

A missing sample shifts everything behind it for good, a late stamp only itself: that tells a gap
from jitter. Stamps of a coarse clock jump by its step, which is neither.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from campaign.importing.defects.defect import Array

SHORTEST = 10
"""Samples that a recording has at least: fewer tell no motion."""
_BESIDE = 5
"""Samples on either side by which a lasting shift is told from a late stamp."""


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
