"""Intervals, correlations and undetermined directions of a least-squares fit.

Linearised at the optimum; parameters are shares of their ranges (`unknowns`), and the residuals'
deviations are taken as independent.
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
"""Share of its range within which a parameter is at its bound."""
NEGLIGIBLE = 1e-6
"""Singular values of the scaled Jacobian below this share of the largest are null."""
MOST_STEPS = 100
"""of one bounded linear fit; it needs about as many as there are parameters."""
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
    """In shares of the parameters' ranges; arrays of shape (k,).

    Attributes:
        half_width: of the 95 % intervals, NaN at a bound and where nothing can be said. It takes
            those at a bound as known there: too narrow by what they are not.
        low, high: ends of the intervals that hold whether or not others are at a bound: of
            `half_width`, moved as far as those could move them, up to their `limit`, or to their
            other bound where there is none.
        bound: `lower` or `upper` for a parameter that ended there.
        limit: of a parameter at its bound: up to which share of its range it may still be (95 %,
            one-sided); NaN for the others, and where there is no limit before the other bound.
        open: parameters that the data do not determine: no residual depends on them, they can only
            be told together with others, or their interval is wider than their range.
        correlation: shape (k, k); NaN where a parameter has no interval.
        scatter: by which the stated standard deviations were multiplied, at least 1; where none
            were stated, the residuals' standard deviation.
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
        """Of the shares, shape (k, k), scaled by `scatter`; None where one is not determined.

        A parameter at its bound counts as known there.
        """
        if self.freedom <= 0 or any(self.open):
            return None
        sigma = np.nan_to_num(self.half_width) / student(self.freedom)
        return np.asarray(np.nan_to_num(self.correlation) * np.outer(sigma, sigma))


def uncertainty(
    jacobian: Array, residuals: Array, shares: Array, loss: Loss, *, stated: bool = True
) -> Uncertainty:
    """The uncertainty of a fit.

    Residuals count with the weight their loss gave them. When they are larger than the standard
    deviations that were stated, these are widened to fit (by the root of chi-square over degrees
    of freedom); they are never narrowed.

    Args:
        jacobian: of the residuals by the shares, shape (n, k).
        residuals: in standard deviations, shape (n,).
        shares: the optimum, shape (k,).
        loss: that the fit made smallest.
        stated: false where residuals are not in stated deviations: their own size is all there is.
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
        # What the others do when those at a bound go as far as they may.
        moved = -inverse @ weighted[:, free].T @ (weighted * _reach(shares, limit))[:, ~free]
        down[free], up[free] = moved.clip(max=0).sum(axis=1), moved.clip(min=0).sum(axis=1)
    low, high = shares - half + down, shares + half + up
    opened = tuple(unknown.tolist())
    return Uncertainty(half, low, high, bound, limit, opened, correlation, scatter, freedom)


def _reach(shares: Array, limit: Array) -> Array:
    """How far each may be from its bound, with its sign, shape (k,); of those at a bound."""
    other_bound = np.where(shares < 0.5, 1.0, 0.0)
    return np.asarray(np.where(np.isnan(limit), other_bound, limit) - shares)


def _limit(jacobian: Array, residuals: Array, shares: Array, index: int, rise: float) -> float:
    """Share up to which a parameter at its bound may be, by profile likelihood; NaN without end.

    There the sum of squares of the linearised residuals, the others fitted anew between their
    bounds, has risen by `rise`: the square of the two-sided quantile. The one-sided one is for
    those who always ask for one side. Here the data choose between one side and two, and both kinds
    of intervals together would hold some truths in 92.5 of 100 repetitions only.
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
    """One parameter with its interval, or why it has none.

    Args:
        share: the optimum, as a share of the range.
        certainty: None where the fit was interrupted.
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
    """Pairs of parameters that the data can hardly tell apart, the strongest first."""
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
