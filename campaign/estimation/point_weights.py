"""Weights of the points of a curve: window scatter and scatter between points."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from campaign.arrays import Array
from campaign.estimation.intervals import BATCHES
from campaign.estimation.stribeck import StribeckFit, fit_stribeck

Counts = NDArray[np.signedinteger[Any]]
LEAST = 1e-10
"""relative deviation of a torque that is never undercut: exact data stay finite."""
FEWEST_TO_SMOOTH = 6
"""windows from which on the deviation of one is told better by all of them."""
ROUNDS = 20
"""of fit and deviation in turn, at most; usually five."""
SETTLED = 1e-3
"""relative change of the deviation between points below which the rounds end."""
LIKELIER = 4.0
"""Difference of twice the log-likelihoods from which on points tell which friction scatters."""
LEAST_DRY = 0.1
"""Smallest part of a torque that scatters: beyond it, weights would rest on one fast point."""


@dataclass(frozen=True)
class Scatter:
    """How points of a map deviate from its curve beyond what their windows show.

    Attributes:
        relative: deviation (1 sigma) of the part of friction that scatters.
        steady_viscous: viscous friction that does not scatter (N m s/rad); 0: all friction does.
    """

    relative: float
    steady_viscous: float

    def part(self, speed: Array | float, torque: Array | float) -> Array:
        """The part of friction torques (N m) that scatters, shape of `torque`."""
        return np.asarray(np.maximum(torque - self.steady_viscous * speed, LEAST_DRY * torque))

    def deviation(self, speed: Array | float, torque: Array | float) -> Array:
        """From point to point (N m, 1 sigma), shape of `torque`."""
        return self.relative * self.part(speed, torque)


def fit_with_scatter(
    speed: Array, torque: Array, window: Array
) -> tuple[tuple[Scatter, ...], StribeckFit]:
    """How points of a direction scatter, and the fit with delta free, which depend on each other.

    All friction scatters, or its dry part, whichever is likelier. Where neither clearly is, a point
    deviates by the larger of the two: with weights of the wrong one, vs and Ts held in 92 of 100
    maps. Arguments as those of `fit_direction`, shape (n,).
    """
    (whole, fit), (dry, other) = (
        _fit_with(speed, torque, window, dry=dry) for dry in (False, True)
    )
    rise = _unlikely(fit) - _unlikely(other)
    if abs(rise) > LIKELIER:
        return ((dry,), other) if rise > 0 else ((whole,), fit)
    deviation = np.maximum(fit.deviation, other.deviation)
    return (whole, dry), fit_stribeck(speed, torque, deviation, start=fit.values)


def _unlikely(found: StribeckFit) -> float:
    """-2 times the logarithm of the likelihood of the residuals, less a constant."""
    return found.chi_square + 2.0 * float(np.sum(np.log(found.deviation)))


def _fit_with(
    speed: Array, torque: Array, window: Array, *, dry: bool
) -> tuple[Scatter, StribeckFit]:
    """As `fit_with_scatter`, for friction that scatters as a whole, or in its dry part alone.

    Where windows alone explain more than there is (in a closed loop they do), a common factor makes
    chi-square equal to its degrees of freedom on that side, too.
    """
    scatter = Scatter(1e-3, 0.0)

    def deviation() -> Array:
        between = scatter.deviation(speed, torque)
        return np.asarray(np.sqrt(window**2 + between**2 + (LEAST * torque) ** 2))

    found = fit_stribeck(speed, torque, deviation())
    for _ in range(ROUNDS):
        freedom, before = len(speed) - len(found.free), scatter.relative
        scatter = Scatter(before, found.values["viscous_friction"] if dry else 0.0)
        part = scatter.part(speed, torque)
        relative = between_deviation(found.residuals / part, window / part, freedom)
        scatter = replace(scatter, relative=relative)
        found = fit_stribeck(speed, torque, deviation(), start=found.values)
        if abs(relative - before) <= SETTLED * before:
            break
    if scatter.relative > 0:
        return scatter, found
    factor = math.sqrt(found.chi_square / (len(speed) - len(found.free)))
    return scatter, replace(found, deviation=np.maximum(factor * found.deviation, LEAST * torque))


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


def smoothed_deviation(deviation: Array, place: Array) -> Array:
    """Deviations of windows, each estimated from `BATCHES` means, told better by all together.

    Each has an error of its own of 1 / sqrt(2 (BATCHES - 1)), a quarter, and weights that follow it
    cost coverage. Their logarithms are drawn towards a parabola over `place`, by as much as their
    scatter about it is explained by that error alone (Smyth, "Linear models and empirical Bayes
    methods", Stat. Appl. Genet. Mol. Biol. 3 (2004), section 6.2).

    deviation, place: shape (n,). What is not positive is unknown, and stays.
    """
    from scipy.special import polygamma, psi

    known = deviation > 0
    if int(known.sum()) < FEWEST_TO_SMOOTH:
        return deviation
    half = 0.5 * (BATCHES - 1)
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
