"""Amplitude of a signal at one frequency, with an interval from the scatter of its cycles."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from campaign.arrays import Array
from campaign.estimate import Estimate
from campaign.estimation.intervals import with_error
from campaign.reason import Cause

LEAST_SAMPLES = 4
"""Fewest samples in a cycle: one more than sine, cosine and mean."""
TOO_FEW_CYCLES = Cause(
    "too few cycles", "its cycles are too few, or too short, to show how they scatter"
)


def amplitude(name: str, time: Array, samples: Array, frequency: float, unit: str) -> Estimate:
    """Amplitude at `frequency` (Hz) by least squares with a mean; t over whole cycles.

    Each cycle is also fitted separately. The scatter of the parts in phase with the whole
    determines the error. `time` (s) and `samples` have shape (n,), evenly spaced.
    """
    whole = _phasor(time, samples, frequency)
    value = abs(whole)
    step = float(np.ptp(time)) / (len(time) - 1)
    cycles = int((len(time) + 1) * step * frequency)  # one sample short of a whole one allowed
    edges = np.round(np.arange(cycles + 1) / (frequency * step)).astype(int)
    if cycles < 2 or np.min(np.diff(edges)) < LEAST_SAMPLES or not value > 0:
        return Estimate.without_interval(name, value, unit, TOO_FEW_CYCLES())
    direction = np.conj(whole) / value
    parts = [
        (_phasor(time[a:b], samples[a:b], frequency) * direction).real for a, b in pairwise(edges)
    ]
    error = float(np.std(parts, ddof=1)) / np.sqrt(cycles)
    method = f"least squares, Student's t over {cycles} cycles"
    return with_error(name, value, unit, float(error), cycles - 1, method)


def _phasor(time: Array, samples: Array, frequency: float) -> complex:
    turned = 2 * np.pi * frequency * time
    regressors = np.stack([np.cos(turned), np.sin(turned), np.ones_like(turned)], axis=1)
    cosine, sine, _ = np.linalg.lstsq(regressors, samples, rcond=None)[0]
    return complex(cosine, -sine)
