"""What a drive's torque is between its samples, where a sampled controller holds its command.

A current loop answers to each new command at once, and then flattens until the next one. Samples
of the current are taken when a new command comes, so that a smooth curve through them lags behind
the current: by a tenth of the controller's period and more. Were the whole current commanded, that
would be one delay, which a fit finds. Back-EMF drives a part of it that is smooth; so the delay
looks like damping and inertia. What is sampled of a line is the line and its images around
multiples of the sampling rate (Oppenheim and Schafer, "Discrete-Time Signal Processing", section
4.2); these follow from the command and from the current loop, and are taken off.
"""

from __future__ import annotations

import numpy as np

from campaign.physics.bench import Bench, CurrentController, MotorOptions
from campaign.result import Array
from campaign.signals import MultiSine

IMAGES = 1000
"""to either side: they fall with the square of their number."""
UNKNOWN = 0.3
"""Share by which that may be off: gains and inductances are seldom known better."""
LATE = 0.2
"""Share of a controller's period that the current may lag behind where nobody tells its loop."""


def between_samples(time: Array, command: MultiSine, bench: Bench) -> tuple[Array, Array]:
    """What to add to a torque measured at `time` (s), and what that may be off by, shape (n,).

    command: torque (N m) that the controller holds. Both are 0 of a bench without a period.
    """
    controller = bench.controller
    if controller is None or controller.sample_rate is None:
        return np.zeros(len(time)), np.zeros(len(time))
    if bench.motor is None or controller.current is None:
        return np.zeros(len(time)), LATE / controller.sample_rate * command.integral(time, -1)
    late = controller.delay + bench.sensors.current.delay
    missing = -_images(time, command, controller.current, bench.motor, controller.sample_rate, late)
    return missing, UNKNOWN * missing


def _images(
    time: Array,
    command: MultiSine,
    gains: CurrentController,
    motor: MotorOptions,
    rate: float,
    late: float,
) -> Array:
    frequency = np.asarray(command.frequencies)
    numbers = np.arange(-IMAGES, IMAGES + 1)
    s = 2j * np.pi * np.add.outer(frequency, numbers[numbers != 0] * rate)
    held = -np.expm1(-s / rate) * rate / s
    forward = gains.proportional * s + gains.integral_gain
    follows = forward / (motor.inductance * s**2 + motor.resistance * s + forward)
    images = np.sum(held * follows * np.exp(-s * late), axis=1)
    turns = 2.0 * np.pi * np.multiply.outer(time, frequency) + np.asarray(command.phases)
    shown = np.asarray(command.amplitudes) * images
    return np.asarray(np.sin(turns) @ shown.real + np.cos(turns) @ shown.imag)
