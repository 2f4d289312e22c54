"""Friction models: one file each."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Annotated, Any, Union

from pydantic import Field

from campaign.physics.friction.interface import FrictionModel
from campaign.plugins import discover


@cache
def friction_models() -> dict[str, FrictionModel]:
    """Every friction model, by name."""
    return discover(__name__, "FRICTION", "campaign.friction")


if TYPE_CHECKING:
    FrictionField = Any
else:
    FrictionField = Annotated[
        Union[tuple(model.options for model in friction_models().values())],  # noqa: UP007
        Field(discriminator="model"),
    ]
