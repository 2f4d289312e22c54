"""Compensation methods: one file each."""

from __future__ import annotations

from functools import cache
from typing import Annotated, Any

from campaign.choice import Choice
from campaign.physics.compensation.interface import CompensationMethod
from campaign.plugins import Kinds


@cache
def compensation_methods() -> Kinds[CompensationMethod]:
    """All compensation methods, by name."""
    return Kinds("compensation method", __name__, "COMPENSATION", CompensationMethod, tag="method")


CompensationField = Annotated[Any, Choice("method", compensation_methods)]
"""Options of one compensation method, selected by `method`."""
