"""Friction models: one file each."""

from __future__ import annotations

from functools import cache
from typing import Annotated, Any

from campaign.choice import Choice
from campaign.physics.friction.interface import FrictionModel, SmallSignal
from campaign.plugins import Kinds


@cache
def friction_models() -> Kinds[FrictionModel]:
    """All friction models, by name."""
    return Kinds("friction model", __name__, "FRICTION", FrictionModel, tag="model")


FrictionField = Annotated[Any, Choice("model", friction_models)]
"""Options of one friction model, selected by `model`."""


def model_of(options: Any) -> FrictionModel:
    """The model of these options."""
    return friction_models()[options.model]


def small_signal_of(options: Any) -> SmallSignal:
    """Response to small motions; without springs if the model does not declare it."""
    declared = model_of(options).small_signal
    return SmallSignal(None, None) if declared is None else declared(options)


def is_dry(options: Any) -> bool:
    """Whether a model is set-valued at rest; the engine solves for it in the plant."""
    return model_of(options).dry is not None


def jumps(options: Any) -> bool:
    """Whether its torque as a compensation jumps with the sign of the rate."""
    dry = model_of(options).dry
    return dry is not None and dry.jumps(options)
