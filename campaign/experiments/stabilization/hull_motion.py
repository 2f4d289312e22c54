"""Hull motion of a stabilization test: sine, measured series, or ship motion."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from campaign.axis_kind import is_linear
from campaign.experiments.shared.motion_series import KINDS, SeriesFile, kind_of, motion_signal
from campaign.options import Options
from campaign.physics.ship_motion import ShipRoll, roll_acceleration
from campaign.signals import Array, MultiSine, Polyline
from campaign.units import Frequency, Length, Quantity, Time


class SineMotion(Options):
    """A sinusoidal acceleration, of the test's `frequency` and `acceleration`."""

    kind: Literal["sine"] = "sine"
    """A sinusoidal acceleration."""


class SeriesMotion(SeriesFile):
    """A measured time series, from a CSV file with a header line."""

    kind: Literal["series"]
    """A measured time series."""
    value: str
    """Unit of the value column: of an angle, a rate or an acceleration."""
    lead_in: Time = Field(default=1.0, gt=0)
    """Time before the series, to bring the hull from rest to its initial rate."""
    settle: Time = Field(default=2.0, ge=0)
    """Unmeasured start of the series, for the transient to decay."""

    @property
    def quantity(self) -> Quantity:
        return KINDS[kind_of(self.value)]

    def check(self, time: Array, value: Array) -> None:
        if self.settle >= time[-1]:
            raise ValueError(f"the series lasts {time[-1]:.4g} s, no longer than settle")

    def signal(self) -> tuple[Polyline, float, float]:
        """Acceleration of the hull (rad/s^2), start and stop of the measurement (s)."""
        time, value = self.samples()
        signal = motion_signal(time, value, kind_of(self.value), self.lead_in)
        return signal, self.lead_in + self.settle, self.lead_in + float(time[-1])


class ShipMotion(Options):
    """Roll of a ship in irregular beam seas; `campaign.physics.ship_motion` has the equations."""

    kind: Literal["ship"]
    """Roll of a ship in a seaway."""
    significant_height: Length = Field(default=2.5, gt=0, le=30)
    """Hs of Bretschneider's wave spectrum."""
    peak_period: Time = Field(default=8.8, gt=0.5, le=30)
    """Period of the waves with the most energy."""
    natural_period: Time = Field(default=8.0, gt=0.5, le=60)
    """Natural period of the roll."""
    damping_ratio: float = Field(default=0.1, gt=0, le=2)
    """Damping ratio of the roll."""
    slope_coefficient: float = Field(default=0.75, gt=0, le=1)
    """Effective wave slope over the slope at the surface."""
    cutoff: Frequency = Field(default=0.35, gt=0, le=5)
    """Waves above it do not roll the ship; 0.35 Hz is a wave of 13 m, about a frigate's beam."""
    components: int = Field(default=60, ge=10, le=500)
    """Number of sines that form the spectrum."""
    seed: int = Field(default=1, ge=0, lt=2**63)
    """Seed of the sea. Methods are comparable only in the same sea; sweep it for several."""
    settle: Time = Field(default=20.0, ge=0)
    """Unmeasured time at the start."""
    duration: Time = Field(default=300.0, gt=0)
    """Measured time."""

    @model_validator(mode="after")
    def _of_an_axis_that_turns(self) -> ShipMotion:
        if is_linear():
            raise ValueError("a ship rolls about an axis, and the axis of this bench is linear")
        return self

    def signal(self) -> tuple[MultiSine, float, float]:
        """Acceleration of the hull (rad/s^2), start and stop of the measurement (s)."""
        ship = ShipRoll(
            self.significant_height,
            self.peak_period,
            self.natural_period,
            self.damping_ratio,
            self.slope_coefficient,
            self.cutoff,
        )
        signal = roll_acceleration(ship, self.components, self.seed)
        return signal, self.settle, self.settle + self.duration


Motion = Annotated[SineMotion | SeriesMotion | ShipMotion, Field(discriminator="kind")]
