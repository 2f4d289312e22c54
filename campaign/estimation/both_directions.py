"""Mean of both directions of a velocity map measured in the same trials."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from campaign.arrays import Array
from campaign.estimate import Estimate, Origin
from campaign.estimation.gate import refused
from campaign.estimation.intervals import shifted_by, with_error
from campaign.estimation.stribeck import PARAMETERS
from campaign.estimation.velocity_map import FORM, DirectionFit, Model, fitted_estimates, is_bent
from campaign.reason import Cause

TOGETHER = "mean of both directions, their errors taken for the same"
ONE_DIRECTION = Cause("one direction", "one direction is {origin}")


def fitted_nominal(
    positive: DirectionFit, negative: DirectionFit, model: Model
) -> dict[str, Estimate]:
    """Mean of both directions, by name, as fitted; their errors are correlated.

    Both points of one speed are from the same trial. The residuals determine the correlation; it
    was 0.73 to 0.99 where friction scatters from trial to trial.
    """
    one, other = fitted_estimates(positive, model), fitted_estimates(negative, model)
    return {name: _mean(positive, negative, model, one[name], other[name]) for name in one}


def _mean(
    positive: DirectionFit, negative: DirectionFit, model: Model, one: Estimate, other: Estimate
) -> Estimate:
    name, unit, value = one.name, one.unit, 0.5 * (one.value + other.value)
    for each in (one, other):
        if not each.has_interval or each.origin is Origin.AT_BOUND:
            if each.origin is Origin.GIVEN:
                return each
            reason = each.reason or ONE_DIRECTION(origin=each.origin)
            return refused(Estimate(name, value, unit), reason)
    if is_bent(positive, model, name) or is_bent(negative, model, name):
        ends = np.array([[one.low, one.high], [other.low, other.high]], dtype=float)
        low, high = np.mean(ends, axis=0).tolist()
        mean = replace(one, value=value, low=low, high=high, method=TOGETHER, systematic=())
    else:
        mean = _by_covariance(positive, negative, model, one, other)
    parts = (positive.form_part(model, name), negative.form_part(model, name))
    return shifted_by(mean, FORM, 0.5 * sum(parts)) if any(parts) else mean


def _by_covariance(
    positive: DirectionFit, negative: DirectionFit, model: Model, one: Estimate, other: Estimate
) -> Estimate:
    name, value = one.name, 0.5 * (one.value + other.value)
    fits = positive.fits[model], negative.fits[model]
    cross = cross_covariance(positive, negative, model)
    i, j = fits[0].free.index(name), fits[1].free.index(name)
    variance = 0.25 * (
        fits[0].covariance[i, i] + fits[1].covariance[j, j] + 2.0 * float(cross[i, j])
    )
    freedom = min(positive.freedom, negative.freedom)
    method = f"mean of both directions, with the covariance of their points, t({freedom})"
    error = math.sqrt(max(float(variance), 0.0))
    reason = one.reason or other.reason
    return with_error(name, value, one.unit, error, freedom, method, reason=reason)


def correlation(positive: DirectionFit, negative: DirectionFit) -> float:
    """Correlation of the residuals of both directions, with delta free, over their deviations.

    From the common speeds; 1, the conservative value, where these are too few.
    """
    shared = _shared(positive, negative)
    if shared is None:
        return 1.0
    one, other = (
        (fit.fits["free"].residuals / fit.deviation)[own]
        for fit, own in zip((positive, negative), shared, strict=True)
    )
    size = math.sqrt(float(np.sum(one**2)) * float(np.sum(other**2)))
    return float(np.sum(one * other)) / size if size > 0 else 1.0


def cross_covariance(positive: DirectionFit, negative: DirectionFit, model: Model) -> Array:
    """Covariance of the free parameters of both directions, shape (k, l).

    Points of different speeds are from different trials, and have no covariance.
    """
    one, other = positive.fits[model], negative.fits[model]
    together = correlation(positive, negative)
    shared = _shared(positive, negative)
    if shared is None:
        size = np.sqrt(np.outer(np.diag(one.covariance), np.diag(other.covariance)))
        return np.asarray(together * size)
    first, second = (
        (fit.influence * fit.deviation)[:, own]
        for fit, own in zip((one, other), shared, strict=True)
    )
    return np.asarray(together * first @ second.T)


def _shared(
    positive: DirectionFit, negative: DirectionFit
) -> tuple[NDArray[np.intp], NDArray[np.intp]] | None:
    """Indices of the points of both directions at common speeds, shape (m,); None: too few."""
    speeds, first, second = np.intersect1d(positive.place, negative.place, return_indices=True)
    return (first, second) if len(speeds) > len(PARAMETERS) else None
