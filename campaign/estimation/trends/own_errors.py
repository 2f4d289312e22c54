"""Errors of single points with few repeats.

A deviation from three repeats has itself an error of a half. Points of one kind have similar
errors. Therefore each variance is shrunk towards the common one. The shrinkage increases with their
agreement (Smyth, Statistical Applications in Genetics and Molecular Biology 3, 2004, sections 3 and
6.2).
"""

from __future__ import annotations

import math

import numpy as np

from campaign.arrays import Array
from campaign.estimation.intervals import student

MANY = 1e4
"""Degrees of freedom that represent infinity."""


def moderated(errors: Array, freedom: Array) -> Array:
    """Moderated standard deviations of points, from standard errors.

    Args:
        errors: standard error of each point, positive, shape (n,).
        freedom: degrees of freedom of each, shape (n,); infinite for an exact error.

    Returns: shape (n,), widened as Student's t for the resulting degrees of freedom.
    """
    from scipy.special import digamma, polygamma

    few = np.minimum(np.asarray(freedom, dtype=float), MANY)
    squares = np.square(np.asarray(errors, dtype=float))
    log_mean = np.log(squares) - digamma(0.5 * few) + np.log(0.5 * few)
    centre = float(np.mean(log_mean))
    excess = float(np.var(log_mean, ddof=1)) - float(np.mean(polygamma(1, 0.5 * few)))
    prior = min(_inverse_trigamma(excess), float(np.sum(few)), MANY)
    common = math.exp(centre + float(digamma(0.5 * prior)) - math.log(0.5 * prior))
    total = prior + few
    wide = np.array([student(each) / student(math.inf) for each in total])
    return np.asarray(wide * np.sqrt((prior * common + few * squares) / total))


def _inverse_trigamma(value: float) -> float:
    """Twice the x whose trigamma is `value`; infinite if `value` is too small."""
    from scipy.optimize import brentq
    from scipy.special import polygamma

    if not value > float(polygamma(1, 0.5 * MANY)):
        return math.inf
    low, high = 1e-3, 0.5 * MANY
    if value >= float(polygamma(1, low)):
        return 2.0 * low
    return 2.0 * float(brentq(lambda x: float(polygamma(1, x)) - value, low, high))
