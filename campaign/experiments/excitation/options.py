"""Options of an excitation: signal, size, and columns of a file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from campaign.estimation.excitation_design.sweep import Law
from campaign.experiments.shared.motion_series import SeriesFile, name_of
from campaign.options import Options
from campaign.signals import Polyline
from campaign.units import (
    ANGLE,
    ANGULAR_RATE,
    TORQUE,
    Angle,
    AngularAcceleration,
    AngularRate,
    Frequency,
    Quantity,
    Time,
    Torque,
)

Kind = Literal["multisine", "chirp", "noise", "fourier", "file"]


COMMANDS = {"torque": TORQUE, "rate": ANGULAR_RATE, "angle": ANGLE}


class SignalTable(SeriesFile):
    """A command over time, from a CSV file with a header line."""

    value: str
    """Unit of the value column: of a torque, a rate or an angle; an angle's rate is commanded."""

    @property
    def quantity(self) -> Quantity:
        return COMMANDS[name_of(self.value, COMMANDS, "a command")]

    def signal(self, command: str) -> Polyline:
        """The command. Raises ValueError if its unit is of another mode."""
        quantity = self.quantity
        if (quantity is TORQUE) != (command == "torque"):
            raise ValueError(f"{self.value!r} is no unit of a {command}; write `command`, too")
        time, value = self.samples()
        if quantity is ANGLE:
            from scipy.interpolate import CubicSpline

            value = CubicSpline(time, value)(time, 1)
        return Polyline(times=tuple(time.tolist()), values=tuple(value.tolist()))


class ExcitationOptions(Options):
    """Options of an excitation."""

    signal: Kind = "multisine"
    """multisine: odd, with random phases, for a frequency response; fourier: an optimized series of
    an angle, for inverse dynamics; chirp; noise; file: a table of your own."""
    command: Literal["rate", "torque"] = "rate"
    """rate: the closed rate loop follows it; torque: the loop is open."""
    amplitude: AngularRate = Field(default=float(np.deg2rad(10.0)), gt=0)
    """Largest commanded rate of a multisine, a chirp or noise."""
    torque: Torque = Field(default=60.0, gt=0)
    """Largest commanded torque of a multisine, a chirp or noise."""
    lowest: Frequency = Field(default=0.5, gt=0)
    """Lowest frequency of a multisine, a chirp or noise."""
    highest: Frequency = Field(default=30.0, gt=0)
    """Highest frequency of a multisine, a chirp or noise."""
    period: Time = Field(default=8.0, gt=0)
    """Period of a Fourier series, or of a multisine: its lines are odd multiples of 1/period."""
    periods: int = Field(default=2, ge=1, le=10_000)
    """Measured periods of a multisine or a series; two separate noise from distortion."""
    realisations: int = Field(default=7, ge=1, le=1000)
    """Trials of a multisine or noise, each with its own phases; seven show their scatter."""
    group: int = Field(default=3, ge=2, le=100)
    """One random line of this many odd lines of a multisine is omitted, to show distortion."""
    phases: Literal["lowered", "random"] = "lowered"
    """Phases of a multisine. lowered: optimized to a crest factor of about 1.6; random: the best of
    a few draws, about 2.6, as in theory, with the distribution of noise."""
    draws: int = Field(default=20, ge=1, le=10_000)
    """Number of sets of random phases; the lowest crest factor decides."""
    settle: Time = Field(default=1.0, ge=0)
    """Unmeasured start of a multisine, for the transient to decay."""
    duration: Time = Field(default=60.0, gt=0)
    """Duration of a chirp (in whole cycles) or of noise."""
    sweep: Law = "logarithmic"
    """Growth of a chirp's frequency: by the same factor each second, or linear."""
    harmonics: int = Field(default=5, ge=2, le=50)
    """Harmonics of a Fourier series."""
    terms: tuple[str, ...] = Field(
        default=("inertia", "viscous", "coulomb_positive", "coulomb_negative"), min_length=1
    )
    """Terms of the inverse dynamic model that a Fourier series has to separate; `offset` only with
    one `coulomb`, and `gravity_sine`, `gravity_cosine` for an unbalanced axis."""
    search: int = Field(default=200, ge=0, le=10_000)
    """Generations of the search for the lowest condition number, with 40 series each."""
    max_angle: Angle | None = Field(default=None, gt=0)
    """Largest angle of a Fourier series, from zero; absent: nine tenths of the bench's limit."""
    max_rate: AngularRate | None = Field(default=None, gt=0)
    """Largest rate of a Fourier series; absent: nine tenths of the bench's limit."""
    max_acceleration: AngularAcceleration | None = Field(default=None, gt=0)
    """Largest acceleration of a Fourier series; absent: nine tenths of the bench's limit."""
    max_torque: Torque | None = Field(default=None, gt=0)
    """Largest torque of a Fourier series with its friction; absent: nine tenths of what the bench's
    limits of torque and current allow."""
    table: SignalTable | None = None
    """File of your own command, and its units."""
    seed: int = Field(default=1, ge=0, lt=2**63)
    """Seed of phases, noise, omitted lines and search; the same seed repeats them."""
    position: Angle = 0.0
    """Angle of the load relative to the hull around which it swings."""
    compensation: str = "none"
    """Name of a compensation of the bench, or none."""
    sample_rate: Frequency = Field(default=1000.0, gt=0, le=100_000)
    """Rate of the recording; at least 8 times the highest frequency."""

    @model_validator(mode="after")
    def _goes_together(self) -> ExcitationOptions:
        if self.signal == "file" and self.table is None:
            raise ValueError("signal = 'file' needs a table: table = { file = ..., value = ... }")
        if self.signal == "fourier" and self.command == "torque":
            raise ValueError("a Fourier series is one of an angle: it needs command = 'rate'")
        return self

    def without_effect(self) -> frozenset[str]:
        of_all = {"signal", "command", "position", "compensation", "sample_rate"}
        sized = {"lowest", "highest", "torque" if self.command == "torque" else "amplitude"}
        searched = {"harmonics", "terms", "search", "max_angle", "max_rate", "max_acceleration"}
        own: Mapping[str, set[str]] = {
            "multisine": {*sized, "period", "periods", "realisations", "group", "phases", "draws",
                          "settle", "seed"},
            "chirp": {*sized, "duration", "sweep"},
            "noise": {*sized, "duration", "realisations", "seed"},
            "fourier": {*searched, "max_torque", "period", "periods", "seed"},
            "file": {"table"},
        }  # fmt: skip
        return frozenset(type(self).model_fields) - of_all - own[self.signal]

    @property
    def size(self) -> float:
        """Largest value that is commanded, of the mode's own option (SI)."""
        return self.torque if self.command == "torque" else self.amplitude
