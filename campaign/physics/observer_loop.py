"""Effect of a disturbance observer on the linear loop (Equations 5.4, 5.5).

The thesis derives both for a constant rate controller G_cv. A bench has a PI controller, and its
observer can have a separate inertia J'. Without delay and with an ideal current loop, with
G(s) = N Kt (Kp + Ki / s) and a = N K0 / J', in terms of the readings y = w + n:

    motor torque     Tm = -G y - T'          T' = a / (s + a) (J' s y - Tm)         (Eq. 5.1)
    hence            Tm = -C y               C  = G + a J' + a G / s
    rejection        w / Td = 1 / (J s + C)                                         (Eq. 5.4)
    noise coupling   w / n  = -C / (J s + C)                                        (Eq. 5.5)

For J' = J the first is s / ((J s + G)(s + a)), which is Eq. 5.4 with G for G_cv, and the second is
Eq. 5.5. Neither includes a delay, so neither predicts instability; see `stability`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from campaign.arrays import ComplexArray
from campaign.physics.complete import CompleteBench
from campaign.signals import Array

TWO_PI = 2.0 * np.pi


def corner_frequency(bench: CompleteBench, gain: float, inertia: float | None = None) -> float:
    """N K0 / (2 pi J') in Hz, of the gain K0 (N m s/rad at the motor)."""
    return bench.gear.ratio * gain / (TWO_PI * (inertia or bench.axis.inertia))


def gain_for(bench: CompleteBench, corner: float, inertia: float | None = None) -> float:
    """Gain K0 (N m s/rad at the motor) for this corner frequency (Hz)."""
    return TWO_PI * corner * (inertia or bench.axis.inertia) / bench.gear.ratio


def rejection(
    bench: CompleteBench, corner: float, inertia: float | None, frequency: Array
) -> ComplexArray:
    """Rejection w / Td (rad/s per N m) at `frequency` (Hz), shape (n,); corner 0: no observer."""
    s = 2j * np.pi * frequency
    return np.asarray(1.0 / (bench.axis.inertia * s + _controller(bench, corner, inertia, s)))


def noise_coupling(
    bench: CompleteBench, corner: float, inertia: float | None, frequency: Array
) -> ComplexArray:
    """Noise coupling w / n at `frequency` (Hz), shape (n,)."""
    s = 2j * np.pi * frequency
    controller = _controller(bench, corner, inertia, s)
    return np.asarray(-controller * rejection(bench, corner, inertia, frequency))


def noise_rate(bench: CompleteBench, corner: float, inertia: float | None) -> float:
    """Standard deviation (rad/s) of the load's rate that the gyro's noise causes.

    Integral of |w/n|^2 over the spectrum of noise that is white per sample and held in between,
    2 sigma^2 T (sin(pi f T) / (pi f T))^2 per hertz. Rounding to a count q adds q^2 / 12.
    0 for a continuous controller, which has ideal sensors.
    """
    rate = bench.controller.sample_rate
    if rate is None:
        return 0.0
    gyro = bench.sensors.gyro
    variance = gyro.noise**2 + gyro.resolution**2 / 12.0
    frequency = np.geomspace(1e-5 * rate, 10.0 * rate, 40_001)
    spectrum = 2.0 * variance / rate * np.sinc(frequency / rate) ** 2
    power = np.abs(noise_coupling(bench, corner, inertia, frequency)) ** 2 * spectrum
    return float(np.sqrt(np.trapezoid(power, frequency)))


def _controller(bench: CompleteBench, corner: float, inertia: float | None, s: Any) -> Any:
    """C(s), N m at the load per rad/s of gyro rate."""
    rate = bench.controller.rate
    g = bench.torque_per_current * (rate.proportional + rate.integral_gain / s)
    a = TWO_PI * corner
    return g + a * (inertia or bench.axis.inertia) + a * g / s
