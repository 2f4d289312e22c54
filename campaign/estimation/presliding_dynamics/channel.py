"""A measured channel of a record: detrending of residuals and noise weights."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from campaign.arrays import Array, Flags

MOST_ORDER = 12
"""Highest order of the autoregression of a channel's noise."""
DRIFT = {"rate": 2, "angle": 1}
"""Number of coefficients of each channel's error polynomial: offset, drift."""


@dataclass(frozen=True)
class Channel:
    """A measured channel of a record, with its offset, drift and noise model.

    Attributes:
        name: `rate` or `angle`.
        samples: measured (rad/s or rad), 0 for missing ones, shape (n,).
        kept: mask of the valid samples.
        there: mask of the valid whitened samples, 1 or 0, shape (n,).
        basis: orthonormal columns of whitened offset and drift, shape (n, q).
        deviation: standard deviation of its whitened residuals (rad/s or rad).
        whitening: filter 1, -a1, -a2, ... of the autoregression of its noise.
    """

    name: str
    samples: Array
    kept: Flags
    there: Array
    basis: Array
    deviation: float
    whitening: Array

    @classmethod
    def of(
        cls, name: str, samples: Array, kept: Flags, deviation: float, whitening: Array
    ) -> Channel:
        """Channel with derived attributes; samples after a missing one cannot be whitened."""
        valid = kept.copy()
        for lag in range(1, len(whitening)):
            valid[lag:] &= kept[:-lag]
        # The past of the first samples is unknown, not 0.
        valid[: len(whitening) - 1] = False
        powers = np.vander(np.linspace(-1.0, 1.0, len(kept)), DRIFT[name])
        basis = np.linalg.qr(filtered(powers, whitening) * valid[:, None])[0]
        return cls(name, samples, kept, valid.astype(float), basis, deviation, whitening)

    def left(self, values: Array) -> Array:
        """Whitened values (n, ...) without offset and drift, over `deviation`."""
        shown = (filtered(values, self.whitening).T * self.there).T
        return np.asarray((shown - self.basis @ (self.basis.T @ shown)) / self.deviation)


def filtered(values: Array, whitening: Array) -> Array:
    """Filter values (n, ...) by the whitening filter of an autoregression."""
    from scipy.signal import lfilter

    if len(whitening) == 1 or not values.size:
        return values
    return np.asarray(lfilter(whitening, [1.0], values, axis=0))


def white_noise(samples: Array) -> float:
    """Standard deviation of white noise on a smooth signal, by second differences; above 0."""
    rough = float(np.std(np.diff(samples, 2))) / np.sqrt(6.0)
    return float(max(rough, 1e-4 * np.std(samples), np.finfo(float).tiny))


def autoregression(residuals: Array) -> Array:
    """Whitening filter 1, -a1, ... of residuals (n,), by Levinson-Durbin and Akaike's criterion."""
    count = len(residuals)
    most = min(MOST_ORDER, count // 20)
    covariance = np.array([residuals[lag:] @ residuals[: count - lag] for lag in range(most + 1)])
    if not covariance[0] > 0:
        return np.ones(1)
    filters, variance = [np.ones(1)], covariance[0] / count
    scores = [count * np.log(variance)]
    for order in range(1, most + 1):
        last = filters[-1]
        reflection = -(last @ covariance[order:0:-1]) / (count * variance)
        grown = np.append(last, 0.0)
        filters.append(grown + reflection * grown[::-1])
        variance *= max(1.0 - reflection**2, 1e-12)
        scores.append(count * np.log(variance) + 2.0 * order)
    return filters[int(np.argmin(scores))]
