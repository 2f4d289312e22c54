"""The gear between motor and load."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from pydantic import Field, ValidationInfo, model_validator

from campaign.options import LaterOptions, is_archived
from campaign.physics.friction_paths import invalid
from campaign.physics.preload import PreloadOptions
from campaign.units import LEAD, Lead


class GearOptions(LaterOptions):
    """The gear between motor and load."""

    later = frozenset({"lead"})

    ratio: float = Field(gt=0)
    """N: motor rate over load rate."""
    lead: Lead | None = Field(default=None, gt=0)
    """Travel of a linear load per revolution of a rotary motor, in place of the ratio; absent: the
    motor moves as the load does."""
    preload: PreloadOptions | None = None
    """Its anti-backlash preload; absent: the friction parameters include it."""

    @model_validator(mode="before")
    @classmethod
    def _ratio_of_lead(cls, tree: Any, info: ValidationInfo) -> Any:
        """Set N = 2 pi / lead, in radians of the motor per meter of the load, from a lead."""
        if not isinstance(tree, Mapping) or tree.get("lead") is None:
            return tree
        # An archived ratio is that of an earlier lead.
        if "ratio" in tree and not is_archived(info):
            raise invalid([(("ratio",), "'ratio' follows from 'lead'; remove one of the two")])
        return {**tree, "ratio": _ratio(tree["lead"])}


def _ratio(lead: Any) -> float:
    """Ratio of a lead, as text or in SI; 1 for an invalid lead, which its own field reports."""
    try:
        travel = LEAD.parse(lead) if isinstance(lead, str) else float(lead)
    except (TypeError, ValueError):
        return 1.0
    # m/rev, so that a file's 10 mm/rev is 0.01 in the archive.
    return 2.0 * math.pi / travel if travel > 0 and math.isfinite(travel) else 1.0
