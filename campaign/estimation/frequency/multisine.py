"""Odd random-phase multisines: response, noise and distortion at once.

Only odd lines of the base frequency are excited. Each group of a few lines omits one, drawn at
random. The output at omitted lines is odd distortion, at even lines even distortion. Phases are
independent and uniform. Therefore a mean over realisations reduces the rest (Pintelon and
Schoukens, "System Identification: A Frequency Domain Approach" (2012), 3.5 and 4.3).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from campaign.arrays import Array
from campaign.signals import MultiSine

Lines = NDArray[np.int64]
CREST_SAMPLES = 8
"""Samples per cycle of the highest line, for the crest factor."""


@dataclass(frozen=True)
class OddGrid:
    """Lines of a period: multiples of 1 / `period`.

    Attributes:
        period: (s).
        excited: ascending odd lines, shape (k,).
    """

    period: float
    excited: Lines

    @property
    def frequency(self) -> Array:
        """Frequencies of the excited lines (Hz), shape (k,)."""
        return np.asarray(self.excited / self.period)


def odd_grid(lowest: float, highest: float, period: float, seed: int, group: int = 3) -> OddGrid:
    """Odd lines from `lowest` to `highest` (Hz); one random line of each `group` is omitted.

    The first and the last line are always kept. Raises ValueError for fewer than three groups, or
    for groups of one line.
    """
    if group < 2:
        raise ValueError("a group has at least two lines: one is left out")
    first, last = int(np.ceil(lowest * period)), int(np.floor(highest * period))
    odd = np.arange(first + (first + 1) % 2, last + 1, 2, dtype=np.int64)
    odd = odd[odd > 0]
    if len(odd) < 3 * group:
        raise ValueError(
            f"{len(odd)} odd lines between {lowest:g} and {highest:g} Hz; {3 * group} are the "
            "fewest: lengthen the period"
        )
    random = np.random.default_rng(seed)
    left_out = []
    for start in range(0, len(odd) - group + 1, group):
        choice = [k for k in range(start, start + group) if 0 < k < len(odd) - 1]
        left_out.append(int(random.choice(choice)))
    kept = np.ones(len(odd), dtype=bool)
    kept[left_out] = False
    return OddGrid(period, odd[kept])


def random_phases(grid: OddGrid, rms: float, seed: int, draws: int = 1) -> MultiSine:
    """One realisation: sines of equal amplitude and uniform random phases, with a total `rms`.

    rms: in the unit of the input. draws: number of draws; the one with the lowest crest factor is
        kept. After a few tens of draws the phases still count as random; a search would make them
        dependent.
    """
    random = np.random.default_rng(seed)
    size = np.ones(len(grid.excited))
    amplitude = rms * size / np.sqrt(0.5 * np.sum(size**2))
    phases = random.uniform(0.0, 2.0 * np.pi, (max(draws, 1), len(size)))
    if draws > 1:
        best = min(range(draws), key=lambda k: _crest(grid.excited, amplitude, phases[k]))
        phases = phases[best : best + 1]
    return MultiSine(
        amplitudes=tuple(map(float, amplitude)),
        frequencies=tuple(map(float, grid.frequency)),
        phases=tuple(map(float, phases[0])),
    )


def _crest(lines: Lines, amplitude: Array, phases: Array) -> float:
    """Largest value over rms."""
    signal = course(lines, phases, CREST_SAMPLES * int(lines[-1]), amplitude)
    return float(np.max(np.abs(signal)) / np.std(signal))


def course(
    lines: Lines, phases: Array, count: int, amplitudes: Array | float = 1.0, order: int = 0
) -> Array:
    """One period of sines in `count` points, or its `order`-th integral up to a scale."""
    spectrum = np.zeros(count // 2 + 1, dtype=complex)
    spectrum[lines] = amplitudes * np.exp(1j * (phases - 0.5 * np.pi)) / (1j * lines) ** order
    return np.asarray(np.fft.irfft(spectrum, count) * count / 2.0)


ALIKE = 1e-3
"""Largest mean square change, over twice the variance, between two repeated periods."""
UNLIKE = 0.5
"""Value that this ratio exceeds at a lag between repetitions."""
LOOKED_AT = 1 << 21
"""Largest number of samples used, from the end of a recording."""
STRONG, MANY = 0.2, 10
"""Least amplitude of a strong line over the largest one; fewest strong lines of a multisine."""


def repetition(signal: Array) -> int | None:
    """Samples per period of a multisine, shape (n,), with two or more periods; otherwise None.

    A sine, a triangle and trapezoids are also periodic, but have few strong lines.
    """
    signal = signal[-LOOKED_AT:]
    moving = signal - np.mean(signal)
    count = len(moving)
    power = float(np.mean(moving**2))
    if count < 4 * MANY or not power > 0:
        return None
    spectrum = np.fft.rfft(moving, 2 * count)
    lags = np.arange(count // 2 + 1)
    alike = np.fft.irfft(np.abs(spectrum) ** 2)[: len(lags)]
    square = np.concatenate([[0.0], np.cumsum(moving**2)])
    both = square[count - lags] + square[count] - square[lags]
    change = (both - 2.0 * alike) / (2.0 * power * (count - lags))
    apart = np.flatnonzero(change > UNLIKE)
    if not len(apart):
        return None
    again = apart[0] + np.flatnonzero(change[apart[0] :] < ALIKE)
    if not len(again):
        return None
    beyond = np.flatnonzero(change[again[0] :] >= ALIKE)
    ends = again[0] + (int(beyond[0]) if len(beyond) else len(change) - again[0])
    period = int(again[0] + np.argmin(change[again[0] : ends]))
    size = np.abs(np.fft.rfft(moving[-period:]))
    return period if np.count_nonzero(size > STRONG * np.max(size)) >= MANY else None
