"""Numbers read from a sampled curve, with the error between samples.

For noise-free curves of a simulation. The intervals are brackets: they include the number of this
recording for every curve of the stated shape through the samples. They do not include the scatter
between repetitions (see `together`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from campaign.arrays import Array
from campaign.estimate import Estimate
from campaign.estimation.intervals import LEVEL, NO_STANDARD_ERROR, of_repeats, shifted_by, student
from campaign.reason import Cause

SAMPLES = "time between samples"
"""Source of the systematic part that remains of brackets in a mean over repetitions."""
LOST = Cause("samples lost", "samples were lost")
PEAK_AT_END = Cause("peak at an end", "it is still rising at an end of what was looked at")
UNRESOLVED_PEAK = Cause("peak not resolved", "the samples are too far apart to resolve it")
ALIKE = Cause("equal parts", "its parts agree to {digits} digits: a simulation without noise")
_ROUNDING = 1e-12  # share of a number below which a difference counts as zero


def bracketed(
    name: str, value: float, unit: str, ends: tuple[float, float], method: str, **more: Any
) -> Estimate:
    """Number that certainly lies between `ends`, which may be in any order."""
    low, high = float(min(*ends, value)), float(max(*ends, value))
    return Estimate(name, float(value), unit, low, high, LEVEL, method, **more)


def peak(name: str, samples: Array, unit: str) -> Estimate:
    """Largest value of a curve, from its samples of shape (n,), evenly spaced.

    The interval needs a curve that is concave over the five samples around its peak: then the peak
    lies above the chords and below their extensions. Where samples are missing (NaN) the peak is
    not determined, because it may be one of them.
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
    """Upper bound of a concave curve between the second and the third of four samples."""
    rise, fall = float(samples[1] - samples[0]), float(samples[2] - samples[3])
    if rise + fall <= 0:
        return float(samples[2])
    along = (float(samples[2] - samples[1]) + fall) / (rise + fall)
    return float(samples[1]) + min(max(along, 0.0), 1.0) * rise


def upward_crossings(time: Array, samples: Array, level: float) -> tuple[Array, Array]:
    """Times of rises through `level`: interpolated, and of the sample before; shapes (k,)."""
    above = samples > level
    after = 1 + np.flatnonzero(above[1:] & ~above[:-1])
    before = after - 1
    share = (level - samples[before]) / (samples[after] - samples[before])
    return time[before] + share * (time[after] - time[before]), time[before]


def at_sample(name: str, samples: Array, at: int, unit: str) -> Estimate:
    """Value of a smooth curve at a time with an uncertainty of one sample.

    Not determined where one of these samples is missing (NaN).
    """
    near = samples[max(at - 1, 0) : at + 2]
    if not np.all(np.isfinite(near)):
        return Estimate.without_interval(name, math.nan, unit, LOST())
    ends = float(np.min(near)), float(np.max(near))
    return bracketed(name, float(samples[at]), unit, ends, "sample, and those beside it")


def together(found: Sequence[Estimate], what: str = "repeats") -> Estimate:
    """Mean of repetitions with Student's t; a single one is returned unchanged.

    The widest bracket remains as a systematic part, as a rectangular distribution (GUM 4.3.7).
    If one value is not determined (NaN), the mean is not determined, for the same reason.
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
    """Remove an interval that is below `digits` digits of `scale` (in the unit of the estimate).

    Repetitions of a noise-free simulation are equal to the last digits. An interval from their
    scatter would suggest an accuracy that the numbers do not have.
    """
    half = estimate.half_width
    if not half <= 10.0**-digits * scale:
        return estimate
    reason = ALIKE(digits=digits)
    return replace(estimate, low=None, high=None, level=None, standard_error=None, reason=reason)


def largest(name: str, found: Sequence[Estimate], unit: str) -> Estimate:
    """Largest of several numbers, with an interval that is valid for each of them as the largest.

    Simultaneous intervals of all numbers (Bonferroni, Student's t): the largest number lies between
    the largest of the lower and the largest of the upper ends. No interval without standard errors.
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
    """Estimate plus an exact number, under another name."""
    low, high = (None if end is None else end + by for end in (estimate.low, estimate.high))
    return replace(estimate, name=name, value=estimate.value + by, low=low, high=high)
