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
    """Unit of the value column: of a torque, a rate or an angle, whose rate is then commanded."""

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
    """multisine: odd, with random phases, for a frequency response; fourier: a series of an angle,
    searched for inverse dynamics; chirp; noise; file: a table of your own."""
    command: Literal["rate", "torque"] = "rate"
    """rate: the rate loop is closed and follows it; torque: the loop is open."""
    amplitude: AngularRate = Field(default=float(np.deg2rad(10.0)), gt=0)
    """Rate: largest value of a multisine, a chirp or noise."""
    torque: Torque = Field(default=60.0, gt=0)
    """Torque: largest value of a multisine, a chirp or noise."""
    lowest: Frequency = Field(default=0.5, gt=0)
    """Lowest frequency of a multisine, a chirp or noise."""
    highest: Frequency = Field(default=30.0, gt=0)
    """Highest frequency of a multisine, a chirp or noise."""
    period: Time = Field(default=8.0, gt=0)
    """Multisine: its lines are odd multiples of 1/period. Fourier: of the series."""
    periods: int = Field(default=2, ge=1, le=10_000)
    """Periods of a multisine or a series that are measured; two tell noise from distortion."""
    realisations: int = Field(default=7, ge=1, le=1000)
    """Trials of a multisine or noise, each with phases of its own; seven show how they scatter."""
    group: int = Field(default=3, ge=2, le=100)
    """Of so many odd lines of a multisine one, drawn at random, is left out, to show distortion."""
    phases: Literal["lowered", "random"] = "lowered"
    """Multisine: lowered: random ones are changed until the crest factor is about 1.6; random: the
    best of a few draws, about 2.6, as theory has them and noise is distributed."""
    draws: int = Field(default=20, ge=1, le=10_000)
    """Sets of random phases, of which the one with the lowest crest factor counts."""
    settle: Time = Field(default=1.0, ge=0)
    """Of a multisine, before what is measured, for the transient to pass."""
    duration: Time = Field(default=60.0, gt=0)
    """Of a chirp, to whole cycles, or of noise."""
    sweep: Law = "logarithmic"
    """How the frequency of a chirp grows: by the same factor each second, or linear."""
    harmonics: int = Field(default=5, ge=2, le=50)
    """of a Fourier series."""
    terms: tuple[str, ...] = Field(
        default=("inertia", "viscous", "coulomb_positive", "coulomb_negative"), min_length=1
    )
    """Terms of the inverse dynamic model that a Fourier series is to tell apart; `offset` only with
    one `coulomb`, and `gravity_sine`, `gravity_cosine` for an axis out of balance."""
    search: int = Field(default=200, ge=0, le=10_000)
    """Generations of the search for the lowest condition number, of 40 series each."""
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
    """The file of a command of your own, and its units."""
    seed: int = Field(default=1, ge=0, lt=2**63)
    """Of phases, noise, lines left out, and the search: with the same one they are the same."""
    position: Angle = 0.0
    """Angle of the load relative to the hull around which it swings."""
    compensation: str = "none"
    """Compensation method, by its name on the bench; none for none."""
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
