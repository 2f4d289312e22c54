"""Regression on few points with excess scatter and autocorrelation.

The model is y = X b + own + between. `own` has the known covariance of the points' intervals.
`between` is the scatter between runs: a first-order autoregression in the order of the points, with
standard deviation tau and correlation rho of neighbors, both unknown. With few points, intervals
for estimated values of tau and rho would be much too narrow. Therefore both are integrated out. For
each tau and rho, b is normal (generalized least squares); the result is the mixture of these
normals, weighted by the restricted likelihood (Harville, Journal of the American Statistical
Association 72, 1977) times three priors:

- 1 / (s + tau), with the typical own error s: the reference prior 1 / tau where own errors are
  negligible, so that independent points without own errors have exactly Student's t; almost flat
  below s, as Gelman (Bayesian Analysis 1, 2006) recommends for a variance that may be 0;
- for the own errors, a probability of 1/2 that they are as stated, and of 1/2 that they are between
  `LEAST_OWN` times that and that (flat in the logarithm). An error common to all intervals, such as
  a misfit of the model, cancels in differences. Then points scatter much less than their intervals;
- flat for rho from 0 to `MOST_RHO`. Few points do not determine rho; intervals are valid on average
  over it. A negative rho, which reduces the error of slopes, is excluded.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import Self

import numpy as np
from numpy.typing import NDArray

from campaign.arrays import Array

MOST_RHO = 0.9
"""Largest correlation of neighboring runs in the prior."""
LEAST_OWN = 0.02
"""Least share of the stated own errors that may be independent."""
OWNS = 6
"""Number of nodes in this share; the share 1 has half of the weight."""
RHOS = 12
"""Number of nodes (Gauss-Legendre) in the correlation."""
COARSE, FINE = 8, 60
"""Number of nodes in tau: per decade in the search of its range; within the range."""
NEGLIGIBLE = 18.0
"""Distance of a weight's logarithm from the largest, beyond which the weight is not used."""
FLOOR = 1e-7
"""Least own error of a point, as a share of the scatter, so that matrices stay regular."""
WIDEST = 1e3
"""Largest tau, in standard deviations of the values."""


@dataclass(frozen=True)
class Mixture:
    """Distribution of one number: a weighted mixture of normals.

    Attributes:
        weight: shape (g,), sum 1.
        mean, deviation: shape (g,).
    """

    weight: Array
    mean: Array
    deviation: Array

    @classmethod
    def of(cls, log_weight: Array, mean: Array, deviation: Array) -> Self:
        """Mixture from logarithms of weights, without negligible ones."""
        kept = log_weight > np.max(log_weight) - NEGLIGIBLE
        return cls(_weights(log_weight[kept]), mean[kept], deviation[kept])

    @property
    def value(self) -> float:
        """Median."""
        return self.quantile(0.5)

    def below(self, number: float) -> float:
        """Probability of a value below a number."""
        from scipy.special import ndtr

        return float(self.weight @ ndtr((number - self.mean) / self.deviation))

    def quantile(self, share: float) -> float:
        """Quantile of the probability `share`."""
        from scipy.optimize import brentq
        from scipy.special import ndtri

        ends = self.mean + float(ndtri(share)) * self.deviation
        low, high = float(np.min(ends)), float(np.max(ends))
        wide = high - low
        if not wide > 0:
            return low
        return float(
            brentq(
                lambda x: self.below(x) - share,
                low - 1e-6 * wide,
                high + 1e-6 * wide,
                xtol=1e-9 * wide,
            )
        )

    def interval(self, level: float) -> tuple[float, float]:
        """Interval with equal tails."""
        return self.quantile(0.5 - 0.5 * level), self.quantile(0.5 + 0.5 * level)

    @property
    def p(self) -> float:
        """Two-sided p value of 0: twice the smaller tail; below 5 % where 95 % exclude 0."""
        from scipy.special import ndtr

        scaled = self.mean / self.deviation
        tails = self.weight @ ndtr(scaled), self.weight @ ndtr(-scaled)
        return min(1.0, 2.0 * float(min(tails)))


@dataclass(frozen=True)
class Fits:
    """Slopes of m models y = a + b x, over nodes of tau and rho.

    Attributes:
        log_weight: logarithm of restricted likelihood times prior times step, shape (g, m).
        value, deviation: of b, shape (g, m).
        pivot: the x at which y is independent of b, shape (g, m).
        level, level_deviation: of y at the pivot, shape (g,).
        tau, rho: of the nodes, shape (g,).
    """

    log_weight: Array
    value: Array
    deviation: Array
    pivot: Array
    level: Array
    level_deviation: Array
    tau: Array
    rho: Array

    def mixture(self, model: int) -> Mixture:
        """Slope of one model."""
        return Mixture.of(self.log_weight[:, model], self.value[:, model], self.deviation[:, model])

    def line(self, x: float) -> Mixture:
        """Value a + b x of the first model, without scatter."""
        far = x - self.pivot[:, 0]
        return Mixture.of(
            self.log_weight[:, 0],
            self.level + far * self.value[:, 0],
            np.hypot(self.level_deviation, far * self.deviation[:, 0]),
        )

    def averaged(self, models: NDArray[np.intp]) -> Mixture:
        """Slope averaged over several models, indices of shape (k,), by their evidence."""
        return Mixture.of(
            self.log_weight[:, models].ravel(),
            self.value[:, models].ravel(),
            self.deviation[:, models].ravel(),
        )

    @property
    def evidence(self) -> Array:
        """Logarithm of each model's integrated likelihood, shape (m,), up to a constant."""
        top = self.log_weight.max(axis=0)
        return np.asarray(top + np.log(np.exp(self.log_weight - top).sum(axis=0)))

    @property
    def typical_deviation(self) -> Array:
        """Weighted mean deviation of each model's slope, shape (m,)."""
        weight = np.exp(self.log_weight - self.log_weight.max(axis=0))
        return np.asarray(np.sum(weight * self.deviation, axis=0) / np.sum(weight, axis=0))

    def expected(self, of: Array) -> float:
        """Mean of `tau` or `rho` under the weights of the first model."""
        return float(_weights(self.log_weight[:, 0]) @ of)


def fits(values: Array, columns: Array, own: Array) -> Fits:
    """Fit y = a + b x, separately for each of m columns x.

    Args:
        values: y, shape (n,), in the order in which neighbors may be correlated.
        columns: x, shape (n, m), none of them constant.
        own: covariance of the points' own errors, shape (n, n); zeros without own errors.

    Raises ValueError for fewer than three points, for values that are not finite or do not differ,
    and for constant columns.
    """
    n = len(values)
    if n < 3:
        raise ValueError(f"{n} points; three are the least")
    if not (np.all(np.isfinite(values)) and np.all(np.isfinite(own))):
        raise ValueError("values and their errors must be finite")
    if np.any(np.ptp(columns, axis=0) == 0):
        raise ValueError("what is regressed on does not vary")
    size = float(np.std(values))
    if not size > 1e-12 * float(np.max(np.abs(values))):
        raise ValueError("the values do not differ")
    # Scaled to the scatter and to the columns, for fixed limits of the quadrature.
    spread = np.std(columns, axis=0)
    y = (values - np.mean(values)) / size
    x = (columns - np.mean(columns, axis=0)) / spread
    scaled = own / size**2
    typical = float(np.sqrt(np.median(np.diag(scaled))))
    rotated = [_rotated(y, x, scaled, rho) for rho in _nodes()[0]]
    shares = _shares(scaled)
    taus = _range(rotated, typical, shares)
    by_rho = [
        _fit(each, taus, typical, math.log(weight), shares)
        for each, weight in zip(rotated, _nodes()[1], strict=True)
    ]
    log_weight, value, deviation, pivot, level, level_deviation = (
        np.concatenate(parts) for parts in zip(*by_rho, strict=True)
    )
    unit = size / spread
    return Fits(
        log_weight,
        value * unit,
        deviation * unit,
        pivot * spread + np.mean(columns, axis=0),
        level * size + float(np.mean(values)),
        level_deviation * size,
        np.tile(np.outer(shares[0], taus).ravel(), RHOS) * size,
        np.repeat(_nodes()[0], len(taus) * len(shares[0])),
    )


@cache
def _nodes() -> tuple[Array, Array]:
    places, weights = np.polynomial.legendre.leggauss(RHOS)
    return 0.5 * MOST_RHO * (places + 1.0), 0.5 * MOST_RHO * weights


def _shares(own: Array) -> tuple[Array, Array]:
    """Independent shares of the own errors, and logarithms of their weights.

    Only the share 1 if there are no own errors, or their covariance has off-diagonal elements.
    """
    if not own.any() or np.any(own != np.diag(np.diag(own))):
        return np.ones(1), np.zeros(1)
    return _nodes_of_shares()


@cache
def _nodes_of_shares() -> tuple[Array, Array]:
    places, weights = np.polynomial.legendre.leggauss(OWNS - 1)
    shares = LEAST_OWN ** (0.5 * (places + 1.0))
    return np.append(1.0, shares), np.log(0.5 * np.append(1.0, 0.5 * weights))


@dataclass(frozen=True)
class _Rotated:
    """Data in coordinates where both covariances are diagonal: `own` is 1, `between` is `size`."""

    y: Array
    one: Array
    x: Array
    size: Array
    logarithm: float


def _rotated(y: Array, x: Array, own: Array, rho: float) -> _Rotated:
    from scipy.linalg import eigh, solve_triangular

    n = len(y)
    known = own + FLOOR**2 * np.eye(n)
    lower = np.linalg.cholesky(known)
    steps = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    between = rho**steps
    half = solve_triangular(lower, between, lower=True)
    size, turn = eigh(solve_triangular(lower, half.T, lower=True))
    rows = turn.T @ solve_triangular(lower, np.column_stack([y, np.ones(n), x]), lower=True)
    return _Rotated(
        rows[:, 0],
        rows[:, 1],
        rows[:, 2:],
        np.maximum(size, 0.0),
        2.0 * float(np.sum(np.log(np.diag(lower)))),
    )


def _range(rotated: list[_Rotated], typical: float, shares: tuple[Array, Array]) -> Array:
    """Nodes of tau with almost all of the weight, shape (`FINE`,), even in the logarithm."""
    least = max(0.02 * typical, FLOOR)
    decades = math.log10(WIDEST / least)
    taus = np.geomspace(least, WIDEST, max(8, round(COARSE * decades)))
    best = np.full(len(taus), -np.inf)
    for each in (rotated[0], rotated[-1]):
        log_weight = _fit(each, taus, typical, 0.0, shares)[0]
        near = np.max(log_weight - log_weight.max(axis=0), axis=1)
        best = np.maximum(best, near.reshape(-1, len(taus)).max(axis=0))
    kept = np.flatnonzero(best > -NEGLIGIBLE)
    first, last = max(kept[0] - 1, 0), min(kept[-1] + 1, len(taus) - 1)
    return np.geomspace(taus[first], taus[last], FINE)


def _fit(
    at: _Rotated, taus: Array, typical: float, weight: float, shares: tuple[Array, Array]
) -> tuple[Array, ...]:
    """First fields of `Fits` for one rho: shapes (k t, m) and (k t,).

    There are t nodes of tau over the share of the own errors, and k nodes of that share. The share
    is a common factor of all deviations and needs no new calculation.
    """
    spread = 1.0 + taus[:, None] ** 2 * at.size
    w = 1.0 / spread
    ones, ones_y = w @ at.one**2, w @ (at.one * at.y)
    cross, square = w @ (at.one[:, None] * at.x), w @ at.x**2
    across = w @ (at.x * at.y[:, None])
    inner = square - cross**2 / ones[:, None]
    rest = across - cross * (ones_y / ones)[:, None]
    value = rest / inner
    constant = w @ at.y**2 - ones_y**2 / ones
    left = np.maximum(constant[:, None] - rest * value, 0.0)
    log_spread = np.sum(np.log(spread), axis=1) + at.logarithm
    prior = np.log(taus / (typical + taus))  # in the logarithm of tau
    base = (
        weight
        + prior[:, None]
        - 0.5 * (log_spread[:, None] + np.log(ones)[:, None] + np.log(inner))
    )
    share, log_share = shares
    n = len(at.y)
    log_weight = np.concatenate(
        [base + w - (n - 2) * math.log(k) - 0.5 * left / k**2
         for k, w in zip(share, log_share, strict=True)]
    )  # fmt: skip
    deviation, level_deviation = 1.0 / np.sqrt(inner), 1.0 / np.sqrt(ones)
    count = len(share)
    return (
        log_weight,
        np.tile(value, (count, 1)),
        np.concatenate([k * deviation for k in share]),
        np.tile(cross / ones[:, None], (count, 1)),
        np.tile(ones_y / ones, count),
        np.concatenate([k * level_deviation for k in share]),
    )


def _weights(logarithms: Array) -> Array:
    weight = np.exp(logarithms - np.max(logarithms))
    return np.asarray(weight / np.sum(weight))
