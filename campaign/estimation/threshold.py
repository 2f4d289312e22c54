"""Crossing of a threshold by a measured curve: interval, or bound.

An error is measured at some changes of a parameter, each with its own scatter; between them it is a
straight line. Where the line exceeds the threshold by more than its scatter, it has surely passed;
where it is below by more than that, it has surely not.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from campaign.arrays import Array
from campaign.estimate import Estimate, Systematic
from campaign.estimation.intervals import LEVEL
from campaign.reason import Cause, Reason

BEYOND_WITHOUT_CHANGE = Cause(
    "beyond without change", "the error is beyond the threshold without any change"
)
NOT_PASSED = Cause("threshold not passed", "the threshold is not passed by any change tried")
NOT_SEEN_TO_PASS = Cause("threshold not seen passed", "the threshold is not passed; {why}")
HIDDEN_BY_SCATTER = Cause(
    "threshold within scatter", "the scatter of the error without change reaches the threshold"
)

FINE = 40
"""Steps between two changes for the comparison of line and scatter with the threshold."""
MANY = 1e9
"""Degrees of freedom that stand for infinitely many."""
ONE_SIDED = 2 * LEVEL - 1
"""Two-sided level of a one-sided 95 % bound."""


@dataclass(frozen=True)
class Threshold:
    """A fixed threshold, or `ratio` times the error without change (`value` is the product)."""

    value: float
    ratio: float | None = None


def crossing(change: Array, error: Array, threshold: float) -> float | None:
    """Smallest size of a change at which `error` passes `threshold`, linearly interpolated.

    The search goes outwards from no change on both sides; the nearer crossing counts. 0 when the
    error without change is beyond it; None without a crossing. Shapes (n,), changes increasing.
    """
    middle = int(np.argmin(np.abs(change)))
    if error[middle] > threshold:
        return 0.0
    passed = (_first(change, error, threshold, side) for side in _sides(len(change), middle))
    sizes = [abs(place) for place in passed if place is not None]
    return float(min(sizes)) if sizes else None


def _sides(count: int, middle: int) -> tuple[list[int], list[int]]:
    """Indices from the middle outwards on both sides, including the middle."""
    return list(range(middle, count)), list(range(middle, -1, -1))


def _first(change: Array, error: Array, threshold: float, side: Sequence[int]) -> float | None:
    for before, here in pairwise(side):
        if error[here] > threshold:
            share = (threshold - error[before]) / (error[here] - error[before])
            return float(change[before] + share * (change[here] - change[before]))
    return None


def passing(name: str, change: Array, errors: Sequence[Estimate], threshold: Threshold) -> Estimate:
    """Smallest size of a change at which the error passes the threshold, with its interval.

    The interval is between the changes at which the line, with the scatter of its two neighbors,
    may and must have passed (Fieller's construction); it is open without the latter. The error of
    the straight line is the systematic part: the distance to a monotone cubic. Without a crossing
    the result is a bound (`at least`), up to which the error surely has not passed, at 95 %.

    Args:
        change: shape (n,), increasing, 0 among them.
        errors: one for each change; independent of each other.
    """
    error = np.array([one.value for one in errors])
    value = crossing(change, error, threshold.value)
    without = next((one.reason for one in errors if one.standard_error is None), None)
    if value is None:
        return _bound(name, change, errors, threshold, without)
    if value == 0.0:
        return Estimate.without_interval(name, 0.0, "", BEYOND_WITHOUT_CHANGE())
    interpolated = _interpolation(change, error, threshold.value, value)
    method = "straight line between the changes tried"
    parts = (Systematic("interpolation", interpolated),)
    if without is not None:
        return Estimate.without_interval(name, value, "", without, method=method, systematic=parts)
    low = _nearest(change, errors, threshold, 1.0)
    high = _nearest(change, errors, threshold, -1.0)
    method += ", where the scatter of its neighbours lets it pass"
    low = min(value, low if low is not None else value)
    return Estimate(name, value, "", low, high, LEVEL, method, systematic=parts)


def _bound(
    name: str,
    change: Array,
    errors: Sequence[Estimate],
    threshold: Threshold,
    without: Reason | None,
) -> Estimate:
    """Lower bound of the change, within the smaller of the two ranges tried."""
    reach = float(min(-change[0], change[-1]))
    method = "the largest change tried"
    if without is not None:
        reason = NOT_SEEN_TO_PASS(why=without)
        return Estimate(name, reach, "", kind="at least", method=method, reason=reason)
    may = _nearest(change, errors, threshold, 1.0, ONE_SIDED)
    if may is not None and may < reach:
        reach, method = may, "the largest change at which the scatter cannot hide a passing"
    if not reach > 0:
        return Estimate.without_interval(name, math.nan, "", HIDDEN_BY_SCATTER())
    reason = NOT_PASSED()
    return Estimate(name, reach, "", kind="at least", level=LEVEL, method=method, reason=reason)


def _nearest(
    change: Array,
    errors: Sequence[Estimate],
    threshold: Threshold,
    sign: float,
    level: float = LEVEL,
) -> float | None:
    """Smallest size of a change at which the upper (sign +1) or lower (-1) end passes."""
    sizes = []
    for side in _sides(len(change), int(np.argmin(np.abs(change)))):
        place, gap, half = _band(change, errors, threshold, side, level)
        end = gap + sign * half
        passed = np.flatnonzero(end > 0)
        if len(passed):
            first = int(passed[0])
            sizes.append(abs(_zero(place, end, first) if first else place[0]))
    return float(min(sizes)) if sizes else None


def _zero(place: Array, end: Array, first: int) -> float:
    """Zero of the chord before the first positive end."""
    before = first - 1
    slope = (end[first] - end[before]) / (place[first] - place[before])
    return float(place[before] - end[before] / slope)


def _band(
    change: Array,
    errors: Sequence[Estimate],
    threshold: Threshold,
    side: Sequence[int],
    level: float,
) -> tuple[Array, Array, Array]:
    """Changes outwards from none, line minus threshold, and half-width of its interval, each (m,).

    The line is a weighted sum of independent errors, with Welch's degrees of freedom.
    """
    from scipy.special import stdtrit

    steps = np.arange((len(side) - 1) * FINE + 1)
    segment = np.minimum(steps // FINE, len(side) - 2)
    share = steps / FINE - segment
    weights = np.zeros((len(steps), len(change)))
    weights[steps, np.array(side)[segment]] += 1.0 - share
    weights[steps, np.array(side)[segment + 1]] += share
    place = weights @ change
    fixed = threshold.value
    if threshold.ratio is not None:
        weights[:, side[0]] -= threshold.ratio
        fixed = 0.0
    variance = (weights * [one.standard_error or 0.0 for one in errors]) ** 2
    own = np.sum(variance**2 / [one.freedom or MANY for one in errors], axis=1)
    total = np.sum(variance, axis=1)
    freedom = np.divide(total**2, own, out=np.full(len(own), MANY), where=own > 0)
    half = stdtrit(np.maximum(freedom, 1.0), 0.5 + 0.5 * level) * np.sqrt(total)
    return place, weights @ np.array([one.value for one in errors]) - fixed, half


def _interpolation(change: Array, error: Array, threshold: float, value: float) -> float:
    """Standard uncertainty of the straight line: its distance from a monotone cubic.

    0 with fewer than three changes, which determine no curve.
    """
    if len(change) < 3:
        return 0.0
    from scipy.interpolate import PchipInterpolator

    curve = PchipInterpolator(change, error)
    fine = np.unique(np.concatenate([np.linspace(change[0], change[-1], 20 * len(change)), change]))
    bent = crossing(fine, curve(fine), threshold)
    return abs((value if bent is None else bent) - value)
