"""Scatter of numbers with chi-square intervals, also of few readings of a quantized sensor.

Rounding to a count adds the variance count^2/12 where readings scatter over several counts, and
anything from nothing to a quarter of a count squared where they do not (Sheppard's corrections and
their limit).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from campaign.arrays import Array
from campaign.estimate import Estimate
from campaign.estimation.intervals import LEVEL, SINGLE_VALUE, of_repeats, shifted_by, student
from campaign.reason import Cause

DITHERED = 0.5
"""Deviation over count from which rounding errors of readings are independent of each other."""
RESOLUTION = "sensor resolution"
SINGLE_READING = Cause("single reading", "a single reading has no deviation")
WITHIN_A_COUNT = Cause(
    "below one count", "less than one count of the sensor: from zero up to a bound"
)
ZERO_MEAN = Cause("mean of zero", "its mean is zero")


def deviation_limits(deviation: float, freedom: float) -> tuple[float, float]:
    """Ends of the 95 % interval of a standard deviation that was estimated with `freedom`."""
    from scipy.special import chdtri

    # chdtri takes the upper tail.
    tails = 0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL
    low, high = (deviation * math.sqrt(freedom / float(chdtri(freedom, tail))) for tail in tails)
    return low, high


def relative_scatter(name: str, values: Array) -> Estimate:
    """Standard deviation of all values over their mean, with n, of repeated sets of a few numbers.

    What is repeated are the rows; the columns (both directions of a map, say) are always the same
    ones, and a row's entries share what makes it differ from the next. So the square is one part
    that rows scatter by, with a chi-square interval of m - 1, and one by which columns differ,
    with Student's t; their intervals are put together by squares of distances (Zou and Donner,
    "Construction of confidence limits about effect measures", Stat. Med. 27 (2008)).

    values: shape (m, k). The interval is of the deviation that many rows would have. A mean of zero
    (a friction that no row shows) has no share: not determined.
    """
    sets, columns = values.shape
    mean = float(np.mean(values))
    if mean == 0.0:
        return Estimate.without_interval(name, math.nan, "", ZERO_MEAN())
    value = float(np.std(values)) / mean
    if sets < 2:
        reason = SINGLE_VALUE(what="set", others="repeats")
        return Estimate.without_interval(name, value, "", reason)
    within = math.sqrt(float(np.mean(np.var(values, axis=0, ddof=1)))) / mean
    within_ends = deviation_limits(within, sets - 1)
    apart = values - values.mean(axis=1, keepdims=True)
    shifts = apart.mean(axis=0) / mean
    between = math.sqrt(float(np.mean(shifts**2)))
    error = math.sqrt(float(np.mean(np.var(apart, axis=0, ddof=1))) / sets) / mean
    half = student(sets - 1) * error
    between_ends = max(0.0, between - half), between + half
    square = within**2 + between**2
    ends = []
    for w, b, sign in zip(within_ends, between_ends, (-1.0, 1.0), strict=True):
        distance = math.hypot(w**2 - within**2, b**2 - between**2)
        ends.append(math.sqrt(max(square + sign * distance, 0.0)))
    low, high = min(ends[0], value), max(ends[1], value)
    method = f"deviation with n of {sets} sets of {columns}; chi-square and t with {sets - 1}"
    return Estimate(name, value, "", low, high, LEVEL, method, freedom=sets - 1)


def mean_of_readings(
    name: str, readings: Sequence[float], unit: str, count: float = 0.0
) -> Estimate:
    """Mean of readings with Student's t; one count of the sensor (0: none) in the same unit.

    Readings that scatter by less than half a count are all rounded by nearly the same: that is a
    systematic part, evenly likely within half a count either way.
    """
    found = of_repeats(name, readings, unit, "readings")
    alike = len(readings) < 2 or _scatter(readings, count) < DITHERED * count
    return shifted_by(found, RESOLUTION, count / math.sqrt(12.0) if alike else 0.0)


def deviation_of_readings(
    name: str, readings: Sequence[float], unit: str, count: float = 0.0
) -> Estimate:
    """Standard deviation of these very readings (divided by their number), and the interval of what
    they are draws of.

    The interval is by chi-square. Below one count of the sensor (0: none) rounding alone could make
    the deviation, and it is a bound: from zero to the largest that such readings leave possible.
    """
    found = np.asarray(readings, dtype=float)
    value = float(np.std(found - found[0]))  # equal readings have none, not a rounding error
    freedom = len(found) - 1
    if freedom < 1:
        return Estimate.without_interval(name, value, unit, SINGLE_READING())
    # With n - 1 in place of n, as the limits take it.
    low, high = deviation_limits(value * math.sqrt(len(found) / freedom), freedom)
    method = f"chi-square of {len(found)} readings"
    estimate = Estimate(name, value, unit, None, high, LEVEL, method, freedom=freedom)
    if value < count:
        high = max(high, _largest_unseen(len(found), count))
        return replace(estimate, low=0.0, high=high, reason=WITHIN_A_COUNT())
    return replace(estimate, low=math.sqrt(max(0.0, low**2 - count**2 / 12.0)))


def _scatter(readings: Sequence[float], count: float) -> float:
    """Deviation of what was rounded, as far as it can be told (Sheppard)."""
    variance = float(np.var(np.asarray(readings) - readings[0], ddof=1))
    return math.sqrt(max(0.0, variance - count**2 / 12.0))


def _largest_unseen(readings: int, count: float) -> float:
    """Deviation that leaves so many readings on one count in 5 % of all cases, at best."""
    from scipy.special import ndtri

    within = (1.0 - LEVEL) ** (1.0 / readings)
    return 0.5 * count / float(ndtri(0.5 * (1.0 + within)))
