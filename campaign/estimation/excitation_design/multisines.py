"""Odd multisines with a low crest factor and a smooth start."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from campaign.arrays import Array
from campaign.estimation.frequency.multisine import Lines, OddGrid, course, random_phases
from campaign.signals import MultiSine

POINTS = 16
"""Points per cycle of the highest line."""
CLIPPED = (0.75, 0.98)
"""Clipping level over the peak of the signal, in the first and the last round."""
BISECTIONS = 60
"""Bisections in the search for a zero; they reduce the interval to 1e-18 of its size."""
ROUNDS = 400
"""Rounds of the search for a low crest factor."""


def odd_multisine(grid: OddGrid, seed: int, draws: int, *, lowered: bool, order: int) -> MultiSine:
    """One realisation on the lines of a grid, with rms 1.

    Args:
        draws: number of sets of random phases; the one with the lowest crest factor is used.
        lowered: whether `low_crest` then reduces the crest factor further.
        order: the signal begins at a zero of its `order`-th integral of zero mean. 0: a rate
            begins at rest; 1: a free load under a torque does not drift.
    """
    signal = random_phases(grid, 1.0, seed, draws=draws)
    phases = np.array(signal.phases)
    if lowered:
        phases = low_crest(grid.excited, phases)
    phases = _shifted(grid.excited, phases, order)
    frequencies = tuple(float(f"{f:.12g}") for f in grid.frequency)
    return MultiSine(
        amplitudes=signal.amplitudes, frequencies=frequencies, phases=tuple(map(float, phases))
    )


def low_crest(lines: Lines, phases: Array) -> Array:
    """Phases (rad) of sines of equal size with a lower crest factor, from start values (k,).

    Each round clips the signal and keeps only its phases (Van der Ouderaa, Schoukens and
    Renneboog, IEEE Trans. Instrum. Meas. 37 (1988) 145). Returns the phases of the best round.
    lines: multiples of the base frequency, shape (k,).
    """
    count = POINTS * int(lines[-1])
    best, lowest = phases, np.inf
    for share in np.linspace(*CLIPPED, ROUNDS):
        signal = course(lines, phases, count)
        peak = float(np.max(np.abs(signal)))
        if peak < lowest:
            best, lowest = phases, peak
        level = share * peak
        spectrum = np.fft.rfft(np.clip(signal, -level, level))
        phases = np.angle(spectrum[lines]) + 0.5 * np.pi
    return np.asarray(best % (2.0 * np.pi))


def peak(signal: MultiSine, period: float) -> float:
    """Largest magnitude of a multisine with a period (s), at 64 points of the fastest cycle."""
    count = 4 * POINTS * round(max(signal.frequencies) * period)
    lines = np.round(np.array(signal.frequencies) * period).astype(int)
    phases = np.array(signal.phases)
    return float(np.max(np.abs(course(lines, phases, count, np.array(signal.amplitudes)))))


def crest_factor(signal: MultiSine, period: float) -> float:
    """Largest magnitude over rms."""
    rms = np.sqrt(0.5 * np.sum(np.square(signal.amplitudes)))
    return peak(signal, period) / float(rms)


def _shifted(lines: Lines, phases: Array, order: int) -> Array:
    """Phases after a time shift to the first zero of the signal's `order`-th integral."""
    count = POINTS * int(lines[-1])
    signal = course(lines, phases, count, 1.0, order)
    size = 1.0 / lines.astype(float) ** order

    def value(share: float) -> float:
        turned = 2.0 * np.pi * lines * share + phases - 0.5 * np.pi * order
        return float(np.sum(size * np.sin(turned)))

    return np.asarray((phases + 2.0 * np.pi * first_passage(signal, value) * lines) % (2.0 * np.pi))


def first_passage(course: Array, value: Callable[[float], float]) -> float:
    """First zero of a periodic signal, as a share of its period, to the last digit.

    course: one period, evenly sampled; the first pair of samples of opposite sign must enclose a
        single zero. value: signal at a share of its period.
    """
    index = int(np.flatnonzero(course * np.roll(course, -1) <= 0.0)[0])
    low, high = index / len(course), (index + 1) / len(course)
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        if value(low) * value(middle) <= 0.0:
            high = middle
        else:
            low = middle
    return 0.5 * (low + high)
