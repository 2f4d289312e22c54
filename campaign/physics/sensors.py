"""The sensors of a bench, as its file describes them."""

from __future__ import annotations

from pydantic import Field

from campaign.options import Options
from campaign.units import Angle, AngularRate, Current, MotorAngle, Time


class RateSensor(Options):
    """A sensor of angular rate, read by the sampled controller."""

    noise: AngularRate = Field(default=0.0, ge=0)
    """Standard deviation of white noise per sample."""
    resolution: AngularRate = Field(default=0.0, ge=0)
    """One count; 0 for no quantisation."""
    delay: Time = Field(default=0.0, ge=0, le=1.0)
    """Age of a reading, rounded to whole controller samples."""


class AngleSensor(Options):
    """A sensor of angle relative to the hull, read by the sampled controller."""

    noise: Angle = Field(default=0.0, ge=0)
    """Standard deviation of white noise per sample."""
    resolution: Angle = Field(default=0.0, ge=0)
    """One count; 0 for no quantisation."""
    delay: Time = Field(default=0.0, ge=0, le=1.0)
    """Age of a reading, rounded to whole controller samples."""


class MotorAngleSensor(Options):
    """A sensor of the motor's angle relative to the hull, read by the sampled controller."""

    noise: MotorAngle = Field(default=0.0, ge=0)
    """Standard deviation of white noise per sample."""
    resolution: MotorAngle = Field(default=0.0, ge=0)
    """One count; 0 for no quantisation."""
    delay: Time = Field(default=0.0, ge=0, le=1.0)
    """Age of a reading, rounded to whole controller samples."""


class CurrentSensor(Options):
    """The sensor of motor current, read by the sampled controller."""

    noise: Current = Field(default=0.0, ge=0)
    """Standard deviation of white noise per sample."""
    resolution: Current = Field(default=0.0, ge=0)
    """One count; 0 for no quantisation."""
    delay: Time = Field(default=0.0, ge=0, le=1.0)
    """Age of a reading, rounded to whole controller samples."""


class SensorsOptions(Options):
    """What the controller sees. A continuous controller sees everything exactly."""

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
        """In the order of `rows.SENSORS`."""
        return self.gyro, self.encoder, self.resolver, self.current
