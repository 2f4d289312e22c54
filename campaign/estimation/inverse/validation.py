"""Prediction error of a model on unseen motion, and comparison of two models."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from campaign.arrays import Array
from campaign.estimate import Estimate
from campaign.estimation.intervals import LEVEL
from campaign.estimation.inverse.regression import effective_count
from campaign.reason import Cause

REPEATS, SEED = 2000, 1
"""Number of resamplings, and seed."""
FEWEST_BLOCKS = 8
"""Fewest blocks of correlated rows for a bootstrap."""
TOO_FEW_BLOCKS = Cause(
    "too few independent blocks", "only {blocks} parts of the motion are uncorrelated"
)


@dataclass(frozen=True)
class Prediction:
    """Rows of a motion with the prediction of a model, shape (n,); forces in one unit."""

    time: Array
    force: Array
    predicted: Array

    @property
    def residuals(self) -> Array:
        """Force less prediction."""
        return self.force - self.predicted

    @property
    def relative(self) -> float:
        """Norm of the residuals over norm of the force."""
        return float(np.linalg.norm(self.residuals) / np.linalg.norm(self.force))


def relative_error(name: str, prediction: Prediction) -> Estimate:
    """Relative residual, with an interval over blocks of the motion."""
    return _by_blocks(name, (prediction,))


def improvement(name: str, one: Prediction, other: Prediction) -> Estimate:
    """Decrease of the relative residual from `one` to `other`, on the same rows."""
    return _by_blocks(name, (one, other))


def _by_blocks(name: str, sides: tuple[Prediction, ...]) -> Estimate:
    """Bootstrap of circular blocks, longer than the correlation (Politis and Romano, 1992)."""
    squares = [side.residuals**2 for side in sides]
    norm = sides[0].force ** 2
    count = len(norm)

    def value(rows: NDArray[np.int64]) -> Array:
        shares = [np.sqrt(each[rows].sum(-1) / norm[rows].sum(-1)) for each in squares]
        return np.asarray(shares[0] if len(shares) == 1 else shares[0] - shares[1])

    point = float(value(np.arange(count)))
    correlated = count / min(effective_count((each - each.mean(),)) for each in squares)
    length = max(1, math.ceil(max(2.0 * correlated, count ** (1.0 / 3.0))))
    blocks = count // length
    method = f"{REPEATS} resamplings of {blocks} blocks of {length} rows"
    if blocks < FEWEST_BLOCKS:
        reason = TOO_FEW_BLOCKS(blocks=blocks)
        return Estimate.without_interval(name, point, "", reason, method=method)
    random = np.random.Generator(np.random.PCG64(SEED))
    starts = random.integers(0, count, (REPEATS, blocks, 1))
    rows = (starts + np.arange(length)).reshape(REPEATS, -1) % count
    low, high = np.quantile(value(rows), (0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL))
    low, high = min(float(low), point), max(float(high), point)
    return Estimate(name, point, "", low, high, LEVEL, method)
