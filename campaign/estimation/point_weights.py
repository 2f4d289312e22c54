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
"""Least relative deviation of a torque, so that weights of exact data stay finite."""
FEWEST_TO_SMOOTH = 6
"""Fewest windows for a smoothing of their deviations."""
ROUNDS = 20
"""Most iterations of fit and deviation; usually five."""
SETTLED = 1e-3
"""Relative change of the deviation between points below which the iteration ends."""
LIKELIER = 4.0
"""Difference of twice the log-likelihoods that decides which part of friction scatters."""
LEAST_DRY = 0.1
"""Smallest share of a torque that scatters: below it, weights would depend on one fast point."""


@dataclass(frozen=True)
class Scatter:
    """Scatter between points of a map, beyond the errors of their windows.

    Attributes:
        relative: relative deviation (1 sigma) of the part of friction that scatters.
        steady_viscous: viscous friction that does not scatter (N m s/rad); 0: all friction does.
    """

    relative: float
    steady_viscous: float

    def part(self, speed: Array | float, torque: Array | float) -> Array:
        """Part of friction torques (N m) that scatters, shape of `torque`."""
        return np.asarray(np.maximum(torque - self.steady_viscous * speed, LEAST_DRY * torque))

    def deviation(self, speed: Array | float, torque: Array | float) -> Array:
        """Deviation between points (N m, 1 sigma), shape of `torque`."""
        return self.relative * self.part(speed, torque)


def fit_with_scatter(
    speed: Array, torque: Array, window: Array
) -> tuple[tuple[Scatter, ...], StribeckFit]:
    """Scatter of the points of a direction and fit with free delta, which depend on each other.

    The more likely hypothesis applies: scatter of all friction or of its dry part. If neither is
    clearly more likely, a point has the larger deviation of both: coverage of vs and Ts with the
    wrong one is 92 %. Arguments as those of `fit_direction`, shape (n,).
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
    """As `fit_with_scatter`, for scatter of all friction, or of its dry part alone.

    Where windows alone overestimate the residuals (as in a closed loop), a common factor makes
    chi-square equal to its degrees of freedom.
    """
    scatter = Scatter(1e-3, 0.0)

    def deviation() -> Array:
        between = scatter.deviation(speed, torque)
        return np.asarray(np.sqrt(window**2 + between**2 + (LEAST * torque) ** 2))

    curve = fit_stribeck(speed, torque, deviation())
    for _ in range(ROUNDS):
        freedom, before = len(speed) - len(curve.free), scatter.relative
        scatter = Scatter(before, curve.values["viscous_friction"] if dry else 0.0)
        part = scatter.part(speed, torque)
        relative = between_deviation(curve.residuals / part, window / part, freedom)
        scatter = replace(scatter, relative=relative)
        curve = fit_stribeck(speed, torque, deviation(), start=curve.values)
        if abs(relative - before) <= SETTLED * before:
            break
    if scatter.relative > 0:
        return scatter, curve
    factor = math.sqrt(curve.chi_square / (len(speed) - len(curve.free)))
    return scatter, replace(curve, deviation=np.maximum(factor * curve.deviation, LEAST * torque))


def between_deviation(residuals: Array, window: Array, freedom: float) -> float:
    """Common deviation in addition to `window` for which chi-square equals its degrees of freedom.

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
    """Smoothed deviations of windows, each estimated from `BATCHES` means.

    Each has a relative error of 1 / sqrt(2 (BATCHES - 1)), a quarter; weights with this error
    reduce coverage. The logarithms are shrunk towards a parabola over `place`, by the share of
    their scatter that this error explains (Smyth, "Linear models and empirical Bayes methods",
    Stat. Appl. Genet. Mol. Biol. 3 (2004), section 6.2).

    deviation, place: shape (n,). Values that are not positive are unknown and stay unchanged.
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
    """F test of the residuals of means against the scatter of repeats: p value; None without any.

    Args:
        torque: of each point (N m), shape (m,).
        level, residuals: mean torque of each place, and its distance from the curve, shape (n,).
        part: part of each mean to which the scatter of repeats is proportional (N m), shape (n,).
        member: index of the place of each point, shape (m,).
        freedom: number of places less the parameters of the curve.
    """
    from scipy.special import fdtrc

    repeats = len(torque) - len(level)
    if repeats == 0:
        return None
    pure = float(np.sum(((torque - level[member]) / part[member]) ** 2)) / repeats
    count = np.bincount(member)
    lacking = float(np.sum(count * (residuals / part) ** 2)) / freedom
    return float(fdtrc(freedom, repeats, lacking / pure)) if pure > 0 else None
