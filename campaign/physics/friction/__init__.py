"""Friction models: one file each."""

from __future__ import annotations

from functools import cache
from typing import Annotated, Any

from campaign.choice import Choice
from campaign.physics.friction.interface import FrictionModel
from campaign.plugins import Kinds


@cache
def friction_models() -> Kinds[FrictionModel]:
    """Every friction model, by name."""
    return Kinds("friction model", __name__, "FRICTION", FrictionModel, tag="model")


FrictionField = Annotated[Any, Choice("model", friction_models)]
"""The options of one friction model, told by `model`."""


def is_dry(options: Any) -> bool:
    """Whether a model is a set at rest, which as a plant's friction the engine solves for."""
    return friction_models()[options.model].dry is not None


def jumps(options: Any) -> bool:
    """Whether its torque, as a compensation, has the sign of the rate."""
    dry = friction_models()[options.model].dry
    return dry is not None and dry.jumps(options)
