"""Intervals, correlations and undetermined directions of a least-squares fit.

Linearized at the optimum. Parameters are shares of their ranges (`unknowns`); the residuals are
assumed to be independent.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from campaign.arrays import Array
from campaign.estimate import Estimate, Origin
from campaign.estimation.intervals import LEVEL, NO_FREEDOM, student
from campaign.estimation.least_squares import covariance, profile_limit
from campaign.estimation.losses import Loss, weights
from campaign.estimation.unknowns import Unknown
from campaign.reason import Cause

Bound = Literal["", "lower", "upper"]
AT_BOUND = 1e-3
"""Distance from its bound, as a share of its range, within which a parameter is at the bound."""
NEGLIGIBLE = 1e-6
"""Singular values of the scaled Jacobian below this share of the largest are null."""
MOST_STEPS = 100
"""Most steps of one bounded linear fit, which needs about one for each parameter."""
METHOD = "least squares, linearised at the optimum"
INTERRUPTED = Cause("fit interrupted", "the fit was interrupted")
NO_LIMIT = Cause(
    "no limit from its bound",
    "the data give no limit between its {side} bound and the other one",
)
NOT_DETERMINED = Cause(
    "not determined within bounds", "not determined by these data within its bounds"
)


@dataclass(frozen=True)
class Uncertainty:
    """Uncertainty of parameters, in shares of their ranges; arrays of shape (k,).

    Attributes:
        half_width: of the 95 % intervals, NaN at a bound and for undetermined parameters. It takes
            parameters at a bound as fixed, and so does not include their uncertainty.
        low, high: ends of the intervals that include it: from `half_width`, shifted by the largest
            effect of parameters at a bound, up to their `limit` or their other bound.
        bound: `lower` or `upper` for a parameter that ended there.
        limit: one-sided 95 % limit of a parameter at its bound, as a share of its range; NaN for
            other parameters, and without a limit before the other bound.
        open: parameters that the data do not determine: no residual depends on them, only a
            combination with others is determined, or their interval is wider than their range.
        correlation: shape (k, k); NaN where a parameter has no interval.
        scatter: factor of the stated standard deviations, at least 1; without stated ones, the
            residuals' standard deviation.
        freedom: residuals less parameters that are not at a bound.
    """

    half_width: Array
    low: Array
    high: Array
    bound: tuple[Bound, ...]
    limit: Array
    open: tuple[bool, ...]
    correlation: Array
    scatter: float
    freedom: int

    @property
    def covariance(self) -> Array | None:
        """Covariance of the shares, shape (k, k), scaled by `scatter`; None if one is open.

        A parameter at its bound counts as fixed.
        """
        if self.freedom <= 0 or any(self.open):
            return None
        sigma = np.nan_to_num(self.half_width) / student(self.freedom)
        return np.asarray(np.nan_to_num(self.correlation) * np.outer(sigma, sigma))


def uncertainty(
    jacobian: Array, residuals: Array, shares: Array, loss: Loss, *, stated: bool = True
) -> Uncertainty:
    """Uncertainty of a fit.

    Residuals have the weight of their loss. If they are larger than the stated standard deviations,
    these are increased (by the root of chi-square over degrees of freedom), never reduced.

    Args:
        jacobian: of the residuals by the shares, shape (n, k).
        residuals: in standard deviations, shape (n,).
        shares: the optimum, shape (k,).
        loss: loss function of the fit.
        stated: false for residuals without stated deviations: their size determines the deviation.
    """
    n, k = jacobian.shape
    bound = tuple(_bound(share) for share in shares)
    free = np.array([side == "" for side in bound])
    freedom = n - int(free.sum())
    half, limit, correlation = np.full(k, np.nan), np.full(k, np.nan), np.full((k, k), np.nan)
    if freedom <= 0:
        undetermined = (False,) * k
        return Uncertainty(half, half, half, bound, limit, undetermined, correlation, 1.0, freedom)
    rho = weights(loss, residuals)
    scatter = float(np.sqrt(np.sum(rho * residuals**2) / freedom))
    scatter = max(1.0, scatter) if stated else scatter
    wide = student(freedom) * scatter
    weighted, left = np.sqrt(rho)[:, None] * jacobian, np.sqrt(rho) * residuals
    for index in np.flatnonzero(~free):
        limit[index] = _limit(weighted, left, shares, int(index), wide**2)
    unknown, down, up = np.zeros(k, dtype=bool), np.zeros(k), np.zeros(k)
    if free.any():
        inverse, unknown[free] = covariance(weighted[:, free], NEGLIGIBLE, NEGLIGIBLE)
        sigma = np.sqrt(np.diag(inverse))
        half[free] = wide * sigma
        half[unknown] = np.nan
        unknown |= 2 * np.nan_to_num(half) > 1.0
        with np.errstate(invalid="ignore", divide="ignore"):
            correlation[np.ix_(free, free)] = inverse / np.outer(sigma, sigma)
        # Shift of the free parameters when those at a bound move to their limits.
        moved = -inverse @ weighted[:, free].T @ (weighted * _reach(shares, limit))[:, ~free]
        down[free], up[free] = moved.clip(max=0).sum(axis=1), moved.clip(min=0).sum(axis=1)
    low, high = shares - half + down, shares + half + up
    opened = tuple(unknown.tolist())
    return Uncertainty(half, low, high, bound, limit, opened, correlation, scatter, freedom)


def _reach(shares: Array, limit: Array) -> Array:
    """Signed distance of parameters at a bound to their limit or other bound, shape (k,)."""
    other_bound = np.where(shares < 0.5, 1.0, 0.0)
    return np.asarray(np.where(np.isnan(limit), other_bound, limit) - shares)


def _limit(jacobian: Array, residuals: Array, shares: Array, index: int, rise: float) -> float:
    """Limit (share) of a parameter at its bound, by profile likelihood; NaN without a limit.

    At the limit the sum of squares of the linearized residuals, with the other parameters refitted
    within their bounds, has risen by `rise`: the square of the two-sided quantile. The one-sided
    quantile is not valid, because the data decide between a one-sided and a two-sided interval:
    coverage of both together would be only 92.5 % for some true values.
    """
    from scipy.optimize import lsq_linear

    others = np.arange(len(shares)) != index
    ends = -shares[others], 1.0 - shares[others]
    here = float(shares[index])
    across = 1.0 - here if here < 0.5 else -here

    def cost(distance: float) -> float:
        moved = residuals + distance * jacobian[:, index]
        if not others.any():
            return float(moved @ moved)
        anew = lsq_linear(jacobian[:, others], -moved, ends, method="bvls", max_iter=MOST_STEPS)
        return 2.0 * float(anew.cost)

    if cost(across) - cost(0.0) <= rise:
        return math.nan
    return here + profile_limit(cost, 0.0, across, rise)


def estimate_of(
    unknown: Unknown, share: float, certainty: Uncertainty | None, index: int, unit: str
) -> Estimate:
    """Estimate of one parameter with its interval, or the reason for none.

    Args:
        share: the optimum, as a share of the range.
        certainty: None after an interrupt of the fit.
        index: of the parameter in `certainty`.
        unit: of its value (SI).
    """
    name, value = unknown.name, unknown.value(share)
    if certainty is None:
        return Estimate.without_interval(name, value, unit, INTERRUPTED())
    half, limit = float(certainty.half_width[index]), float(certainty.limit[index])
    side, freedom = certainty.bound[index], certainty.freedom
    if side:
        method = f"{METHOD}; one-sided by its profile at the {side} bound, t({freedom})"
        if math.isnan(limit):
            reason = NO_LIMIT(side=side)
            origin = Origin.AT_BOUND
            return Estimate.without_interval(
                name, value, unit, reason, method=METHOD, origin=origin
            )
        ends = sorted((value, unknown.value(limit)))
        low, high = (None, ends[1]) if side == "lower" else (ends[0], None)
        return Estimate(name, value, unit, low, high, LEVEL, method, origin=Origin.AT_BOUND)
    method, at_bounds = f"{METHOD}, t({freedom})", any(certainty.bound)
    if at_bounds:
        method += "; those at a bound anywhere up to their limits"
    if certainty.open[index] or math.isnan(half):
        reason = NO_FREEDOM() if freedom <= 0 else NOT_DETERMINED()
        origin = Origin.NOT_DETERMINED
        return Estimate.without_interval(name, value, unit, reason, method=method, origin=origin)
    return Estimate(
        name,
        value,
        unit,
        unknown.value(float(certainty.low[index])),
        unknown.value(float(certainty.high[index])),
        LEVEL,
        method,
        standard_error=None if at_bounds else unknown.slope(share) * half / student(freedom),
        freedom=freedom,
    )


def strong(
    correlation: Array, names: Sequence[str], least: float = 0.9
) -> list[tuple[str, str, float]]:
    """Pairs of strongly correlated parameters with their correlation, the strongest first."""
    k = len(names)
    pairs = [
        (names[i], names[j], float(correlation[i, j]))
        for i in range(k)
        for j in range(i + 1, k)
        if abs(correlation[i, j]) >= least  # false for NaN
    ]
    return sorted(pairs, key=lambda pair: -abs(pair[2]))


def _bound(share: float) -> Bound:
    if share <= AT_BOUND:
        return "lower"
    return "upper" if share >= 1.0 - AT_BOUND else ""
