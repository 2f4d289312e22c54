"""Mean and deviation of few readings of a quantized sensor.

Rounding to a count adds the variance count^2/12 where readings scatter over several counts, and
anything from nothing to a quarter of a count squared where they do not (Sheppard's corrections and
their limit).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from campaign.estimate import Estimate
from campaign.estimation.intervals import LEVEL, of_repeats, shifted_by
from campaign.reason import Cause

DITHERED = 0.5
"""Deviation over count from which rounding errors of readings are independent of each other."""
RESOLUTION = "sensor resolution"
SINGLE_READING = Cause("single reading", "a single reading has no deviation")
WITHIN_A_COUNT = Cause(
    "below one count", "less than one count of the sensor: from zero up to a bound"
)


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
    from scipy.special import chdtri

    found = np.asarray(readings, dtype=float)
    value = float(np.std(found - found[0]))  # equal readings have none, not a rounding error
    freedom = len(found) - 1
    if freedom < 1:
        return Estimate.without_interval(name, value, unit, SINGLE_READING())
    squares, tail = value**2 * len(found), 0.5 * (1.0 - LEVEL)
    # chdtri is the inverse of the upper tail.
    high = math.sqrt(squares / chdtri(freedom, 1.0 - tail))
    method = f"chi-square of {len(found)} readings"
    estimate = Estimate(name, value, unit, None, high, LEVEL, method, freedom=freedom)
    if value < count:
        high = max(high, _largest_unseen(len(found), count))
        return replace(estimate, low=0.0, high=high, reason=WITHIN_A_COUNT())
    low = math.sqrt(max(0.0, squares / chdtri(freedom, tail) - count**2 / 12.0))
    return replace(estimate, low=low)


def _scatter(readings: Sequence[float], count: float) -> float:
    """Deviation of what was rounded, as far as it can be told (Sheppard)."""
    variance = float(np.var(np.asarray(readings) - readings[0], ddof=1))
    return math.sqrt(max(0.0, variance - count**2 / 12.0))


def _largest_unseen(readings: int, count: float) -> float:
    """Deviation that leaves so many readings on one count in 5 % of all cases, at best."""
    from scipy.special import ndtri

    within = (1.0 - LEVEL) ** (1.0 / readings)
    return 0.5 * count / float(ndtri(0.5 * (1.0 + within)))
