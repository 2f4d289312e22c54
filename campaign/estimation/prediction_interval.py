"""Prediction interval of one more value among repetitions.

The interval of a mean says where the mean is. One further value scatters as a single trial does; it
is to be held against their distribution. (`published.draws` does that for a published value.)
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from campaign.arrays import Array
from campaign.estimate import Estimate
from campaign.estimation.intervals import exponential, with_error
from campaign.estimation.sampled_curve import drop_interval_if_deterministic
from campaign.reason import Cause

TOO_FEW_POSITIVE = Cause("too few positive values", "it takes two positive values or more")


def of_next(name: str, values: Sequence[float] | Array, unit: str) -> Estimate:
    """Where one further positive value will lie: prediction interval, t in the logarithm.

    Wider than that of the mean by sqrt(n + 1), because the further value scatters, too. Its value
    is the geometric mean. No interval for fewer than two values, or for some that are not positive.
    """
    found = np.asarray(values, dtype=float)
    if len(found) < 2 or not np.all(found > 0):
        mean = float(np.mean(found)) if len(found) else math.nan
        return Estimate.without_interval(name, mean, unit, TOO_FEW_POSITIVE())
    logs = np.log(found)
    mean, spread, freedom = float(np.mean(logs)), float(np.std(logs, ddof=1)), len(found) - 1
    error = spread * math.sqrt(1.0 + 1.0 / len(found))
    method = f"where one more trial will lie, from {len(found)}; Student's t in the logarithm"
    inner = with_error(name, mean, "", error, freedom, method, kind="quantile")
    told = exponential(inner, unit)
    return drop_interval_if_deterministic(told, told.value)
