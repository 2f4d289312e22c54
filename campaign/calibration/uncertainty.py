"""How well the cells determine the parameters: intervals, correlations, what stays open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from campaign.calibration.loss import weights
from campaign.identification.intervals import student
from campaign.identification.least_squares import covariance

Array = NDArray[np.float64]
AT_BOUND = 1e-3
"""Share of its range within which a parameter is at its bound."""
NEGLIGIBLE = 1e-6
"""Singular values of the scaled Jacobian below this share of the largest are null."""


@dataclass(frozen=True)
class Uncertainty:
    """In shares of the parameters' ranges; arrays of shape (n,).

    Attributes:
        half_width: of the 95 % intervals; NaN at a bound and where nothing can be said.
        bound: `lower` or `upper` for a parameter that ended there.
        open: parameters that the cells do not determine: no cell depends on them, they can only
            be told together with others, or their interval is wider than their range.
        correlation: shape (n, n); NaN where a parameter has no interval.
        scatter: by which the stated standard deviations were multiplied, at least 1.
    """

    half_width: Array
    bound: tuple[Literal["", "lower", "upper"], ...]
    open: tuple[bool, ...]
    correlation: Array
    scatter: float


def uncertainty(jacobian: Array, residuals: Array, shares: Array, loss: str) -> Uncertainty:
    """Linearised at the optimum; the cells' deviations are taken as independent.

    Cells count with the weight their loss gave them. When they deviate by more than the standard
    deviations that were stated, these are widened to fit (by the root of chi-square over degrees
    of freedom); they are never narrowed.

    Args:
        jacobian: of the residuals by the shares, shape (cells, n).
        residuals: in standard deviations, shape (cells,).
        shares: the optimum, shape (n,).
        loss: as in the protocol.
    """
    cells, n = jacobian.shape
    bound = tuple(_bound(share) for share in shares)
    free = np.array([side == "" for side in bound])
    freedom = cells - int(free.sum())
    nothing = np.full(n, np.nan)
    rho = weights(loss, residuals)
    if freedom <= 0 or not free.any():
        return Uncertainty(nothing, bound, (False,) * n, np.full((n, n), np.nan), 1.0)
    scatter = max(1.0, float(np.sqrt(np.sum(rho * residuals**2) / freedom)))
    weighted = np.sqrt(rho)[:, None] * jacobian[:, free]
    inverse, undetermined = covariance(weighted, NEGLIGIBLE, NEGLIGIBLE)
    half = nothing.copy()
    half[free] = student(freedom) * scatter * np.sqrt(np.diag(inverse))
    unknown = np.zeros(n, dtype=bool)
    unknown[free] = undetermined
    half[unknown] = np.nan
    unknown |= 2 * np.nan_to_num(half) > 1.0
    correlation = np.full((n, n), np.nan)
    sigma = np.sqrt(np.diag(inverse))
    known = np.flatnonzero(free)
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation[np.ix_(known, known)] = inverse / np.outer(sigma, sigma)
    return Uncertainty(half, bound, tuple(bool(u) for u in unknown), correlation, scatter)


def strong(
    correlation: Array, names: Sequence[str], least: float = 0.9
) -> list[tuple[str, str, float]]:
    """Pairs of parameters that the cells can hardly tell apart, the strongest first."""
    n = len(names)
    pairs = [
        (names[i], names[j], float(correlation[i, j]))
        for i in range(n)
        for j in range(i + 1, n)
        if abs(correlation[i, j]) >= least  # false for NaN
    ]
    return sorted(pairs, key=lambda pair: -abs(pair[2]))


def _bound(share: float) -> Literal["", "lower", "upper"]:
    if share <= AT_BOUND:
        return "lower"
    return "upper" if share >= 1.0 - AT_BOUND else ""
