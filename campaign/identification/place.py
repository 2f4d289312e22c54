"""Where a single value stands among repetitions: a published one among seeds, say.

The interval of a mean says where the mean is. One value out of a document, from one bench on one
day, scatters as a single trial does; it is to be held against their distribution.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from campaign.estimate import Estimate
from campaign.identification.intervals import LEVEL, exponential, student
from campaign.identification.sampled import where_it_scatters

Array = NDArray[np.float64]


def place_in(values: Sequence[Estimate | float] | Array, published: float) -> Estimate:
    """Share of all such values that lie below `published`; ties count half.

    With the exact interval of a share of n draws (Clopper and Pearson 1934): [0, 0.31] for the
    smallest of ten. A published value is an ordinary one where the share may be anything from
    0.025 to 0.975. Raises ValueError for no values.
    """
    from scipy.special import betaincinv

    bare = (one.value if isinstance(one, Estimate) else float(one) for one in values)
    found = np.array([value for value in bare if math.isfinite(value)])
    if not len(found):
        raise ValueError("a place among no values")
    count, tail = len(found), 0.5 * (1.0 - LEVEL)
    below = float(np.sum(found < published) + 0.5 * np.sum(found == published))
    low = float(betaincinv(below, count - below + 1, tail)) if below > 0 else 0.0
    high = float(betaincinv(below + 1, count - below, 1 - tail)) if below < count else 1.0
    method = f"share of {count} values below it, Clopper and Pearson"
    return Estimate(
        "place", below / count, "", low, high, LEVEL, method, kind="quantile", freedom=count
    )


def of_next(name: str, values: Sequence[float] | Array, unit: str) -> Estimate:
    """Where one further positive value will lie: prediction interval, t in the logarithm.

    Wider than that of the mean by sqrt(n + 1), because the further value scatters, too. Its value
    is the geometric mean. No interval for fewer than two values, or for some that are not positive.
    """
    found = np.asarray(values, dtype=float)
    if len(found) < 2 or not np.all(found > 0):
        mean = float(np.mean(found)) if len(found) else math.nan
        return Estimate.without_interval(name, mean, unit, "it takes two positive values or more")
    logs = np.log(found)
    mean, spread, freedom = float(np.mean(logs)), float(np.std(logs, ddof=1)), len(found) - 1
    error = spread * math.sqrt(1.0 + 1.0 / len(found))
    half = student(freedom) * error
    inner = Estimate(
        name,
        mean,
        "",
        mean - half,
        mean + half,
        LEVEL,
        f"where one more trial will lie, from {len(found)}; Student's t in the logarithm",
        kind="quantile",
        standard_error=error,
        freedom=freedom,
    )
    told = exponential(inner, unit)
    return where_it_scatters(told, told.value)
