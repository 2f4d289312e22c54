"""Covariance of a sum of autocorrelated terms (heteroskedasticity and autocorrelation consistent).

Bartlett's weights (Newey and West, Econometrica 55, 1987). The bandwidth follows Andrews' rule
(Econometrica 59, 1991, equations 6.2 and 6.4); half and twice the bandwidth show its influence.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from campaign.arrays import Array

DIFFER = 1.3
"""Ratio of deviations at different bandwidths above which the largest one applies."""
MOST_LAGS = 0.2
"""Largest bandwidth over the length of a piece: above it, too few parts are independent."""


def long_run(pieces: Sequence[Array], lags: float) -> Array:
    """Covariance (k, k) of the sum of terms of independent pieces, (n, k) each, for a bandwidth.

    The terms have mean 0.
    """
    # Weighted mean of the covariances for the two next whole numbers of lags.
    below = max(math.floor(lags), 1)
    above = max(math.ceil(lags), 1)
    share = above * (lags - below) / lags if above > below else 0.0
    covariance = (1.0 - share) * _windowed(pieces, below)
    return covariance if share == 0.0 else covariance + share * _windowed(pieces, above)


def _windowed(pieces: Sequence[Array], length: int) -> Array:
    """As `long_run`, for a whole number of lags: squares of the sums over moving windows."""
    total = np.zeros((pieces[0].shape[1],) * 2)
    for each in pieces:
        sums = np.concatenate([np.zeros((1, each.shape[1])), np.cumsum(each, axis=0)])
        place = np.arange(1, len(each) + length)
        window = sums[np.minimum(place, len(each))] - sums[np.maximum(place - length, 0)]
        total += window.T @ window
    return total / length


def bandwidth(pieces: Sequence[Array]) -> float:
    """Bandwidth (lags) by Andrews' rule for Bartlett's weights, with an AR(1) for each column."""
    over, under, count = 0.0, 0.0, sum(len(each) for each in pieces)
    for column in range(pieces[0].shape[1]):
        parts = [each[:, column] for each in pieces]
        square = sum(float(part @ part) for part in parts)
        if square == 0.0:
            continue
        neighbours = sum(float(part[1:] @ part[:-1]) for part in parts)
        rho = min(max(neighbours / square, -0.97), 0.97)
        innovations = 1.0 - rho**2  # of terms scaled to unit variance
        over += 4.0 * rho**2 * innovations**2 / ((1.0 - rho) ** 6 * (1.0 + rho) ** 2)
        under += innovations**2 / (1.0 - rho) ** 4
    share = float(over / under) if under > 0 else 0.0
    return max(1.1447 * float((share * count) ** (1.0 / 3.0)), 1.0)


def bandwidths(pieces: Sequence[Array]) -> tuple[float, float, float]:
    """Half, once and twice the bandwidth of the rule, at most `MOST_LAGS` of the longest piece."""
    most = MOST_LAGS * max(len(each) for each in pieces)
    lags = min(bandwidth(pieces), most)
    return 0.5 * lags, lags, min(2.0 * lags, most)


def safe_deviations(by_bandwidth: Array) -> Array:
    """Deviations to report, shape (k,), from those at half, once and twice the bandwidth, (3, k).

    Those at the rule's bandwidth, or the largest where the three differ by more than `DIFFER`.
    """
    largest = np.max(by_bandwidth, axis=0)
    wide = largest > DIFFER * np.min(by_bandwidth, axis=0)
    return np.asarray(np.where(wide, largest, by_bandwidth[1]))


def scaled_to(covariance: Array, deviation: Array) -> Array:
    """Covariance (k, k) with other deviations (k,) and the same correlations."""
    ratio = deviation / np.sqrt(np.diag(covariance))
    return np.asarray(covariance * np.outer(ratio, ratio))
