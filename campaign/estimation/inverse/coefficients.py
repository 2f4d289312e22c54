"""Coefficients of an inverse dynamic model as estimates."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from functools import partial

import numpy as np

from campaign.arrays import Array
from campaign.estimate import Estimate
from campaign.estimation.intervals import shifted_by, with_error
from campaign.estimation.inverse.motion import FilterSettings, Motion
from campaign.estimation.inverse.regression import Regression, regress
from campaign.estimation.inverse.rows import rows
from campaign.estimation.inverse.terms import Term
from campaign.reason import Cause

METHOD = "least squares; deviation with autocorrelation (Newey and West)"
TOO_FEW_ROWS = Cause("too few independent rows", "the residuals have too few independent rows")


def estimates(
    fit: Regression, terms: Sequence[Term], parts: Mapping[str, Array | None]
) -> dict[str, Estimate]:
    """Estimates of the coefficients by the names of the terms; scatter includes autocorrelation.

    parts: shift of the coefficients by each source of a systematic part, shape (k,); None:
        unknown.
    """
    return {
        term.name: coefficient(
            fit, index, term.name, term.unit, float(fit.values[index]), METHOD, parts
        )
        for index, term in enumerate(terms)
    }


def coefficient(
    fit: Regression,
    index: int,
    name: str,
    unit: str,
    value: float,
    method: str,
    parts: Mapping[str, Array | None],
) -> Estimate:
    """Estimate of one coefficient; parts: see `estimates`."""
    error = float(fit.robust[index])
    if fit.freedom < 1.0 or not math.isfinite(fit.quantile * error):
        return Estimate.without_interval(name, value, unit, TOO_FEW_ROWS())
    one = with_error(name, value, unit, error, fit.freedom, method, fit.quantile)
    for source, far in parts.items():
        one = shifted_by(one, source, None if far is None else float(far[index]))
    return one


def shifts(
    fit: Regression,
    motions: Sequence[Motion],
    terms: Sequence[Term],
    filterings: Sequence[FilterSettings],
    delay: float = 0.0,
) -> Array | None:
    """Largest shift of each coefficient by other filters, shape (k,); None if none has a fit.

    delay: of the force in these rows (s).
    """

    def other(filtering: FilterSettings) -> Array:
        return regress([rows(motion, terms, filtering, delay) for motion in motions]).values

    return farthest(fit.values, [partial(other, each) for each in filterings])


def farthest(values: Array, others: Iterable[Callable[[], Array]]) -> Array | None:
    """Largest distance of `others` from `values`, shape (k,), without those with a ValueError."""
    distances = []
    for other in others:
        with suppress(ValueError):
            distances.append(np.abs(other() - values))
    return np.max(distances, axis=0) if distances else None
