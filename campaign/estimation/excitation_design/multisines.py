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
"""of its peak at which a signal is clipped, in the first round and in the last."""
BISECTIONS = 60
"""of a search for a passage, after which the interval is 1e-18 of the first one."""
ROUNDS = 400
"""of the search."""


def odd_multisine(grid: OddGrid, seed: int, draws: int, *, lowered: bool, order: int) -> MultiSine:
    """One realisation on the lines of a grid, of rms 1.

    Args:
        draws: how many sets of random phases, of which the one with the lowest crest factor counts.
        lowered: whether phases are then changed to lower it further (`low_crest`).
        order: it begins where its `order`-th integral of zero mean passes zero: 0 for a rate, which
            then begins at rest, 1 for a torque, after which a free load does not drift.
    """
    signal = random_phases(grid, 1.0, seed, draws=draws)
    phases = np.array(signal.phases)
    if lowered:
        phases = low_crest(grid.excited, phases)
    begun = _begun(grid.excited, phases, order)
    frequencies = tuple(float(f"{f:.12g}") for f in grid.frequency)
    return MultiSine(
        amplitudes=signal.amplitudes, frequencies=frequencies, phases=tuple(map(float, begun))
    )


def low_crest(lines: Lines, phases: Array) -> Array:
    """Phases (rad) of sines of equal size with a lower crest factor than those that it begins with.

    A signal is clipped, and its phases are kept (Van der Ouderaa, Schoukens and Renneboog, IEEE
    Trans. Instrum. Meas. 37 (1988) 145); the best of all rounds counts. lines: multiples of the
    base frequency, shape (k,), as phases.
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
    """Largest magnitude of a multisine of that period (s), on 64 points of its fastest cycle."""
    count = 4 * POINTS * round(max(signal.frequencies) * period)
    lines = np.round(np.array(signal.frequencies) * period).astype(int)
    phases = np.array(signal.phases)
    return float(np.max(np.abs(course(lines, phases, count, np.array(signal.amplitudes)))))


def crest_factor(signal: MultiSine, period: float) -> float:
    """Largest magnitude over rms."""
    rms = np.sqrt(0.5 * np.sum(np.square(signal.amplitudes)))
    return peak(signal, period) / float(rms)


def _begun(lines: Lines, phases: Array, order: int) -> Array:
    """The same signal from where its `order`-th integral first passes zero."""
    count = POINTS * int(lines[-1])
    signal = course(lines, phases, count, 1.0, order)
    size = 1.0 / lines.astype(float) ** order

    def value(share: float) -> float:
        turned = 2.0 * np.pi * lines * share + phases - 0.5 * np.pi * order
        return float(np.sum(size * np.sin(turned)))

    return np.asarray((phases + 2.0 * np.pi * first_passage(signal, value) * lines) % (2.0 * np.pi))


def first_passage(course: Array, value: Callable[[float], float]) -> float:
    """Share of its period at which a signal first passes zero, to all digits.

    course: one period of it, evenly sampled, finely enough that its first change of sign between
    two samples is a single passage. value: the signal itself, at a share of its period.
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
