"""Friction models: one file each."""

from __future__ import annotations

from functools import cache
from typing import Annotated, Any

from campaign.choice import Choice
from campaign.physics.friction.interface import FrictionModel
from campaign.plugins import Kinds


@cache
def friction_models() -> Kinds[FrictionModel]:
    """All friction models, by name."""
    return Kinds("friction model", __name__, "FRICTION", FrictionModel, tag="model")


FrictionField = Annotated[Any, Choice("model", friction_models)]
"""Options of one friction model, selected by `model`."""


def is_dry(options: Any) -> bool:
    """Whether a model is set-valued at rest; the engine solves for it in the plant."""
    return friction_models()[options.model].dry is not None


def jumps(options: Any) -> bool:
    """Whether its torque as a compensation jumps with the sign of the rate."""
    dry = friction_models()[options.model].dry
    return dry is not None and dry.jumps(options)
