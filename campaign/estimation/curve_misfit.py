"""Misfit of a curve, from the correlation of residuals at neighboring speeds.

Scatter is independent at each speed. If friction follows another law than the curve, the difference
changes slowly over speed. The parameters of the fit absorb one part of it; the residuals show the
other. The difference is modeled as a Gaussian process over the logarithm of speed (Kennedy and
O'Hagan, J. R. Stat. Soc. B 63 (2001) 425): its size in the parameters follows from its size in the
residuals. More points do not reduce it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from campaign.arrays import Array
from campaign.estimation.least_squares import NULL

SIGNIFICANCE = 0.02
"""p-value of the residuals below which the curve misfits. Of maps without misfit, one in 25 has a
false alarm in one of its two directions. With 8 speeds, where the beta distribution is least exact,
the rate for a direction is 0.035."""


@dataclass(frozen=True)
class CurveMisfit:
    """A difference between friction and a curve that changes slowly over speed.

    Attributes:
        p: p-value of the residuals under scatter alone.
        length: correlation length, as a difference of logarithms of speed.
        covariance: of the difference at each speed, over the deviations there, shape (n, n).
    """

    p: float
    length: float
    covariance: Array

    def moves(self, influence: Array) -> float:
        """Possible shift of a parameter by the difference (1 sigma, in its unit).

        influence: derivative of the parameter by each torque, times its deviation, shape (n,).
        """
        return float(np.sqrt(influence @ self.covariance @ influence))


def curve_misfit(speed: Array, residuals: Array, influence: Array) -> CurveMisfit | None:
    """Misfit of a least-squares fit; None where the residuals show none.

    K is the correlation of the difference at two speeds. Its length is the range of the speeds over
    one more than the parameters: the curve follows variations over more. r'Kr / r'r tests against
    scatter alone (King and Hillier, J. R. Stat. Soc. B 47 (1985) 98), by the beta distribution with
    its exact mean and variance (Durbin and Watson, Biometrika 38 (1951) 159). The variances of
    scatter and difference are those for which r'r and r'Kr are as expected (C. R. Rao, J.
    Multivariate Anal. 1 (1971) 257).

    Args:
        speed: rad/s, shape (n,).
        residuals: over the deviation of each, shape (n,).
        influence: derivatives of the parameters by each torque, times its deviation, (k, n).
    """
    place = np.log(speed)
    length = float(np.ptp(place)) / (len(influence) + 1)
    kernel = np.exp(-0.5 * (np.subtract.outer(place, place) / length) ** 2)
    norm = np.linalg.norm(influence, axis=1, keepdims=True)
    scaled = influence / np.maximum(norm, np.finfo(float).tiny)
    # Projection on the residuals: all torques that no parameter follows.
    left = np.eye(len(place)) - np.linalg.pinv(scaled, rcond=NULL) @ scaled
    rest, freedom = left @ residuals, round(float(np.trace(left)))
    sizes = np.linalg.eigvalsh(left @ kernel @ left)[-freedom:]
    size, shared = float(rest @ rest), float(rest @ kernel @ rest)
    if freedom < 2 or size == 0.0:
        return None
    p = _p_value(shared / size, sizes)
    if not p < SIGNIFICANCE:
        return None
    beyond = (shared - size * float(sizes.mean())) / (freedom * float(sizes.var()))
    all_of_it = size / float(sizes.sum())
    return CurveMisfit(p, length, min(beyond, all_of_it) * kernel)


def _p_value(ratio: float, sizes: Array) -> float:
    """Probability of a larger r'Kr / r'r by scatter alone.

    sizes: eigenvalues of K, projected on the residuals, in rising order, shape (m,).
    """
    from scipy.special import betaincc

    wide = float(sizes[-1] - sizes[0])
    mean = float(sizes.mean() - sizes[0]) / wide
    variance = 2.0 * float(sizes.var()) / (len(sizes) + 2.0) / wide**2
    count = mean * (1.0 - mean) / variance - 1.0
    share = min(max((ratio - float(sizes[0])) / wide, 0.0), 1.0)
    return float(betaincc(mean * count, (1.0 - mean) * count, share))
