"""Numbers read from a sampled curve, with the error between samples.

For curves without noise, as a simulation records them. The intervals are brackets: they hold the
number of this one recording, whatever a curve of the shape that is said does between its samples.
How a repetition would scatter, only repetitions tell (`together`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from campaign.arrays import Array
from campaign.estimate import Estimate
from campaign.estimation.intervals import (
    LEVEL,
    NO_STANDARD_ERROR,
    of_repeats,
    shifted_by,
    student,
)
from campaign.reason import Cause

SAMPLES = "time between samples"
"""Source of the systematic part that is left of brackets once repetitions are averaged."""
LOST = Cause("samples lost", "samples were lost")
PEAK_AT_END = Cause("peak at an end", "it is still rising at an end of what was looked at")
UNRESOLVED_PEAK = Cause("peak not resolved", "the samples are too far apart to resolve it")
ALIKE = Cause("equal parts", "its parts agree to {digits} digits: a simulation without noise")
_ROUNDING = 1e-12  # share of a number below which a difference is none


def bracketed(
    name: str, value: float, unit: str, ends: tuple[float, float], method: str, **more: Any
) -> Estimate:
    """A number that certainly lies between `ends`, in whatever order they are given."""
    low, high = float(min(*ends, value)), float(max(*ends, value))
    return Estimate(name, float(value), unit, low, high, LEVEL, method, **more)


def peak(name: str, samples: Array, unit: str) -> Estimate:
    """The largest value of a curve, from its samples of shape (n,), evenly spaced.

    The curve is concave over the five samples around its peak, or there is no interval: then it
    lies above its chords and below their continuations, and so does the peak. Where samples were
    lost (NaN) it is not determined: it may have been among them.
    """
    if not np.all(np.isfinite(samples)):
        return Estimate.without_interval(name, math.nan, unit, LOST())
    at = int(np.argmax(samples))
    top = float(samples[at])
    if at < 2 or at > len(samples) - 3:
        return Estimate.without_interval(name, top, unit, PEAK_AT_END())
    around = samples[at - 2 : at + 3]
    if np.any(np.diff(around, 2) > _ROUNDING * abs(top)):
        return Estimate.without_interval(name, top, unit, UNRESOLVED_PEAK())
    above = max(_most_between(around[:4]), _most_between(around[:0:-1]))
    return bracketed(name, top, unit, (top, above), "largest sample, and the most between samples")


def _most_between(samples: Array) -> float:
    """The most that a concave curve can be between the second and the third of four samples."""
    rise, fall = float(samples[1] - samples[0]), float(samples[2] - samples[3])
    if rise + fall <= 0:
        return float(samples[2])
    along = (float(samples[2] - samples[1]) + fall) / (rise + fall)
    return float(samples[1]) + min(max(along, 0.0), 1.0) * rise


def upward_crossings(time: Array, samples: Array, level: float) -> tuple[Array, Array]:
    """Where a curve rises through `level`: interpolated times, and the samples' before; (k,)."""
    above = samples > level
    after = 1 + np.flatnonzero(above[1:] & ~above[:-1])
    before = after - 1
    share = (level - samples[before]) / (samples[after] - samples[before])
    return time[before] + share * (time[after] - time[before]), time[before]


def at_sample(name: str, samples: Array, at: int, unit: str) -> Estimate:
    """A curve's value at a moment that is known to one sample either way, for a smooth curve.

    Not determined where one of these samples was lost (NaN).
    """
    near = samples[max(at - 1, 0) : at + 2]
    if not np.all(np.isfinite(near)):
        return Estimate.without_interval(name, math.nan, unit, LOST())
    ends = float(np.min(near)), float(np.max(near))
    return bracketed(name, float(samples[at]), unit, ends, "sample, and those beside it")


def together(found: Sequence[Estimate], what: str = "repeats") -> Estimate:
    """One number from repetitions: itself where there is one, else their mean with Student's t.

    What each is uncertain by between its samples stays, as a rectangular distribution (GUM 4.3.7).
    Where one was not determined (NaN) the mean is not either, for the same reason.
    """
    first = next((each for each in found if math.isnan(each.value)), found[0])
    if len(found) == 1 or math.isnan(first.value):
        return first
    values = [each.value for each in found]
    mean = of_repeats(first.name, values, first.unit, what, systematic=first.systematic)
    brackets = [each.half_width for each in found if each.standard_error is None]
    if not brackets:
        return drop_interval_if_deterministic(mean, max(map(abs, values)))
    widest = max(brackets) if all(map(math.isfinite, brackets)) else None
    return shifted_by(mean, SAMPLES, None if widest is None else widest / math.sqrt(3.0))


def drop_interval_if_deterministic(estimate: Estimate, scale: float, digits: int = 9) -> Estimate:
    """The estimate, without its interval where that is below `digits` digits of `scale` (its unit).

    A simulation without noise repeats itself to the last digits: that says nothing of how far its
    numbers can be trusted, and an interval of it would claim a lot.
    """
    half = estimate.half_width
    if not half <= 10.0**-digits * scale:
        return estimate
    reason = ALIKE(digits=digits)
    return replace(estimate, low=None, high=None, level=None, standard_error=None, reason=reason)


def largest(name: str, found: Sequence[Estimate], unit: str) -> Estimate:
    """The largest of several numbers, with an interval that holds it whichever of them it is.

    The intervals are made wide enough to hold all numbers at once (Bonferroni), by Student's t
    where they have a standard error; the largest then lies between the largest of the lower and
    the largest of the upper ends.
    """
    top = max(each.value for each in found)
    without = next((each for each in found if each.standard_error is None), None)
    if without is not None:
        reason = without.reason or NO_STANDARD_ERROR(whom="them")
        return Estimate.without_interval(name, top, unit, reason)
    level = 1.0 - (1.0 - LEVEL) / len(found)
    halves = [
        student(each.freedom or math.inf, level) * (each.standard_error or 0.0) for each in found
    ]
    ends = (
        max(each.value - half for each, half in zip(found, halves, strict=True)),
        max(each.value + half for each, half in zip(found, halves, strict=True)),
    )
    return bracketed(name, top, unit, ends, f"largest of {len(found)}, all held at once")


def shifted(name: str, estimate: Estimate, by: float) -> Estimate:
    """The estimate plus a number that is known exactly, by another name."""
    low, high = (None if end is None else end + by for end in (estimate.low, estimate.high))
    return replace(estimate, name=name, value=estimate.value + by, low=low, high=high)


def named(estimate: Estimate, name: str) -> Estimate:
    """The same number by another name."""
    return replace(estimate, name=name)
