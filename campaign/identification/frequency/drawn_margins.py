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
from campaign.identification.frequency_response import Array, ComplexArray
from campaign.identification.intervals import LEVEL
from campaign.identification.servo import MINUS_3_DB
from campaign.reason import Cause

DRAWS = 1000
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
    sign = np.sign(values)
    passed = (sign[:-1] > 0) & (sign[1:] <= 0)
    if not falling:
        passed |= (sign[:-1] < 0) & (sign[1:] >= 0)
    found = []
    for k in np.flatnonzero(passed):
        share = values[k] / (values[k] - values[k + 1])
        found.append(float(frequency[k] * (frequency[k + 1] / frequency[k]) ** share))
    return found


def fall(log: ComplexArray) -> Array:
    """Log of |T| over -3 dB, of log L."""
    return np.asarray(-np.log(np.abs(1.0 + np.exp(-log)) * MINUS_3_DB))


def drawn_margins(loop: Logarithm, parameters: int, lowest: float, highest: float) -> Drawn:
    """Of `DRAWS` functions between `lowest` and `highest` (Hz), the same ones at each call."""
    frequency = np.geomspace(lowest, highest, GRID)
    half = np.random.default_rng(SEED).standard_normal((DRAWS // 2, parameters))
    logs = loop.drawn(frequency, np.concatenate([half, -half]))
    found = np.array([_read(frequency, log) for log in logs])
    return Drawn(found[:, 0], found[:, 1], found[:, 2], found[:, 3] > 0)


def _read(frequency: Array, log: ComplexArray) -> tuple[float, float, float, bool]:
    drop = fall(log)
    widths = zeros(frequency, drop, falling=True)
    if widths:
        width = widths[0]
    else:
        width = math.inf if np.all(drop > 0) else 0.0 if np.all(drop < 0) else math.nan
    at = np.log(frequency)
    crossed = zeros(frequency, log.real)
    last = -DECIBEL * float(log.real[-1])
    if not crossed:
        return width, -math.inf if last < 0 else math.inf, last, False
    phase = np.unwrap(log.imag)
    over = np.remainder(np.interp(np.log(crossed), at, phase), 2.0 * math.pi) - math.pi
    margin = float(over[np.argmin(np.abs(over))])
    turns = [
        each
        for each in zeros(frequency, np.sin(phase))
        if each > crossed[0] and math.cos(float(np.interp(math.log(each), at, phase))) < 0
    ]
    gains = [-DECIBEL * float(np.interp(math.log(each), at, log.real)) for each in turns]
    return width, margin, min(gains, default=last), bool(gains)


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
