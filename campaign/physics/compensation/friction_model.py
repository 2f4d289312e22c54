"""Model-based compensation: friction models at the measured relative rate (section 5.2).

The static and the LuGre compensation of the thesis are this method with `stribeck` or `lugre`
friction; any other friction model gives a compensation in the same way.
"""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field, field_validator

from campaign.options import Options
from campaign.physics.compensation.interface import CompensationMethod, Compensator
from campaign.physics.friction import FrictionField, model_of


class FrictionModelOptions(Options):
    """Parameters of model-based compensation."""

    method: Literal["friction-model"]
    """Model-based compensation."""
    friction: dict[str, FrictionField] = Field(min_length=1, max_length=8)
    """The identified friction, by interface; each adds its torque to the command."""
    gain: float = Field(default=1.0, ge=0, le=10)
    """Share of the modelled friction that is compensated."""

    @field_validator("friction")
    @classmethod
    def _can_compensate(cls, friction: dict[str, Any]) -> dict[str, Any]:
        for name, options in friction.items():
            if why := model_of(options).no_compensation:
                raise ValueError(f"{name}: '{options.model}' cannot compensate: {why}")
        return friction


def _build(options: FrictionModelOptions, inertia: float, ratio: float) -> Compensator:
    return Compensator(
        friction=tuple((friction, options.gain) for friction in options.friction.values())
    )


COMPENSATION = CompensationMethod(
    name="friction-model",
    summary="feedforward of modelled friction from the measured relative rate (section 5.2)",
    options=FrictionModelOptions,
    build=_build,
)
