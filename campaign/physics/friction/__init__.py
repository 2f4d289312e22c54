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
