"""Intervals of means: over repeats, and over one autocorrelated recording.

All are Student's t intervals. They do not include errors common to all repetitions, such as that of
the torque constant: these are the systematic part of an estimate.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from campaign.arrays import Array
from campaign.estimate import Estimate, Origin, Systematic
from campaign.reason import Cause

LEVEL = 0.95
"""Default confidence of intervals."""
BATCHES = 10
"""Batches of a recording: enough for a deviation, and so few that neighbors are almost uncorrelated
(AR(1) with 0.8 over 400 samples: 94 % coverage; with 20 batches 91 %)."""
TORQUE_CONSTANT = "torque constant"
"""Source of the systematic part that is common to all numbers in N m of a drive."""
NO_FREEDOM = Cause("no degrees of freedom", "nothing is left over to judge its scatter by")
SINGLE_VALUE = Cause("single value", "a single {what}: {others} would show how it scatters")
TOO_FEW_SAMPLES = Cause("too few samples", "{samples} samples are too few for {batches} batches")
NO_STANDARD_ERROR = Cause("no standard error", "one of {whom} has no standard error")
NOT_POSITIVE = Cause("not positive", "a ratio of numbers that are not positive")
MODEL_MISFIT = Cause("model misfit", "misfit: {why}")
TOO_FEW_POSITIVE = Cause("too few positive values", "it takes two positive values or more")
WIDEST = 0.5 * math.log(1e3)
"""Largest half-width of an interval in the logarithm: a factor of a thousand from end to end."""
LARGEST = 700.0
"""Largest absolute logarithm for which the exponential and multiples of it are finite."""
SPANS_DECADES = Cause("spans decades", "its interval spans more than a factor of a thousand")


def student(freedom: float, level: float = LEVEL) -> float:
    """Quantile of Student's t for a two-sided interval; of the normal for infinite freedom."""
    from scipy.special import ndtri, stdtrit

    share = 0.5 + 0.5 * level
    return float(ndtri(share) if math.isinf(freedom) else stdtrit(freedom, share))


def with_error(
    name: str,
    value: float,
    unit: str,
    error: float,
    freedom: float,
    method: str,
    quantile: float | None = None,
    **more: Any,
) -> Estimate:
    """Estimate from its standard error and the degrees of freedom of that error.

    Without an interval, with the reason, for no degrees of freedom or numbers that are not finite.
    quantile: half-width over standard error; default: Student's t.
    """
    if not freedom > 0 or not math.isfinite(error) or not math.isfinite(value):
        return Estimate.without_interval(name, value, unit, NO_FREEDOM(), method=method, **more)
    half = (student(freedom) if quantile is None else quantile) * error
    return Estimate(
        name,
        value,
        unit,
        value - half,
        value + half,
        LEVEL,
        method,
        standard_error=error,
        freedom=freedom if math.isfinite(freedom) else None,
        **more,
    )


def of_repeats(
    name: str, values: Sequence[float] | Array, unit: str, what: str = "repeats", **more: Any
) -> Estimate:
    """Mean of independent values, such as repeated trials, shape (n,); t with n - 1."""
    repeats = np.asarray(values, dtype=float)
    mean = float(np.mean(repeats))
    if len(repeats) < 2:
        return Estimate.without_interval(
            name, mean, unit, SINGLE_VALUE(what="value", others=what), **more
        )
    error = float(np.std(repeats, ddof=1)) / math.sqrt(len(repeats))
    method = f"mean of {len(repeats)} {what}, Student's t"
    return with_error(name, mean, unit, error, len(repeats) - 1, method, **more)


def of_positive_repeats(
    name: str, values: Sequence[float] | Array, unit: str, what: str = "repeats", **more: Any
) -> Estimate:
    """Geometric mean of independent positive values, shape (n,); t in the logarithm.

    For quantities with a scatter proportional to their size: the interval never includes zero.
    Raises ValueError for values that are not positive.
    """
    positive = np.asarray(values, dtype=float)
    if not np.all(positive > 0):
        raise ValueError(f"{name}: values must be positive")
    inner = of_repeats(name, np.log(positive), "", what, **more)
    return exponential(inner, unit)


def of_next(name: str, values: Sequence[float] | Array, unit: str) -> Estimate:
    """Prediction interval of one further positive value, t in the logarithm.

    It includes the scatter of a single trial: it is wider than the interval of the mean by
    sqrt(n + 1). The value is the geometric mean of `values`, shape (n,). No interval for fewer than
    two values, or where a value is not positive.
    """
    trials = np.asarray(values, dtype=float)
    if len(trials) < 2 or not np.all(trials > 0):
        mean = float(np.mean(trials)) if len(trials) else math.nan
        return Estimate.without_interval(name, mean, unit, TOO_FEW_POSITIVE())
    logs, freedom = np.log(trials), len(trials) - 1
    error = float(np.std(logs, ddof=1)) * math.sqrt(1.0 + 1.0 / len(trials))
    method = f"where one more trial will lie, from {len(trials)}; Student's t in the logarithm"
    mean = float(np.mean(logs))
    return exponential(with_error(name, mean, "", error, freedom, method, kind="quantile"), unit)


def exponential(logarithm: Estimate, unit: str) -> Estimate:
    """Estimate of x from an estimate of ln x; its standard error by the delta method.

    *Not determined*, and without an interval, where that spans decades or x overflows.
    """
    beyond = abs(logarithm.value) > LARGEST
    value = math.nan if beyond else math.exp(logarithm.value)
    ends = (end for end in (logarithm.low, logarithm.high) if end is not None)
    if beyond or any(abs(end - logarithm.value) > WIDEST for end in ends):
        return replace(
            logarithm, value=value, unit=unit, low=None, high=None, level=None, standard_error=None,
            freedom=None, origin=Origin.NOT_DETERMINED, reason=SPANS_DECADES(),
        )  # fmt: skip
    error = logarithm.standard_error
    return replace(
        logarithm,
        value=value,
        unit=unit,
        low=None if logarithm.low is None else math.exp(logarithm.low),
        high=None if logarithm.high is None else math.exp(logarithm.high),
        standard_error=None if error is None else value * error,
    )


def of_series(name: str, samples: Array, unit: str, **more: Any) -> Estimate:
    """Mean of an autocorrelated series of shape (n,) by batch means: t with `BATCHES` - 1.

    Valid for correlations shorter than a batch; slower effects need a model. Source: Schmeiser,
    "Batch size effects in the analysis of simulation output", Oper. Res. 30 (1982).
    """
    if len(samples) < 2 * BATCHES:
        mean = float(np.mean(samples)) if len(samples) else math.nan
        reason = TOO_FEW_SAMPLES(samples=len(samples), batches=BATCHES)
        return Estimate.without_interval(name, mean, unit, reason, **more)
    used = len(samples) // BATCHES * BATCHES
    means = samples[:used].reshape(BATCHES, -1).mean(axis=1)
    error = float(np.std(means, ddof=1)) / math.sqrt(BATCHES)
    method = f"mean, deviation from {BATCHES} batches"
    return with_error(name, float(np.mean(samples)), unit, error, BATCHES - 1, method, **more)


def difference(name: str, one: Estimate, other: Estimate, unit: str, **more: Any) -> Estimate:
    """Difference `one` - `other` of independent estimates; freedom by Welch and Satterthwaite."""
    value = one.value - other.value
    errors = (one.standard_error, other.standard_error)
    if errors[0] is None or errors[1] is None:
        reason = one.reason or other.reason or NO_STANDARD_ERROR(whom="the two")
        return Estimate.without_interval(name, value, unit, reason, **more)
    error = math.hypot(errors[0], errors[1])
    freedom = welch((errors[0], one.freedom), (errors[1], other.freedom))
    return with_error(name, value, unit, error, freedom, "difference, Welch", **more)


def ratio(name: str, one: Estimate, other: Estimate, unit: str = "", **more: Any) -> Estimate:
    """Quotient `one` / `other` of independent positive estimates, in the logarithm (Welch)."""
    if not (one.value > 0 and other.value > 0):
        return Estimate.without_interval(name, math.nan, unit, NOT_POSITIVE(), **more)
    value = one.value / other.value
    if one.standard_error is None or other.standard_error is None:
        reason = one.reason or other.reason or NO_STANDARD_ERROR(whom="the two")
        return Estimate.without_interval(name, value, unit, reason, **more)
    errors = (one.standard_error / one.value, other.standard_error / other.value)
    freedom = welch((errors[0], one.freedom), (errors[1], other.freedom))
    error = math.hypot(*errors)
    logarithm = with_error(name, math.log(value), "", error, freedom, "ratio, Welch", **more)
    return exponential(logarithm, unit)


def multiplied(estimate: Estimate, factor: float) -> Estimate:
    """Estimate times an exact factor, with its interval; name and unit stay."""

    def times(value: float | None, by: float = abs(factor)) -> float | None:
        return None if value is None else value * by

    ends = times(estimate.low, factor), times(estimate.high, factor)
    low, high = ends if factor > 0 else ends[::-1]
    parts = tuple(
        replace(each, standard_uncertainty=times(each.standard_uncertainty))
        for each in estimate.systematic
    )
    error = times(estimate.standard_error)
    value = estimate.value * factor
    return replace(
        estimate, value=value, low=low, high=high, standard_error=error, systematic=parts
    )


def moved_by(estimate: Estimate, change: float) -> Estimate:
    """Estimate plus a known change, with its interval; its unit stays."""
    low, high = (None if end is None else end + change for end in (estimate.low, estimate.high))
    return replace(estimate, value=estimate.value + change, low=low, high=high)


def welch(*parts: tuple[float, float | None]) -> float:
    """Degrees of freedom of a sum of independent errors, each (standard error, freedom).

    A freedom of None is infinite. Welch and Satterthwaite; GUM G.4.1.
    """
    total = sum(error**2 for error, _ in parts)
    own = sum(error**4 / freedom for error, freedom in parts if freedom is not None)
    return total**2 / own if own > 0 else math.inf


def shifted_by(
    estimate: Estimate, source: str, standard_uncertainty: float | None, *, of_rig: bool = False
) -> Estimate:
    """Estimate with an additional systematic part (1 sigma in its unit; None: unknown)."""
    part = Systematic(source, standard_uncertainty, of_rig)
    return replace(estimate, systematic=(*estimate.systematic, part))
