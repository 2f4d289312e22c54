"""Scatter of numbers with chi-square intervals."""

from __future__ import annotations

import math

import numpy as np

from campaign.arrays import Array
from campaign.estimate import Estimate
from campaign.estimation.intervals import LEVEL, SINGLE_VALUE, student
from campaign.reason import Cause

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
