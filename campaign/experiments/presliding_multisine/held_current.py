"""Torque of a drive between samples of a sampled controller.

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

from campaign.physics.bench import Bench, CurrentController
from campaign.result import Array
from campaign.signals import MultiSine

IMAGES = 1000
"""to either side: they fall with the square of their number."""
UNKNOWN = 0.3
"""Share by which that may be off: gains and inductances are seldom known better."""
LATE = 0.2
"""Share of a controller's period that the current may lag behind where nobody tells its loop."""
ALIKE = 1e-6
"""Share of a turn by which an image may miss a line and still lie on it."""


def between_samples(time: Array, command: MultiSine, bench: Bench) -> tuple[Array, Array]:
    """What to add to a torque measured at `time` (s), and what that may be off by, shape (n,).

    command: torque (N m) that the controller holds. Both are 0 of a bench without a period. `time`
    is even; a recording faster than the controller shows itself what is between its commands.
    """
    controller = bench.controller
    if controller is None or controller.sample_rate is None:
        return np.zeros(len(time)), np.zeros(len(time))
    rate, motor, gains = controller.sample_rate, bench.motor, controller.current
    if motor is None or gains is None or motor.resistance is None or motor.inductance is None:
        lag = LATE / rate if _step(time) * rate > 0.99 else 0.0
        return np.zeros(len(time)), lag * command.integral(time, -1)
    # A sensor is late by whole samples of its controller.
    late = controller.delay + round(bench.sensors.current.delay * rate) / rate
    impedance = motor.inductance, motor.resistance
    missing = -_images(time, command, gains, impedance, rate, late)
    return missing, UNKNOWN * missing


def _images(
    time: Array,
    command: MultiSine,
    gains: CurrentController,
    impedance: tuple[float, float],
    rate: float,
    late: float,
) -> Array:
    frequency = np.asarray(command.frequencies)
    numbers = np.arange(-IMAGES, IMAGES + 1)
    turns = numbers * rate * _step(time)
    onto = (numbers != 0) & (np.abs(turns - np.rint(turns)) < ALIKE)
    s = 2j * np.pi * np.add.outer(frequency, numbers[onto] * rate)
    held = -np.expm1(-s / rate) * rate / s
    forward = gains.proportional * s + gains.integral_gain
    inductance, resistance = impedance
    follows = forward / (inductance * s**2 + resistance * s + forward)
    images = np.sum(held * follows * np.exp(-s * late), axis=1)
    at = 2.0 * np.pi * np.multiply.outer(time, frequency) + np.asarray(command.phases)
    shown = np.asarray(command.amplitudes) * images
    return np.asarray(np.sin(at) @ shown.real + np.cos(at) @ shown.imag)


def _step(time: Array) -> float:
    return float(time[-1] - time[0]) / (len(time) - 1)
