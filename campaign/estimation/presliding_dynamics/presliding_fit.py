"""Estimates of an axis from records below breakaway, or the reason for none."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from campaign.estimate import Estimate, Origin
from campaign.estimation.gate import admitted
from campaign.estimation.intervals import (
    LEVEL,
    MODEL_MISFIT,
    SPANS_DECADES,
    WIDEST,
    shifted_by,
    student,
    with_error,
)
from campaign.estimation.presliding_dynamics.fit import fit_presliding_dynamics, whitened
from campaign.estimation.presliding_dynamics.fit_result import JointFit
from campaign.estimation.presliding_dynamics.parameters import LOGARITHMIC
from campaign.estimation.presliding_dynamics.record import Assumptions, Record
from campaign.estimation.presliding_dynamics.shape import SURELY, Misfit, misfit_of
from campaign.estimation.presliding_dynamics.uncertainty import (
    CURVED,
    Spread,
    profile_end,
    spread_of,
)
from campaign.reason import NONE, Cause, Reason

METHOD = "joint output-error fit below breakaway"
UNITS = {
    "bristle_stiffness": "N m/rad",
    "damping": "N m s/rad",
    "inertia": "kg m^2",
    "yielding": "1/(N m)",
    "viscous_friction": "N m s/rad",
    "rate_delay": "s",
    "angle_delay": "s",
    "appendage_frequency": "Hz",
    "appendage_inertia": "kg m^2",
    "appendage_damping_ratio": "",
}
POSITIVE = ("damping", "viscous_friction", "appendage_damping_ratio")
UNSCALED = ("rate_delay", "angle_delay", "yielding")
"""Parameters to which a model error does not add a part proportional to their size."""
PROFILED = ("bristle_stiffness", "damping", "inertia")
"""Parameters whose wide intervals end at limits of the profile."""
SLIPPING = 0.95
"""Bristle torque over the fitted slip torque above which a load breaks away."""
NO_MINIMUM = Cause("no minimum", "the search did not end in a minimum")
BREAKS_AWAY = Cause(
    "breakaway in a record",
    "the load breaks away in {records}: leave that out, or ask for less torque",
)
FLAT_PROFILE = Cause(
    "flat profile", "its profile never rises: the records say nothing of it on one side"
)
TOO_LITTLE = Cause("too little of it", "the records have it {where}: they show too little of it")


@dataclass(frozen=True)
class PreslidingDynamics:
    """Result of a joint fit below breakaway.

    Attributes:
        estimates: by name, all free parameters of `UNITS`, where `damping` is the sum of sigma1
            and sigma2; also the derived `bristle_damping` sigma1 (N m s/rad), `damping_ratio` of
            the sum, and `natural_frequency` (Hz).
        fit, spread, misfit: basis of the estimates.
        reason: common reason for no interval; `NONE`: each estimate has its own.
    """

    estimates: dict[str, Estimate]
    fit: JointFit
    spread: Spread
    misfit: Misfit
    reason: Reason


def identify_presliding_dynamics(
    records: Sequence[Record], assumed: Assumptions | None = None
) -> PreslidingDynamics:
    """Stiffness and damping of the bristles and inertia from all records at once.

    An estimate is *not determined* if its interval is wide, or the parameter is at its bound. No
    estimate has an interval if one inertia on one bristle does not describe the records, a load
    breaks away, or the search found no minimum. Raises ValueError, with the reason, for no fit.
    """
    plain = fit_presliding_dynamics(records, assumed)
    fit = whitened(plain)
    misfit = misfit_of(plain, fit)
    spread = spread_of(fit)
    reason = _reason(fit, misfit)
    every = enumerate(fit.parameters.names)
    if reason:
        estimates = {name: _without(fit, index, reason) for index, name in every}
    else:
        estimates = {name: _estimate(fit, spread, misfit, index) for index, name in every}
        estimates |= _derived(fit, spread, misfit)
    return PreslidingDynamics(estimates, fit, spread, misfit, reason)


def _reason(fit: JointFit, misfit: Misfit) -> Reason:
    if not fit.reached:
        return NO_MINIMUM()
    slipping = [
        record.named
        for number, record in enumerate(fit.records)
        if fit.largest_yielding(number) > SLIPPING
    ]
    if slipping:
        return BREAKS_AWAY(records=", ".join(slipping))
    return MODEL_MISFIT(why=misfit.reason) if misfit.reason else NONE


def _without(fit: JointFit, index: int, reason: Reason) -> Estimate:
    name = fit.parameters.names[index]
    value, _ = fit.parameters.in_units(name, float(fit.vector[index]))
    return Estimate.without_interval(name, value, UNITS[name], reason, method=METHOD)


def _estimate(fit: JointFit, spread: Spread, misfit: Misfit, index: int) -> Estimate:
    """Estimate of one shared parameter; its limits are those of the profile if that is curved."""
    name, entry = fit.parameters.names[index], float(fit.vector[index])
    value, scale = fit.parameters.in_units(name, entry)
    freedom, deviation = float(spread.freedom[index]), float(spread.deviation[index])
    quantile = student(freedom)
    if name in LOGARITHMIC and quantile * deviation > WIDEST:
        return replace(_without(fit, index, SPANS_DECADES()), origin=Origin.NOT_DETERMINED)
    ends = [entry + sign * quantile * deviation for sign in (-1.0, 1.0)]
    size = 1.0 if name in LOGARITHMIC else abs(entry)
    if name in PROFILED and CURVED * size < deviation < size:
        try:
            ends = [profile_end(fit, spread, index, quantile, sign) for sign in (-1.0, 1.0)]
        except ValueError:
            return replace(_without(fit, index, FLAT_PROFILE()), origin=Origin.NOT_DETERMINED)
    low, high = (fit.parameters.in_units(name, end)[0] for end in ends)
    estimate = Estimate(
        name,
        value,
        UNITS[name],
        low,
        high,
        LEVEL,
        METHOD,
        standard_error=deviation * scale,
        freedom=freedom if math.isfinite(freedom) else None,
    )
    estimate = _missed(_shifted(estimate, float(misfit.shift[index]) * scale), misfit)
    if name in POSITIVE and low <= 0.0:
        where = "at or below nothing" if value <= 0.0 else "an interval that holds nothing"
        reason = TOO_LITTLE(where=where)
        origin = Origin.AT_BOUND if value <= 0.0 else Origin.NOT_DETERMINED
        return replace(estimate, origin=origin, reason=reason)
    return estimate if name.endswith("delay") or name == "yielding" else admitted(estimate)


def _shifted(estimate: Estimate, shift: float) -> Estimate:
    """Add a rectangular part whose half-width is the shift by other shapes (GUM 4.3.7)."""
    if not shift:
        return estimate
    return shifted_by(estimate, "shape of the bristles' curve", abs(shift) / math.sqrt(3.0))


def _missed(estimate: Estimate, misfit: Misfit) -> Estimate:
    """Add a part for a significant model error that is too small for a misfit.

    A relative error of the response may cause the same relative error of a parameter.
    """
    share = misfit.band_share
    if misfit.band_chance >= SURELY or not share or estimate.name in UNSCALED:
        return estimate
    return shifted_by(estimate, "what the model misses", share * abs(estimate.value))


def _derived(fit: JointFit, spread: Spread, misfit: Misfit) -> dict[str, Estimate]:
    """Bristle damping, damping ratio and natural frequency of the load, by the delta method."""
    plant, names = fit.plant, fit.parameters.names
    scale, ratio = fit.parameters.damping_scale, 0.5 / math.sqrt(plant.stiffness * plant.inertia)
    own, natural = plant.bristles[0].damping, plant.natural_frequency
    whole = own + plant.viscous
    # The vector contains the logarithms of stiffness and inertia.
    half = -0.5 * whole * ratio
    by_ratio = {"bristle_stiffness": half, "inertia": half, "damping": ratio * scale}
    by_natural = {"bristle_stiffness": 0.5 * natural, "inertia": -0.5 * natural}
    rows = (
        ("bristle_damping", own, "N m s/rad", {"damping": scale, "viscous_friction": -scale}),
        ("damping_ratio", whole * ratio, "", by_ratio),
        ("natural_frequency", natural, "Hz", by_natural),
    )
    derived = {}
    for name, value, unit, slopes in rows:
        of = np.array([slopes.get(each, 0.0) for each in names])
        error = float(np.sqrt(of @ spread.covariance @ of))
        freedom = float(np.min(spread.freedom[of != 0.0], initial=np.inf))
        estimate = with_error(name, value, unit, error, freedom, METHOD)
        derived[name] = admitted(_missed(_shifted(estimate, float(of @ misfit.shift)), misfit))
    return derived
