"""Response to one sine: fundamental of output over input by least squares, with its error."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from campaign.arrays import Array
from campaign.estimation.intervals import student

HARMONICS = 9
"""Highest fitted harmonic, as far as the sampling resolves it: friction causes odd ones."""


@dataclass(frozen=True)
class SinePoint:
    """Response to one sine.

    Attributes:
        frequency: of the excitation (Hz).
        response: output over input at that frequency, complex.
        error: standard deviation of the real and of the imaginary part of `response`, from the
            residuals of both signals without offset, drift, fundamental and harmonics.
        coherence: share of the excitation frequency in the output's power, without drift; 1 for a
            linear system without noise.
    """

    frequency: float
    response: complex
    error: float
    coherence: float


def sine_point(time: Array, input_: Array, output: Array, frequency: float) -> SinePoint:
    """Response at `frequency` (Hz) of signals sampled at `time` (s), all of shape (n,).

    The residuals count as white noise. If they are more than noise (a mode that still rings,
    harmonics above the ninth), the error is too large rather than too small: on the bench
    `platform` it is right above 80 Hz, and up to ten times the scatter of repeated trials near the
    mode at 11 Hz. Below 6 Hz, where friction differs from trial to trial, the scatter from cycle to
    cycle would be five times too small.

    Raises ValueError for too few samples, or no input at that frequency.
    """
    if len(time) < 8 or np.ptp(time) * frequency < 0.9:
        raise ValueError(f"less than one cycle of {frequency:.4g} Hz was recorded")
    rate = (len(time) - 1) / float(np.ptp(time))
    if frequency >= 0.5 * rate:
        raise ValueError(f"{frequency:.4g} Hz cannot be seen in samples at {rate:.4g} Hz")
    orders = [k for k in range(1, HARMONICS + 1) if k == 1 or k * frequency < 0.45 * rate]
    orders = orders[: max(1, (len(time) - 2) // 4)]
    angle = 2.0 * np.pi * frequency * (time - time[0])
    waves = [wave(k * angle) for k in orders for wave in (np.cos, np.sin)]
    basis = np.column_stack([np.ones_like(angle), angle / angle[-1] - 0.5, *waves])
    signals = np.column_stack([input_, output])
    fit, *_ = np.linalg.lstsq(basis, signals, rcond=None)
    amplitude = fit[2] - 1j * fit[3]
    if not abs(amplitude[0]) > 0:
        raise ValueError(f"the input has no part at {frequency:.4g} Hz")
    freedom = max(len(time) - basis.shape[1], 1)
    noise = np.sum((signals - basis @ fit) ** 2, axis=0) / freedom
    response = complex(amplitude[1] / amplitude[0])
    variance = (noise[1] + abs(response) ** 2 * noise[0]) * 2.0 / len(time)
    moving = output - basis[:, :2] @ fit[:2, 1]
    power = float(np.mean(moving**2))
    share = 0.5 * abs(amplitude[1]) ** 2 / power if power > 0 else 0.0
    error = float(np.sqrt(variance) / abs(amplitude[0]))
    return SinePoint(frequency, response, error, min(float(share), 1.0))


def mean_point(points: Sequence[SinePoint]) -> SinePoint:
    """Mean of repetitions at one frequency.

    The error of three or more is from their scatter, unless their own errors are larger. The
    scatter is widened by Student's t over the normal quantile, because intervals use the latter:
    three complex numbers have four degrees of freedom and a factor of 1.4.
    """
    values = np.array([point.response for point in points])
    error = float(np.sqrt(np.sum([point.error**2 for point in points]))) / len(points)
    if len(points) > 2:
        few = student(2 * (len(points) - 1)) / student(math.inf)
        error = max(error, few * float(np.sqrt(np.var(values, ddof=1) / 2.0 / len(points))))
    coherence = float(np.mean([point.coherence for point in points]))
    return SinePoint(points[0].frequency, complex(np.mean(values)), error, coherence)
