"""Scatter of numbers with chi-square intervals, also of few readings of a quantized sensor.

Rounding to a count adds the variance count^2/12 where readings scatter over several counts, and 0
to count^2/4 where they do not (Sheppard's corrections and their limit).
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
"""Deviation over count above which rounding errors of readings are independent."""
RESOLUTION = "sensor resolution"
SINGLE_READING = Cause("single reading", "a single reading has no deviation")
WITHIN_A_COUNT = Cause(
    "below one count", "less than one count of the sensor: from zero up to a bound"
)
ZERO_MEAN = Cause("mean of zero", "its mean is zero")


def deviation_limits(deviation: float, freedom: float) -> tuple[float, float]:
    """Ends of the 95 % interval of a standard deviation with degrees of freedom `freedom`."""
    from scipy.special import chdtri

    # chdtri takes the upper tail.
    tails = 0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL
    low, high = (deviation * math.sqrt(freedom / float(chdtri(freedom, tail))) for tail in tails)
    return low, high


def relative_scatter(name: str, values: Array) -> Estimate:
    """Standard deviation (divisor n) of all values over their mean, for repeated sets of numbers.

    The rows are repeats; the columns (such as both directions of a map) are fixed, and the entries
    of a row are correlated. So the square has two parts: the scatter of rows, with a chi-square
    interval of m - 1, and the difference of columns, with Student's t. Squares of distances combine
    their intervals (Zou and Donner, "Construction of confidence limits about effect measures",
    Stat. Med. 27 (2008)).

    values: shape (m, k). The interval is for the deviation of many rows. With a mean of zero (no
    friction in any row) the result is not determined.
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

    Readings with a scatter below half a count have almost the same rounding error: a systematic
    part, rectangular with a half-width of half a count.
    """
    mean = of_repeats(name, readings, unit, "readings")
    alike = len(readings) < 2 or _scatter(readings, count) < DITHERED * count
    return shifted_by(mean, RESOLUTION, count / math.sqrt(12.0) if alike else 0.0)


def deviation_of_readings(
    name: str, readings: Sequence[float], unit: str, count: float = 0.0
) -> Estimate:
    """Standard deviation of readings (divisor n), with the interval of that of their population.

    The interval is by chi-square. Below one count of the sensor (0: none) rounding alone may cause
    the deviation: then the interval is from zero to the largest deviation that is possible.
    """
    values = np.asarray(readings, dtype=float)
    value = float(np.std(values - values[0]))  # exactly 0 for equal readings
    freedom = len(values) - 1
    if freedom < 1:
        return Estimate.without_interval(name, value, unit, SINGLE_READING())
    # The limits need the divisor n - 1.
    low, high = deviation_limits(value * math.sqrt(len(values) / freedom), freedom)
    method = f"chi-square of {len(values)} readings"
    estimate = Estimate(name, value, unit, None, high, LEVEL, method, freedom=freedom)
    if value < count:
        high = max(high, _largest_unseen(len(values), count))
        return replace(estimate, low=0.0, high=high, reason=WITHIN_A_COUNT())
    return replace(estimate, low=math.sqrt(max(0.0, low**2 - count**2 / 12.0)))


def _scatter(readings: Sequence[float], count: float) -> float:
    """Estimated deviation before rounding (Sheppard)."""
    variance = float(np.var(np.asarray(readings) - readings[0], ddof=1))
    return math.sqrt(max(0.0, variance - count**2 / 12.0))


def _largest_unseen(readings: int, count: float) -> float:
    """Largest deviation with which all `readings` have the same count in 5 % of cases."""
    from scipy.special import ndtri

    within = (1.0 - LEVEL) ** (1.0 / readings)
    return 0.5 * count / float(ndtri(0.5 * (1.0 + within)))
