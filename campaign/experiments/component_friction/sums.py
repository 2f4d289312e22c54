"""Sum of the components' means, and the share of the load."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from campaign.estimate import Estimate, Systematic
from campaign.estimation.intervals import welch, with_error
from campaign.estimation.scatter import RESOLUTION
from campaign.reason import NONE


def _of_means(
    name: str, unit: str, parts: Sequence[tuple[float, Estimate]], value: float
) -> Estimate:
    """A value that depends on independent means, each with its derivative (GUM 5.1.2)."""
    reason = next((each.reason for _, each in parts if not each.has_interval), NONE)
    shift = math.hypot(*(slope * each.systematic_uncertainty for slope, each in parts))
    systematic = (Systematic(RESOLUTION, shift),)
    if reason:
        return Estimate.without_interval(name, value, unit, reason, systematic=systematic)
    errors = [(abs(slope) * (each.standard_error or 0.0), each.freedom) for slope, each in parts]
    error = math.hypot(*(size for size, _ in errors))
    method = "of the means, Welch and Satterthwaite"
    return with_error(name, value, unit, error, welch(*errors), method, systematic=systematic)


def total_of(means: Mapping[str, Estimate]) -> Estimate:
    """Sum of the components' means (N m)."""
    value = sum(mean.value for mean in means.values())
    return _of_means("breakaway_torque", "N m", [(1.0, mean) for mean in means.values()], value)


def load_share(means: Mapping[str, Estimate], sides: Mapping[str, str]) -> Estimate:
    """Share of the load in that sum; `sides` says on which side of the gear each component is."""
    total = sum(mean.value for mean in means.values())
    load = sum(mean.value for name, mean in means.items() if sides[name] == "load")
    parts = [
        (((sides[name] == "load") - load / total) / total, mean) for name, mean in means.items()
    ]
    return _of_means("load_share", "", parts, load / total)
