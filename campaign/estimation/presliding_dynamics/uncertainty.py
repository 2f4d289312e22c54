"""Uncertainty of the parameters of a joint fit.

There are two covariances: one from the autocorrelated scores of all samples, and one from the
differences between records. The second one is larger if friction changed between records. It
applies where it is significantly larger.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from campaign.arrays import Array
from campaign.estimation.least_squares import profile_limit
from campaign.estimation.long_run import bandwidths, long_run, safe_deviations, scaled_to
from campaign.estimation.presliding_dynamics.fit import search
from campaign.estimation.presliding_dynamics.fit_result import JointFit

CHANCE = 0.01
"""Probability of falsely detecting differences between records."""
CURVED = 0.03
"""Relative standard error above which a limit is calculated along the profile."""
ACCURACY, DOUBLINGS = 0.01, 4
"""Relative accuracy of such a limit; largest number of doublings. Each step needs a fit."""
TELLABLE = 1e10
"""Condition number of the scaled information above which parameters cannot be separated."""


@dataclass(frozen=True)
class Spread:
    """Covariance of the shared parameters, in the vector's units.

    Attributes:
        covariance: shape (k, k).
        freedom: degrees of freedom of each deviation, shape (k,); infinite if from scores.
    """

    covariance: Array
    freedom: Array

    @property
    def deviation(self) -> Array:
        """Standard deviation of each shared parameter, shape (k,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def correlation(self) -> Array:
        """Correlation of the shared parameters, shape (k, k)."""
        return np.asarray(self.covariance / np.outer(self.deviation, self.deviation))


def spread_of(fit: JointFit) -> Spread:
    """Covariance of the shared parameters of a fit.

    Raises ValueError if the records do not separate the parameters.
    """
    shared = len(fit.parameters.names)
    information = fit.information
    scores = scores_of(fit)
    length = np.sqrt(np.diag(information))
    if not np.all(length > 0):
        raise ValueError("a parameter changes nothing in these records")
    scaled = information / np.outer(length, length)
    if not np.linalg.cond(scaled) < TELLABLE:
        raise ValueError("these records do not separate the parameters of the fit")
    inverse = np.linalg.inv(scaled) / np.outer(length, length)
    count = sum(float(np.sum(c.there)) for group in fit.channels for c in group)
    variance = fit.cost / max(count - fit.parameters.size, 1.0)
    ordinary = np.sqrt(variance * np.diag(inverse))[:shared]
    covariances = [by_scores(fit, inverse, scores, lags) for lags in bandwidths(scores)]
    widths = np.sqrt([np.diag(each) for each in covariances])
    # A quantized channel has the same errors in each period of the torque, without scatter.
    folded = [
        _folded(each, r.samples_per_period()) for each, r in zip(scores, fit.records, strict=True)
    ]
    repeated = np.sqrt(np.diag(by_scores(fit, inverse, folded, bandwidths(folded)[1])))
    # Negatively correlated residuals would cause too small deviations.
    chosen = np.maximum.reduce([safe_deviations(widths), repeated, ordinary])
    covariance = scaled_to(covariances[1], chosen)
    if len(fit.records) > 1:
        return _with_records(fit, information, covariance)
    return Spread(covariance, np.full(shared, np.inf))


def scores_of(fit: JointFit) -> list[Array]:
    """Scores of each record, shape (n, p)."""
    pairs = zip(fit.residuals, fit.jacobians, strict=True)
    return [np.einsum("cn,cnk->nk", left, slopes) for left, slopes in pairs]


def by_scores(fit: JointFit, inverse: Array, scores: Sequence[Array], lags: float) -> Array:
    """Covariance of the shared parameters by scores, with the bandwidth `lags`, shape (k, k).

    `inverse`: of the information. Priors have exactly their stated uncertainty.
    """
    whole = inverse @ (long_run(scores, lags) + np.diag(fit.priors**2)) @ inverse
    shared = len(fit.parameters.names)
    return np.asarray(whole[:shared, :shared])


def _folded(scores: Array, period: int | None) -> Array:
    """Scores (n, k) summed over all periods, shape (period, k); the total is unchanged."""
    if period is None:
        return scores
    count = -(-len(scores) // period) * period
    padded = np.concatenate([scores, np.zeros((count - len(scores), scores.shape[1]))])
    return np.asarray(padded.reshape(-1, period, scores.shape[1]).sum(axis=0))


def _with_records(fit: JointFit, information: Array, covariance: Array) -> Spread:
    """Spread with the deviations between records where they exceed those of `covariance`.

    The score of a record, reduced by its own parameters, shows its deviation from the shared
    parameters (Liang and Zeger, Biometrika 73, 1986).
    """
    from scipy.special import chdtri

    shared, groups = fit.parameters.common, len(fit.records)
    reduced = information[:shared, :shared].copy()
    scores = []
    for number, (left, slopes) in enumerate(zip(fit.residuals, fit.jacobians, strict=True)):
        own = fit.parameters.of_record(number)
        across = information[:shared, own] @ np.linalg.inv(information[own, own])
        reduced -= across @ information[own, :shared]
        whole = np.einsum("cn,cni->i", left, slopes)
        scores.append(whole[:shared] - across @ whole[own])
    scatter = np.cov(np.array(scores).T, bias=False) * groups + np.diag(fit.priors[:shared] ** 2)
    inverse = np.linalg.inv(reduced)
    between = np.sqrt(np.diag(inverse @ scatter @ inverse))[: len(fit.parameters.names)]
    within = np.sqrt(np.diag(covariance))
    limit = float(np.sqrt(chdtri(groups - 1, CHANCE) / (groups - 1)))
    apart = between / within > limit
    freedom = np.where(apart, groups - 1.0, np.inf)
    return Spread(scaled_to(covariance, np.where(apart, between, within)), freedom)


def profile_end(fit: JointFit, spread: Spread, index: int, quantile: float, way: float) -> float:
    """Limit of a shared parameter at `quantile` deviations of its profile; `way`: -1 or 1.

    The sum of squares is in units of the parameter's own variance, which includes the effect of
    autocorrelated residuals. Raises ValueError if the profile has no limit.
    """
    sigma = float(spread.deviation[index])
    # Ratio of the rise of the profiled sum of squares to the square of a small distance.
    curvature = 1.0 / float(np.linalg.inv(fit.information)[index, index])

    def squared_rise(distance: float) -> float:
        """Squared rise of the profile at a distance, both in `sigma`."""
        if distance == 0.0:
            return 0.0
        held = _held(fit, index, way * distance * sigma)
        return max(held.cost - fit.cost, 0.0) / curvature / sigma**2

    end = profile_limit(squared_rise, 0.0, quantile, quantile**2, ACCURACY, DOUBLINGS)
    return float(fit.vector[index] + way * end * sigma)


def _held(fit: JointFit, index: int, distance: float) -> JointFit:
    """Fit with one parameter fixed at a distance and the others optimized."""
    column = np.linalg.inv(fit.information)[:, index]
    vector = np.clip(fit.vector + distance * column / column[index], *fit.parameters.bounds())
    vector[index] = fit.vector[index] + distance
    return search(replace(fit, vector=vector), held=index)
