"""Torque of a drive between samples of a sampled controller.

A current loop responds to each new command at once, and then flattens until the next one. The
current is sampled when a new command comes. A smooth curve through the samples therefore lags
behind the current, by a tenth of the controller's period and more. If the whole current were
commanded, that would be one delay, which a fit estimates. But back-EMF drives a smooth part of it;
so the delay looks like damping and inertia. Samples of a line contain the line and its images
around multiples of the sampling rate (Oppenheim and Schafer, "Discrete-Time Signal Processing",
section 4.2). The images follow from the command and the current loop, and are removed.
"""

from __future__ import annotations

import numpy as np

from campaign.physics.bench import Bench, CurrentController
from campaign.result import Array
from campaign.signals import MultiSine

IMAGES = 1000
"""Images to either side: they fall with the square of their number."""
UNKNOWN = 0.3
"""Relative uncertainty of the images: gains and inductances are seldom known better."""
LATE = 0.2
"""Share of a controller's period that the current may lag if its loop is unknown."""
ALIKE = 1e-6
"""Share of a turn by which an image may miss a line and still lie on it."""


def between_samples(time: Array, command: MultiSine, bench: Bench) -> tuple[Array, Array]:
    """Torque to add to a torque measured at `time` (s), and its uncertainty, shape (n,).

    command: torque (N m) that the controller holds. Both are 0 for a bench without a period. `time`
    is evenly spaced. A recording faster than the controller shows the current between commands.
    """
    controller = bench.controller
    if controller is None or controller.sample_rate is None:
        return np.zeros(len(time)), np.zeros(len(time))
    rate, motor, gains = controller.sample_rate, bench.motor, controller.current
    if motor is None or gains is None or motor.resistance is None or motor.inductance is None:
        lag = LATE / rate if _step(time) * rate > 0.99 else 0.0
        return np.zeros(len(time)), lag * command.integral(time, -1)
    # A sensor's delay is a whole number of the controller's samples.
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
