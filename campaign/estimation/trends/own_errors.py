"""Errors of single points with few repeats.

A deviation from three repeats is itself known to a third only. Points of one kind are about equally
well known: each one's variance is drawn towards what all of them have in common, by as much as they
say that they have it in common (Smyth, Statistical Applications in Genetics and Molecular Biology
3, 2004, sections 3 and 6.2).
"""

from __future__ import annotations

import math

import numpy as np

from campaign.arrays import Array
from campaign.estimation.intervals import student

MANY = 1e4
"""Degrees of freedom that are as good as infinitely many."""


def moderated(errors: Array, freedom: Array) -> Array:
    """Standard deviations for points with standard errors, shape (n,) each.

    Args:
        errors: standard error of each point, positive.
        freedom: degrees of freedom of each; infinite where it is known.

    Returns: (n,), widened as Student's t is where few degrees of freedom are left after all.
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
    """Twice the x whose trigamma is `value`; infinite for none."""
    from scipy.optimize import brentq
    from scipy.special import polygamma

    if not value > float(polygamma(1, 0.5 * MANY)):
        return math.inf
    low, high = 1e-3, 0.5 * MANY
    if value >= float(polygamma(1, low)):
        return 2.0 * low
    return 2.0 * float(brentq(lambda x: float(polygamma(1, x)) - value, low, high))
