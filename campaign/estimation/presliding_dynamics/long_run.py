"""Covariance of a sum of autocorrelated terms (heteroskedasticity and autocorrelation consistent).

Bartlett's weights (Newey and West, Econometrica 55, 1987) with the bandwidth of Andrews
(Econometrica 59, 1991, equations 6.2 and 6.4).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from campaign.arrays import Array

DIFFERENT = 1.3
"""Ratio of deviations at half, once and twice the bandwidth from which on the largest counts."""
WIDEST = 0.1
"""of a series: a longer bandwidth would leave too few independent parts of it."""


def bandwidth(series: Array) -> float:
    """Samples over which Bartlett's weights fall to zero, for series of shape (n, k)."""
    count = len(series)
    energy = np.sum(series[:-1] ** 2, axis=0)
    kept = energy > 0
    if not np.any(kept):
        return 1.0
    own = np.sum(series[1:] * series[:-1], axis=0)[kept] / energy[kept]
    own = np.clip(own, -0.97, 0.97)
    terms = 4.0 * own**2 / ((1.0 - own) * (1.0 + own)) ** 2
    # All series count alike, whatever their units: the mean of Andrews' alpha(1).
    found = 1.1447 * (float(np.mean(terms)) * count) ** (1.0 / 3.0)
    return float(np.clip(found, 1.0, max(1.0, WIDEST * count)))


def long_run_covariance(series: Array, *widths: float) -> tuple[Array, ...]:
    """Covariance of the sum over a series of shape (n, k) of mean 0, for each width, shape (k, k).

    By the spectrum: the weights over the lags are a filter over frequency.
    """
    from scipy.fft import irfft, next_fast_len, rfft

    count = len(series)
    length = next_fast_len(2 * count, real=True)
    spectrum = rfft(series, length, axis=0)
    lags = np.minimum(np.arange(length), length - np.arange(length))
    found = []
    for width in widths:
        weights = np.where(lags < count, np.maximum(0.0, 1.0 - lags / width), 0.0)
        smoothed = irfft(spectrum * rfft(weights).real[:, None], length, axis=0)[:count]
        total = series.T @ smoothed
        found.append(0.5 * (total + total.T))
    return tuple(found)


def at_bandwidths(groups: Sequence[Array]) -> tuple[Array, Array, Array]:
    """Covariance of the sum over independent groups, at half, once and twice the bandwidth."""
    size = groups[0].shape[1]
    found = [np.zeros((size, size)) for _ in range(3)]
    for group in groups:
        width = bandwidth(group)
        for index, each in enumerate(long_run_covariance(group, 0.5 * width, width, 2.0 * width)):
            found[index] += each
    return found[0], found[1], found[2]
