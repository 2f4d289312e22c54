"""Compensation methods: one file each."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Annotated, Any, Union

from pydantic import Field

from campaign.physics.compensation.interface import CompensationMethod
from campaign.plugins import discover


@cache
def compensation_methods() -> dict[str, CompensationMethod]:
    """Every compensation method, by name."""
    return discover(__name__, "COMPENSATION", "campaign.compensation")


if TYPE_CHECKING:
    CompensationField = Any
else:
    CompensationField = Annotated[
        Union[tuple(method.options for method in compensation_methods().values())],  # noqa: UP007
        Field(discriminator="method"),
    ]
