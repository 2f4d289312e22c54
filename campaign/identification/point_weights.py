"""How much each point of a curve counts: deviations of windows, and what lies between points."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from campaign.identification.intervals import BATCHES
from campaign.identification.least_squares import Array

Counts = NDArray[np.signedinteger[Any]]
LEAST = 1e-10
"""relative deviation of a torque that is never undercut: exact data stay finite."""
FEWEST_TO_SMOOTH = 6
"""windows from which on the deviation of one is told better by all of them."""


def between_deviation(residuals: Array, window: Array, freedom: float) -> float:
    """The common deviation beside `window` for which chi-square equals its degrees of freedom.

    Sum of residual² / (window² + between²) = freedom; 0 where windows alone explain the residuals.
    All in one unit, or relative; arrays (n,). Paule and Mandel (1982).
    """
    from scipy.optimize import brentq

    def excess(logarithm: float) -> float:
        square = math.exp(2.0 * logarithm)
        return float(np.sum(residuals**2 / (window**2 + square))) - freedom

    smallest = math.log(LEAST)
    highest = 0.5 * math.log(max(float(np.sum(residuals**2)) / freedom, 1e-300)) + 1e-3
    if highest <= smallest or excess(smallest) <= 0.0:
        return 0.0
    return math.exp(float(brentq(excess, smallest, highest, xtol=1e-6)))


def smoothed_deviation(deviation: Array, place: Array, freedom: float = BATCHES - 1) -> Array:
    """Deviations of windows that were each estimated with `freedom`, told better by all together.

    Each has an error of its own of 1 / sqrt(2 freedom), a quarter with ten batches, and weights
    that follow it cost coverage. Their logarithms are drawn towards a parabola over `place`, by as
    much as their scatter about it is explained by that error alone (Smyth, "Linear models and
    empirical Bayes methods", Stat. Appl. Genet. Mol. Biol. 3 (2004), section 6.2).

    deviation, place: shape (n,). What is not positive is unknown, and stays.
    """
    from scipy.special import polygamma, psi

    known = deviation > 0
    if int(known.sum()) < FEWEST_TO_SMOOTH:
        return deviation
    half = 0.5 * freedom
    logarithm = 2.0 * np.log(deviation[known]) - (float(psi(half)) - math.log(half))
    design = np.vander((place[known] - place[known].mean()) / (np.ptp(place[known]) or 1.0), 3)
    trend = design @ np.linalg.lstsq(design, logarithm, rcond=None)[0]
    about = logarithm - trend
    own = float(polygamma(1, half))
    beyond = max(float(about @ about) / (len(about) - design.shape[1]) - own, 0.0)
    smooth = deviation.copy()
    smooth[known] = np.exp(0.5 * (trend + beyond / (beyond + own) * about))
    return smooth


def lack_of_fit(
    torque: Array, level: Array, part: Array, member: Counts, residuals: Array, freedom: float
) -> float | None:
    """p-value of the residuals of means against the scatter of repeats (F test), if there are any.

    Args:
        torque: of each point (N m), shape (m,).
        level, residuals: mean torque of each place, and how far the curve is from it, shape (n,).
        part: of each mean, what scatters and repeats differ in proportion to (N m), shape (n,).
        member: to which place each point belongs, shape (m,).
        freedom: places beyond the parameters of the curve.
    """
    from scipy.special import fdtrc

    repeats = len(torque) - len(level)
    if repeats == 0:
        return None
    pure = float(np.sum(((torque - level[member]) / part[member]) ** 2)) / repeats
    count = np.bincount(member)
    lacking = float(np.sum(count * (residuals / part) ** 2)) / freedom
    return float(fdtrc(freedom, repeats, lacking / pure)) if pure > 0 else None
