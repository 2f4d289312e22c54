"""Comparison of a fitted response with an independent measurement, in standard deviations."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from campaign.arrays import Array, ComplexArray
from campaign.estimation.frequency.measured_response import MeasuredResponse
from campaign.estimation.frequency.rational import SURE, Weights
from campaign.reason import NONE, Cause, Reason

NO_DEVIATION = Cause("no deviation", "too few realisations or averages for a standard deviation")


@dataclass(frozen=True)
class HeldAgainst:
    """An independent measurement of a response, with the prediction of a model, at n frequencies.

    Attributes:
        measured: the response.
        predicted: by the model, shape (n,).
        deviation: standard deviation of either part of measured less predicted, shape (n,), by
            scatter of measurement and fit; NaN where the scatter of the measurement is unknown.
        square: squared difference of all frequencies over its expectation, including their
            correlation by the fit's error; mean 1 for a correct model; NaN as `deviation`.
        most: 1 plus 3.3 standard deviations of `square`.
        reason: why `deviation` is unknown; otherwise `NONE`.
    """

    measured: MeasuredResponse
    predicted: ComplexArray
    deviation: Array
    square: float
    most: float
    reason: Reason = NONE

    @property
    def difference(self) -> ComplexArray:
        """Measured less predicted, shape (n,)."""
        return np.asarray(self.measured.values - self.predicted)

    @property
    def relative(self) -> float:
        """Root of the mean square of the difference over the measured size."""
        share = np.abs(self.difference) / np.maximum(np.abs(self.measured.values), 1e-300)
        return float(np.sqrt(np.mean(share**2)))

    @property
    def in_deviations(self) -> Array:
        """Size of the difference over its expectation, shape (n,): 1 in the mean square."""
        return np.asarray(np.abs(self.difference) / (math.sqrt(2.0) * self.deviation))

    @property
    def verdict(self) -> str:
        """Whether the model predicts the measurement, as text."""
        if self.reason:
            return f"not determined: {self.reason}"
        if self.square <= self.most:
            return "as closely as scatter allows"
        return f"with {self.square:.1f} times the square that scatter would leave"


def held_against(
    measured: MeasuredResponse, predicted: ComplexArray, jacobian: ComplexArray, covariance: Array
) -> HeldAgainst:
    """Compare a prediction and its covariance with a measured response.

    Args:
        predicted: shape (n,). jacobian: its derivative by the parameters, shape (n, p).
        covariance: of the parameters, shape (p, p).
    """
    n = len(measured.frequency)
    difference = measured.values - predicted
    try:
        weights = Weights.of(measured)
    except ValueError:
        unknown = np.full(n, math.nan)
        return HeldAgainst(measured, predicted, unknown, math.nan, math.nan, NO_DEVIATION())
    stacked = np.concatenate([jacobian.real, jacobian.imag])
    shared = stacked @ covariance @ stacked.T
    # `mean` corrects for estimated variances: the mean of their inverse is too large.
    own = np.concatenate([weights.error, weights.error]) ** 2 * weights.mean
    whole = shared + np.diag(own)
    parts = np.concatenate([difference.real, difference.imag])
    square = float(parts @ np.linalg.solve(whole, parts)) / (2 * n)
    fitted = np.diag(shared)
    deviation = np.sqrt(weights.error**2 + 0.5 * (fitted[:n] + fitted[n:]))
    most = 1.0 + SURE * math.sqrt(n * weights.spread) / weights.mean / (2 * n)
    return HeldAgainst(measured, predicted, deviation, square, most)
