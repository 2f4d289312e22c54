"""Exact responses with noise of a known size, as measurements of few realisations."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import chi2, f

from campaign.arrays import Array
from campaign.estimate import Estimate
from campaign.estimation.frequency.measured_response import MeasuredResponse


def noisy(
    frequency: Array, truth: Array, sigma: Array | float, random: np.random.Generator, of: int = 7
) -> MeasuredResponse:
    """The mean of `of` realisations, sigma the deviation of either part of that mean."""
    n = len(frequency)
    parts = random.standard_normal((2, of, n)) * sigma * np.sqrt(of)
    errors = parts[0] + 1j * parts[1]
    variance = np.var(errors, axis=0, ddof=1) / of
    freedom = np.full(n, 2.0 * (of - 1))
    ones = np.ones(n)
    return MeasuredResponse(
        frequency, truth + errors.mean(axis=0), variance, freedom, ones, 0.0 * ones
    )


def scatter_as_told(told: Sequence[Estimate]) -> float:
    """Deviation of the values of repeated measurements over the standard error they tell."""
    values = [each.value for each in told]
    errors = [each.standard_error for each in told]
    assert all(error is not None for error in errors)
    return float(
        np.std(values, ddof=1) / np.sqrt(np.mean(np.square(np.array(errors, dtype=float))))
    )


def radius(measured: MeasuredResponse) -> Array:
    """Of the disc around each value that holds the true one in 95 %, shape (n,).

    |error|² / variance follows F(2, freedom); Bendat and Piersol, "Random Data" (2010), 9.2. The
    bias adds in squares.
    """
    known = np.isinf(measured.freedom)
    few = f.ppf(0.95, 2, np.where(known, 2.0, measured.freedom))
    ratio = np.where(known, 0.5 * chi2.ppf(0.95, 2), few)
    return np.asarray(np.hypot(np.sqrt(ratio * measured.variance), 1.96 * measured.bias))
