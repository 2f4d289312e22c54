"""Commands over time as data: rate, torque ramp, base motion.

A signal is a frozen description for all rooms: a protocol states it, a plan checks its extremes,
the simulator samples it and a controller receives its parameters. The field that contains the
signal defines the unit of its value (rad/s, N m ...); the fields here are plain SI numbers.
"""

from __future__ import annotations

from functools import cached_property, partial
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field

from campaign.arrays import Array as Array
from campaign.options import Options


class Zero(Options):
    """No command."""

    shape: Literal["zero"] = "zero"

    def sample(self, time: Array) -> Array:
        """Values at `time` (s), shape (n,)."""
        return np.zeros_like(time)


class Sine(Options):
    """amplitude * sin(2 pi frequency t + phase)."""

    shape: Literal["sine"] = "sine"
    amplitude: float
    frequency: float = Field(gt=0)
    phase: float = 0.0

    def sample(self, time: Array) -> Array:
        """Values at `time` (s), shape (n,)."""
        return self.amplitude * np.sin(2 * np.pi * self.frequency * time + self.phase)


class Polyline(Options):
    """Straight lines between points; the first and the last value apply outside them.

    A trapezoidal rate profile, a torque ramp and a measured series are all polylines.
    """

    shape: Literal["polyline"] = "polyline"
    times: tuple[float, ...] = Field(min_length=1)
    values: tuple[float, ...] = Field(min_length=1)

    def model_post_init(self, context: object) -> None:
        if len(self.times) != len(self.values):
            raise ValueError("a polyline needs as many values as times")
        if any(b < a for a, b in zip(self.times, self.times[1:], strict=False)):
            raise ValueError("the times of a polyline never decrease")

    def sample(self, time: Array) -> Array:
        """Values at `time` (s), shape (n,)."""
        return self._interpolated(time)

    @cached_property
    def _interpolated(self) -> partial[Array]:
        """Interpolator, created once: a simulation samples a long series thousands of times.

        A function, since polylines are compared by their fields and array comparison is ambiguous.
        """
        return partial(np.interp, xp=np.asarray(self.times), fp=np.asarray(self.values))

    def __copy__(self) -> Self:
        """Copy without the interpolator: `model_copy` may change the fields."""
        copied = super().__copy__()
        copied.__dict__.pop("_interpolated", None)
        return copied


class MultiSine(Options):
    """Sum of amplitude * sin(2 pi frequency t + phase): a completely defined irregular motion.

    Ship motion is one, with one component for each part of its spectrum.
    """

    shape: Literal["multisine"] = "multisine"
    amplitudes: tuple[float, ...] = Field(min_length=1, max_length=1000)
    frequencies: tuple[Annotated[float, Field(gt=0)], ...]
    phases: tuple[float, ...]

    def model_post_init(self, context: object) -> None:
        if not len(self.amplitudes) == len(self.frequencies) == len(self.phases):
            raise ValueError("a multisine needs as many frequencies and phases as amplitudes")

    def sample(self, time: Array) -> Array:
        """Values at `time` (s), shape (n,)."""
        return self.integral(time, 0)

    def integral(self, time: Array, order: int) -> Array:
        """The `order`-th integral of zero mean at `time` (s), shape (n,); -1 is the derivative."""
        total = np.zeros_like(time, dtype=float)
        parts = zip(self.amplitudes, self.frequencies, self.phases, strict=True)
        for amplitude, frequency, phase in parts:
            omega = 2 * np.pi * frequency
            turned = omega * time + (phase - order * np.pi / 2)
            total += amplitude * omega**-order * np.sin(turned)
        return total


Signal = Annotated[Zero | Sine | Polyline | MultiSine, Field(discriminator="shape")]
