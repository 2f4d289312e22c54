"""The sensors of a bench."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import Field, model_validator

from campaign.options import Options
from campaign.physics.friction_paths import invalid
from campaign.units import Angle, AngularRate, Current, MotorAngle, Time


class RateSensor(Options):
    """A sensor of rate, read by the sampled controller."""

    noise: AngularRate = Field(default=0.0, ge=0)
    """Standard deviation of white noise per sample."""
    resolution: AngularRate = Field(default=0.0, ge=0)
    """One count; 0 for no quantization."""
    delay: Time = Field(default=0.0, ge=0, le=1.0)
    """Age of a reading, rounded to whole controller samples."""


_PER_REVOLUTION = {"counts": 1.0, "lines": 4.0}
"""Counts per unit of a data sheet; a line has four edges."""


class _Divided(Options):
    """A sensor whose resolution may be given as divisions of a revolution."""

    @model_validator(mode="before")
    @classmethod
    def _of_a_revolution(cls, tree: Any) -> Any:
        given = [name for name in _PER_REVOLUTION if isinstance(tree, Mapping) and name in tree]
        if not given:
            return tree
        if len(given) > 1 or "resolution" in tree:
            raise ValueError("'resolution', 'lines' and 'counts' say the same; keep one")
        (name,) = given
        number = tree[name]
        if isinstance(number, bool) or not isinstance(number, int | float) or not number >= 1:
            raise invalid([((name,), "a number of 1 or more, without a unit")])
        rest = {key: value for key, value in tree.items() if key != name}
        return {**rest, "resolution": f"{360.0 / (number * _PER_REVOLUTION[name])!r} deg"}


class AngleSensor(_Divided):
    """A sensor of angle relative to the hull, read by the sampled controller."""

    noise: Angle = Field(default=0.0, ge=0)
    """Standard deviation of white noise per sample."""
    resolution: Angle = Field(default=0.0, ge=0)
    """One count; 0 for no quantization. Instead, for a rotary encoder: `lines` or `counts` per
    revolution, such as `lines = 1024` with four counts each."""
    delay: Time = Field(default=0.0, ge=0, le=1.0)
    """Age of a reading, rounded to whole controller samples."""


class MotorAngleSensor(_Divided):
    """A sensor of the motor's angle relative to the hull, read by the sampled controller."""

    noise: MotorAngle = Field(default=0.0, ge=0)
    """Standard deviation of white noise per sample."""
    resolution: MotorAngle = Field(default=0.0, ge=0)
    """One count; 0 for no quantization. Instead: `lines` or `counts` per motor revolution."""
    delay: Time = Field(default=0.0, ge=0, le=1.0)
    """Age of a reading, rounded to whole controller samples."""


class CurrentSensor(Options):
    """The sensor of motor current, read by the sampled controller."""

    noise: Current = Field(default=0.0, ge=0)
    """Standard deviation of white noise per sample."""
    resolution: Current = Field(default=0.0, ge=0)
    """One count; 0 for no quantization."""
    delay: Time = Field(default=0.0, ge=0, le=1.0)
    """Age of a reading, rounded to whole controller samples."""


class SensorsOptions(Options):
    """Sensors of the controller. A continuous controller has ideal sensors."""

    gyro: RateSensor = RateSensor()
    """Inertial rate of the load."""
    encoder: AngleSensor = AngleSensor()
    """Angle of the load relative to the hull."""
    resolver: MotorAngleSensor = MotorAngleSensor()
    """Angle of the motor shaft relative to the hull (motor side: N times the load's)."""
    current: CurrentSensor = CurrentSensor()
    """Motor current."""

    @property
    def in_order(self) -> tuple[RateSensor, AngleSensor, MotorAngleSensor, CurrentSensor]:
        """All sensors in the order of `rows.SENSORS`."""
        return self.gyro, self.encoder, self.resolver, self.current
