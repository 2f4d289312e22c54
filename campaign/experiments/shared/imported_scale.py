"""Uncertainty of the scale of imported channels."""

from __future__ import annotations

from campaign.estimate import Estimate, Origin
from campaign.estimation.intervals import shifted_by
from campaign.experiments.interface import TrialData

SOURCE = "constant of the {} column"


def scale_uncertainty(data: TrialData, channel: str) -> float | None:
    """Relative standard uncertainty of what a column was multiplied by; None: nobody said."""
    channels = data.trial.recording.get("channels")
    for each in channels if isinstance(channels, list) else []:
        if isinstance(each, dict) and each.get("name") == channel:
            found = each.get("relative_uncertainty")
            return float(found) if isinstance(found, int | float) else None
    return None


def with_scale(estimate: Estimate, data: TrialData, channel: str) -> Estimate:
    """An estimate that is proportional to a channel, with the part of that channel's constant."""
    relative = scale_uncertainty(data, channel)
    if relative is None or estimate.origin is Origin.NOT_DETERMINED:
        return estimate
    return shifted_by(estimate, SOURCE.format(channel), abs(estimate.value) * relative, of_rig=True)
