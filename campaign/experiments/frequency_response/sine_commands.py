"""Sine commands of rate or torque within a bench's limits."""

from __future__ import annotations

import math

from campaign.experiments.shared.rig import Rig
from campaign.physics.bench import Bench
from campaign.physics.complete import inertia_of, limits_of
from campaign.physics.limits import worst_friction
from campaign.signals import Sine
from campaign.units import angle_text, rate_text

LIMIT_SHARE = 0.9
"""of the bench's limits that the amplitude of a rate command may use."""


def amplitude_text(command: Sine, closed: bool) -> str:
    """Of a rate command in a closed loop, or a torque in an open one; for people."""
    if closed:
        return f"amplitude {rate_text(command.amplitude)}"
    return f"amplitude {command.amplitude:.3g} N·m"


def rate_sine(
    bench: Bench, frequency: float, largest: float, acceleration: float | None
) -> tuple[Sine, float]:
    """The rate command and half the angle it swings (rad); it starts at rest.

    Of amplitude `largest` (rad/s), or less where `acceleration` (rad/s^2) asks for it; None: as the
    bench's limits do. Raises ValueError where these do not overcome its friction.
    """
    rig, omega = Rig(bench), 2.0 * math.pi * frequency
    if acceleration is None:
        torque = rig.torque - worst_friction(bench, largest)
        if torque <= 0:
            raise ValueError("the bench's torque and current limits do not overcome its friction")
        acceleration = LIMIT_SHARE * min(rig.limits.acceleration, rig.accelerated_by(torque))
    amplitude = min(largest, acceleration / omega)
    return Sine(amplitude=amplitude, frequency=frequency), amplitude / omega


def torque_sine(
    bench: Bench, frequency: float, torque: float, position: float
) -> tuple[Sine, float]:
    """The torque and half the angle (rad) that it would swing a load without friction.

    Around `position` (rad), of amplitude `torque` (N m). It starts at its peak: the rate of a free
    load then has no offset, and the angle no drift. Raises ValueError beyond the bench's limits.
    """
    omega = 2.0 * math.pi * frequency
    limits = limits_of(bench)
    rate = torque / (inertia_of(bench, "the swing of a free load") * omega)
    swing = rate / omega
    if abs(position) + swing > limits.angle or rate > limits.rate:
        raise ValueError(
            f"{torque:g} N·m at {frequency:g} Hz would swing a load without friction by "
            f"{angle_text(swing)} at {rate_text(rate)}, beyond the bench's "
            "limits; lower torque or raise lowest"
        )
    return Sine(amplitude=torque, frequency=frequency, phase=0.5 * math.pi), swing
