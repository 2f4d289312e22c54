"""Covariance of a sum of autocorrelated terms (heteroskedasticity and autocorrelation consistent).

Bartlett's weights (Newey and West, Econometrica 55, 1987). The bandwidth follows Andrews' rule
(Econometrica 59, 1991, equations 6.2 and 6.4); half and twice of it show how much that decides.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from campaign.arrays import Array

DIFFER = 1.3
"""Deviations at half and twice the bandwidth that differ by more than this: the largest counts."""
MOST_LAGS = 0.2
"""of a piece's terms: a longer bandwidth would leave too few independent parts of it."""


def long_run(pieces: Sequence[Array], lags: float) -> Array:
    """Covariance of the sum over independent pieces, each (n, k), by weights up to `lags`, (k, k).

    Terms have mean 0.
    """
    # Whole numbers of lags are sums over a window; those between two are a mean of theirs.
    below = max(math.floor(lags), 1)
    above = max(math.ceil(lags), 1)
    share = above * (lags - below) / lags if above > below else 0.0
    found = (1.0 - share) * _windowed(pieces, below)
    return found if share == 0.0 else found + share * _windowed(pieces, above)


def _windowed(pieces: Sequence[Array], length: int) -> Array:
    """The same for a whole number: squares of sums over that many terms, at every place."""
    total = np.zeros((pieces[0].shape[1],) * 2)
    for each in pieces:
        sums = np.concatenate([np.zeros((1, each.shape[1])), np.cumsum(each, axis=0)])
        place = np.arange(1, len(each) + length)
        window = sums[np.minimum(place, len(each))] - sums[np.maximum(place - length, 0)]
        total += window.T @ window
    return total / length


def bandwidth(pieces: Sequence[Array]) -> float:
    """Lags by Andrews' rule for Bartlett's weights: an AR(1) to each column of pieces (n, k)."""
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
    """Half, once and twice the bandwidth of the rule, within `MOST_LAGS` of the longest piece."""
    most = MOST_LAGS * max(len(each) for each in pieces)
    lags = min(bandwidth(pieces), most)
    return 0.5 * lags, lags, min(2.0 * lags, most)


def safe_deviations(by_bandwidth: Array) -> Array:
    """Of deviations at half, once and twice the bandwidth, (3, k), those that count, shape (k,).

    Those at the rule's own, or the largest where the three differ by more than `DIFFER`.
    """
    largest = np.max(by_bandwidth, axis=0)
    wide = largest > DIFFER * np.min(by_bandwidth, axis=0)
    return np.asarray(np.where(wide, largest, by_bandwidth[1]))


def scaled_to(covariance: Array, deviation: Array) -> Array:
    """The covariance (k, k) with these deviations (k,); correlations stay."""
    ratio = deviation / np.sqrt(np.diag(covariance))
    return np.asarray(covariance * np.outer(ratio, ratio))
