"""Lines of periodic signals without transient and drift, with noise covariance.

A record of P periods has P - 1 lines between two harmonics of its period. For any nonlinear system
they contain only transient and noise. The transient is smooth over frequency. A polynomial through
the lines around a harmonic estimates it, and the residuals are noise (robust local polynomial
method; Pintelon, Vandersteen, Schoukens and Rolain, Mech. Syst. Signal Process. 25 (2011) 2892;
Pintelon and Schoukens (2012), 7.2).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from campaign.arrays import Array, ComplexArray

ORDER = 2
"""Order of the polynomial of the transient."""
AROUND = 10
"""Number of fitted lines around a harmonic; harmonics are excluded."""
REACH = 2 * AROUND
"""Largest distance of these lines from the harmonic, in lines."""


@dataclass(frozen=True)
class LineSpectra:
    """Complex amplitudes of c signals in m realisations at lines 1 to n of their period.

    Attributes:
        frequency: of the lines (Hz), shape (n,).
        lines: without transient, shape (c, m, n); |line| is the amplitude of a sine.
        noise: covariance E[e e*] of `lines` in one realisation, shape (n, c, c), averaged over the
            realisations; None for a single period.
        freedom: real degrees of freedom of `noise`.
        periods: of each realisation.
    """

    frequency: Array
    lines: ComplexArray
    noise: ComplexArray | None
    freedom: float
    periods: int

    @property
    def shared(self) -> float:
        """Number of lines whose noise estimate uses the same line between harmonics."""
        return max(1.0, AROUND / max(self.periods - 1, 1))

    def conjugated(self, phase: ComplexArray) -> LineSpectra:
        """Rotate each line back by a phase factor of size 1, shape (m, n)."""
        turned = self.lines * np.conj(phase)
        return replace(self, lines=turned)


def line_spectra(signals: Array, rate: float, periods: int, highest: float) -> LineSpectra:
    """Lines of signals of shape (c, m, periods * samples), sampled at `rate` (Hz).

    Args:
        highest: upper limit of the lines (Hz).

    Raises ValueError for incomplete periods, samples not finite, and no line below `highest`.
    """
    total = signals.shape[-1]
    if periods < 1 or total % periods:
        raise ValueError(f"{total} samples are not {periods} whole periods")
    if not np.all(np.isfinite(signals)):
        raise ValueError("a signal has samples that are no numbers")
    bins = np.fft.rfft(signals, axis=-1) * (2.0 / total)
    count = min(int(np.floor(highest * total / rate / periods + 1e-9)), total // periods // 2 - 1)
    if count < 1:
        raise ValueError(f"no line of the period lies below {highest:g} Hz")
    at = periods * np.arange(1, count + 1)
    frequency = at * rate / total
    lines = bins[..., at]
    if periods == 1:
        return LineSpectra(frequency, lines, None, 0.0, 1)
    channels, realisations = signals.shape[:2]
    noise = np.zeros((count, channels, channels), dtype=complex)
    free = float(AROUND - ORDER - 1)
    for k, bin_ in enumerate(at.tolist()):
        away, basis, inverse = _fitted_around(
            min(bin_, REACH + 1), periods, min(bins.shape[-1] - bin_, REACH + 1)
        )
        around = bins[..., bin_ + away]
        fit = around @ inverse.T
        lines[..., k] -= fit[..., 0]
        left = around - fit @ basis.T
        spread = np.einsum("amj,bmj->ab", left, np.conj(left)) / (free * realisations)
        # The subtracted transient adds noise to that of the line, by `inverse`.
        noise[k] = spread * (1.0 + float(np.sum(inverse[0] ** 2)))
    return LineSpectra(frequency, lines, noise, 2.0 * free * realisations, periods)


@cache
def _fitted_around(below: int, periods: int, above: int) -> tuple[NDArray[np.intp], Array, Array]:
    """Distances of the fitted lines from a harmonic; basis and its inverse.

    These are the nearest lines except harmonics. The mean is `below` lines lower and excluded; the
    spectrum ends `above` lines higher.
    """
    away = np.arange(max(1 - below, -REACH), min(above, REACH + 1))
    away = away[away % periods != 0]
    away = np.sort(away[np.argsort(np.abs(away), kind="stable")[:AROUND]])
    basis = np.vander(away / AROUND, ORDER + 1, increasing=True)
    return np.asarray(away, dtype=np.intp), np.asarray(basis), np.asarray(np.linalg.pinv(basis))
