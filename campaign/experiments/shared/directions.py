"""Friction by direction, and a constant force that resembles its asymmetry.

A sensor's zero, or a weight, of size c adds c to the friction of the positive direction and removes
c from that of the negative one. Half of the difference may be such a force. The mean of both
directions does not depend on it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from campaign.estimate import Estimate
from campaign.parameter import is_value
from campaign.reason import Cause

OFFSET_OR_ASYMMETRY = Cause(
    "offset or asymmetry",
    "{half:.3g} of it, half of the difference between the directions, may be a constant force",
)


def with_offset(found: Mapping[str, Estimate], name: str) -> dict[str, Estimate]:
    """Estimates by name; those of both directions with the possible constant force as a reason.

    name: of the friction, e.g. `coulomb` for `coulomb_positive` and `coulomb_negative`. If the two
        differ by less than the larger of their half-widths, nothing is added.
    """
    both = [found.get(f"{name}_{side}") for side in ("positive", "negative")]
    determined = [each for each in both if each is not None and is_value(each)]
    widest = max((each.half_width for each in determined), default=0.0)
    if len(determined) < 2 or not abs(determined[0].value - determined[1].value) > widest:
        return dict(found)
    reason = OFFSET_OR_ASYMMETRY(half=0.5 * abs(determined[0].value - determined[1].value))
    names = [key for key, each in found.items() if each in determined and not each.reason]
    return {**found, **{key: replace(found[key], reason=reason) for key in names}}
