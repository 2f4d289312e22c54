"""Linear regression with autocorrelated residuals over several recordings.

Ordinary deviations of an inverse dynamic model are 4 to 5 times too small, because its residuals
are not white noise. This module uses the covariance of `long_run`. Quantiles depend on the
bandwidth (Kiefer and Vogelsang, Econom. Theory 21, 2005, Table 1), because with a long bandwidth
the coverage of Student's t is too low.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from campaign.arrays import Array
from campaign.estimation.gate import MATTERS
from campaign.estimation.intervals import student
from campaign.estimation.long_run import bandwidths, long_run, safe_deviations, scaled_to

COLLINEAR = 1e10
"""Condition number of the scaled columns above which some are dependent."""
KIEFER = (1.0, 1.51500, 0.21224, -0.27163)
"""Factor of a normal quantile: polynomial in bandwidth over samples (Bartlett, 97.5 %)."""


@dataclass(frozen=True)
class Piece:
    """Evenly spaced rows: columns (n, k), right side (n,), times (s), (n,)."""

    columns: Array
    force: Array
    time: Array


@dataclass(frozen=True)
class Deviations:
    """Standard deviations of the coefficients, shape (k,), for one bandwidth (lags)."""

    lags: float
    values: Array


@dataclass(frozen=True)
class Regression:
    """A fitted linear model.

    Attributes:
        values: coefficients, shape (k,).
        ordinary: deviations for independent residuals, shape (k,).
        robust: deviations with autocorrelation, shape (k,): at the rule's bandwidth, or the
            largest at half, one and two times it if they differ (`long_run.safe_deviations`).
        by_bandwidth: deviations at half, one and two times the rule's bandwidth.
        covariance: robust, shape (k, k), scaled so that its diagonal is `robust` squared.
        freedom: effective number of rows less coefficients.
        effective: effective number of rows.
        residuals: of each piece, shape (n,); zero in omitted rows.
        count: number of rows that are not omitted.
        relative: norm of the residuals over norm of the force.
        condition: condition number of the unscaled columns.
        likeness: condition number of columns of unit length, independent of units.
        matters: size of each coefficient below which its force is negligible, shape (k,).
    """

    values: Array
    ordinary: Array
    robust: Array
    by_bandwidth: tuple[Deviations, ...]
    covariance: Array
    freedom: float
    effective: float
    residuals: tuple[Array, ...]
    count: int
    relative: float
    condition: float
    likeness: float
    matters: Array

    @property
    def correlation(self) -> Array:
        """Correlation of the coefficients, shape (k, k)."""
        return np.asarray(self.covariance / np.outer(self.robust, self.robust))

    @property
    def quantile(self) -> float:
        """Half-width of a 95 % interval over the deviation: Student's t for the bandwidth."""
        share = min(1.0, max(each.lags for each in self.by_bandwidth) / self.count)
        grown: float = sum(c * share**i for i, c in enumerate(KIEFER))
        return float(student(max(self.freedom, 1.0)) * grown)


def regress(pieces: Sequence[Piece]) -> Regression:
    """Least-squares regression of the force on the columns, all pieces together.

    Raises ValueError for too few rows, or dependent columns.
    """
    design, force = stacked(pieces)
    return fitted(pieces, np.asarray(np.linalg.pinv(_checked(design))), design, force)


def stacked(pieces: Sequence[Piece]) -> tuple[Array, Array]:
    """All columns (n, k) and the whole right side (n,)."""
    return (
        np.concatenate([piece.columns for piece in pieces]),
        np.concatenate([piece.force for piece in pieces]),
    )


def fitted(pieces: Sequence[Piece], inverse: Array, design: Array, force: Array) -> Regression:
    """Regression with the coefficients `inverse` (k, n) times the force (n,).

    Least squares and instruments differ only in `inverse`.
    """
    k = design.shape[1]
    n = int(np.count_nonzero(np.any(design != 0.0, axis=1)))  # rows of zeros are omitted
    values = inverse @ force
    cuts = np.cumsum([len(piece.force) for piece in pieces])[:-1]
    residuals = tuple(np.split(force - design @ values, cuts))
    whole = np.concatenate(residuals)
    variance = float(whole @ whole) / (n - k)
    ordinary = np.sqrt(variance * np.sum(inverse**2, axis=1))
    # Contribution of each row to each coefficient's error; pieces are uncorrelated.
    scores = [s * e[:, None] for s, e in zip(np.split(inverse.T, cuts), residuals, strict=True)]
    scores = [s * math.sqrt(n / (n - k)) for s in scores]
    tried = bandwidths(scores)
    covariances = [long_run(scores, each) for each in tried]
    widths = np.sqrt([np.diag(each) for each in covariances])
    robust = safe_deviations(widths)
    effective = effective_count(residuals) * n / len(force)
    return Regression(
        values=values,
        ordinary=ordinary,
        robust=robust,
        by_bandwidth=tuple(Deviations(lag, sd) for lag, sd in zip(tried, widths, strict=True)),
        covariance=scaled_to(covariances[1], robust),
        freedom=effective - k,
        effective=effective,
        residuals=residuals,
        count=n,
        relative=float(np.linalg.norm(whole) / np.linalg.norm(force)),
        condition=float(np.linalg.cond(design)),
        likeness=float(np.linalg.cond(design / np.linalg.norm(design, axis=0))),
        matters=MATTERS * float(np.abs(force).max()) / np.abs(design).max(axis=0),
    )


def effective_count(residuals: Sequence[Array]) -> float:
    """Effective sample size of the residuals, from pairs of lags before the first negative pair.

    Source: Geyer, Stat. Sci. 7 (1992), initial positive sequence.
    """
    count = sum(len(each) for each in residuals)
    square = sum(float(each @ each) for each in residuals)
    if square == 0.0:
        return float(count)
    longest = max(len(each) for each in residuals)

    def correlation(lag: int) -> float:
        own = (float(e[lag:] @ e[: len(e) - lag]) for e in residuals if len(e) > lag)
        total: float = sum(own)
        return total / square

    time, lag = 1.0, 1
    while lag + 1 < longest:
        pair = correlation(lag) + correlation(lag + 1)
        if pair <= 0.0:
            break
        time, lag = time + 2.0 * pair, lag + 2
    return count / max(time, 1.0)


def _checked(design: Array) -> Array:
    k = design.shape[1]
    n = int(np.count_nonzero(np.any(design != 0.0, axis=1)))
    if n <= 2 * k:
        raise ValueError(f"{n} rows are too few for {k} columns")
    length = np.linalg.norm(design, axis=0)
    if not np.all(length > 0):
        nothing = ", ".join(str(i + 1) for i in np.flatnonzero(length == 0))
        raise ValueError(f"column {nothing} is zero throughout")
    if np.linalg.cond(design / length) > COLLINEAR:
        raise ValueError("some columns are not distinguishable")
    return design
