"""What margins would be of other functions that the scatter of a fit allows: drawn, not linearised.

A crossing moves by more than its linear part where the curve is flat, and near the end of the band
it may lie beyond: no derivative shows that. Logarithms of a fitted function are drawn along their
own derivatives, all frequencies together, and each draw is read like the function itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from campaign.estimate import Estimate
from campaign.estimation.frequency_response import Array, ComplexArray
from campaign.estimation.intervals import LEVEL
from campaign.estimation.servo import MINUS_3_DB
from campaign.reason import Cause

DRAWS = 1000
BLOCK = 100
"""Draws that are read together: what stays in a processor's cache."""
GRID = 500
"""Frequencies at which a draw is read; between them by straight lines over log frequency."""
SEED = 20240229
AGREES = 0.15
"""Share of a half-width by which an end may lie elsewhere before draws take the place of slopes."""
OTHERWISE = 0.005
"""Share of draws without that crossing from which on they do so, too."""
DECIBEL = 20.0 / math.log(10.0)
METHOD = "rational function with a delay, functions drawn from its scatter"
TAIL = 0.5 - 0.5 * LEVEL
ONE_SIDED = 1.0 - LEVEL
OPEN_IN_BAND = Cause("open in band", "scatter leaves open whether it lies in the band")


class Logarithm(Protocol):
    """A fitted loop, and what its scatter makes of it."""

    def drawn(self, frequency: Array, normal: Array) -> ComplexArray:
        """Log L of draws, phase as it comes, shape (m, n), by standard normal numbers (m, p)."""


@dataclass(frozen=True)
class Drawn:
    """Readings of each draw, shape (m,).

    Attributes:
        bandwidth: (Hz); infinite beyond the band, zero before it, NaN where the loop never falls.
        phase_margin: (rad); infinite without a gain crossover in the band: negative where that
            lies beyond it, since phases fall.
        gain_margin: (dB); where L is never real and negative the gain at the last frequency.
        turned: whether it is, behind the first gain crossover.
    """

    bandwidth: Array
    phase_margin: Array
    gain_margin: Array
    turned: NDArray[np.bool_]


def zeros(frequency: Array, values: Array, falling: bool = False) -> list[float]:
    """Where values pass zero, by linear interpolation over log frequency (Hz)."""
    return [float(each) for each in _zeros(frequency, values[None], falling)[3]]


def _zeros(
    frequency: Array, values: Array, falling: bool = False
) -> tuple[NDArray[np.intp], NDArray[np.intp], Array, Array]:
    """Of values (m, n): row, column before, share of the way to the next one, and frequency."""
    above, below = values > 0, values < 0
    passed = above[:, :-1] & (values[:, 1:] <= 0)
    if not falling:
        passed |= below[:, :-1] & (values[:, 1:] >= 0)
    row, at = np.nonzero(passed)
    share = values[row, at] / (values[row, at] - values[row, at + 1])
    return row, at, share, frequency[at] * (frequency[at + 1] / frequency[at]) ** share


def fall(log: ComplexArray) -> Array:
    """Log of |T| over -3 dB, of log L."""
    return _fall(log.real, np.cos(log.imag), np.sin(log.imag))


def _fall(gain: Array, cosine: Array, sine: Array) -> Array:
    """Of log |L| and its phase's; from numpy's complex `exp` it would take three times as long."""
    over, back = np.empty(gain.shape, dtype=complex), np.exp(-gain)
    over.real, over.imag = 1.0 + back * cosine, back * sine
    return np.asarray(-np.log(np.abs(over) * MINUS_3_DB))


def drawn_margins(loop: Logarithm, parameters: int, lowest: float, highest: float) -> Drawn:
    """Of `DRAWS` functions between `lowest` and `highest` (Hz), the same ones at each call."""
    frequency = np.geomspace(lowest, highest, GRID)
    half = np.random.default_rng(SEED).standard_normal((DRAWS // 2, parameters))
    blocks = np.concatenate([half, -half]).reshape(-1, BLOCK, parameters)
    found = [_read(frequency, loop.drawn(frequency, each)) for each in blocks]
    return Drawn(*(np.concatenate(each) for each in zip(*found, strict=True)))


def _read(frequency: Array, log: ComplexArray) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
    """What `Drawn` holds, of log L of draws, shape (m, n)."""
    count, phase = len(log), log.imag

    def lowest(row: NDArray[np.intp], values: Array, otherwise: Array | float) -> Array:
        found = np.full(count, np.inf)
        np.minimum.at(found, row, values)
        return np.where(np.isin(np.arange(count), row), found, otherwise)

    def turned(row: NDArray[np.intp], at: NDArray[np.intp], share: Array) -> Array:
        """Phase over -180 deg between two columns, from 0 to a whole turn less that."""
        before = phase[row, at]
        change = np.remainder(phase[row, at + 1] - before + math.pi, 2.0 * math.pi) - math.pi
        return np.remainder(before + share * change, 2.0 * math.pi) - math.pi

    sine = np.sin(phase)
    drop = _fall(log.real, np.cos(phase), sine)
    outside = np.where(np.all(drop < 0, axis=1), 0.0, np.nan)
    outside[np.all(drop > 0, axis=1)] = np.inf
    row, _, _, where = _zeros(frequency, drop, falling=True)
    width = lowest(row, where, outside)

    row, at, share, where = _zeros(frequency, log.real)
    crossover = lowest(row, where, np.inf)
    last = -DECIBEL * log.real[:, -1]
    margin = np.where(last < 0, -np.inf, np.inf)
    over = turned(row, at, share)
    order = np.argsort(-np.abs(over), kind="stable")  # of a row the last counts, the smallest
    margin[row[order]] = over[order]

    row, at, share, where = _zeros(frequency, sine)
    behind = (where > crossover[row]) & (np.abs(turned(row, at, share)) < 0.5 * math.pi)
    row, at, share = row[behind], at[behind], share[behind]
    gain = -DECIBEL * ((1.0 - share) * log.real[row, at] + share * log.real[row, at + 1])
    return width, margin, lowest(row, gain, last), np.isin(np.arange(count), row)


def with_draws(estimate: Estimate, draws: Array) -> Estimate:
    """A crossing's number with the interval of draws, where its slopes do not tell it.

    Args:
        draws: shape (m,); infinite where it lies beyond the band, on that side; NaN as above it.
    """
    if estimate.low is None or estimate.high is None:
        return estimate
    told = np.where(np.isnan(draws), np.inf, draws)
    low, high = np.quantile(told, (TAIL, 1.0 - TAIL), method="inverted_cdf")
    half = 0.5 * (estimate.high - estimate.low)
    elsewhere = np.mean(~np.isfinite(told))
    alike = max(abs(low - estimate.low), abs(high - estimate.high)) <= AGREES * half
    if alike and elsewhere <= OTHERWISE:
        return estimate
    ends = (
        float(min(low, estimate.value)) if math.isfinite(low) else None,
        float(max(high, estimate.value)) if math.isfinite(high) else None,
    )
    if ends == (None, None):
        reason = OPEN_IN_BAND()
        return Estimate.without_interval(
            estimate.name, math.nan, estimate.unit, reason, method=METHOD
        )
    return replace(estimate, low=ends[0], high=ends[1], method=METHOD)


def least(draws: Array, highest: float) -> float:
    """What 95 % of the draws reach, at most `highest`; NaN counts as reaching it."""
    told = np.minimum(np.where(np.isnan(draws), highest, draws), highest)
    return float(np.quantile(told, ONE_SIDED, method="inverted_cdf"))
