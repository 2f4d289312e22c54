"""Two inertias on a spring, from the responses of torque to rate at the motor, the load, or both.

    J1 w1' = T - b1 w1 - kg x1 - tau,    J2 w2' = tau - b2 w2,    tau = k (x1 - x2) + d (w1 - w2)

with the torque at the motor. A sensor at the motor shows the antiresonance sqrt(k / J2) and the
resonance sqrt(k (1/J1 + 1/J2)): with a torque in N m they determine J1, J2, k and d. A sensor at
the load shows no antiresonance: it determines only the resonance, its damping and J1 + J2, which
infinitely many J1, J2 and k have in common.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from campaign.arrays import Array
from campaign.estimate import Origin
from campaign.estimation.frequency.drive import PARTS, UNITS, TwoMass, correlations_of
from campaign.estimation.frequency.measured_response import MeasuredResponse
from campaign.estimation.frequency.modes import of_fit
from campaign.estimation.frequency.one_inertia import load_side_fit, rigid_fit
from campaign.estimation.frequency.rational import Weights, condition_of, judged_fit
from campaign.estimation.frequency.two_mass_model import (
    Side,
    mode_damping,
    model,
    model_jacobian,
    sizes,
    starts,
)
from campaign.estimation.intervals import TORQUE_CONSTANT, shifted_by
from campaign.estimation.least_squares import Minimum, covariance, gradients, minimum, propagated
from campaign.reason import Cause

ROUGH = 10
"""Steps after which most starts are discarded."""
KEPT = 3
"""Number of starts that are followed to the end."""
LARGEST = 50.0
"""Bound of the absolute logarithm of an inertia or a stiffness (SI), beyond that of any drive."""
WIDEST_RATIO = 8.0
"""Bound of the absolute logarithm of J2 / J1."""
METHOD = "Two inertias on a spring with viscous friction, least squares weighted by scatter"
OPEN_COMBINATION = Cause(
    "combination left open",
    "the data leave a combination of the inertias and the stiffness open",
)


def two_mass(
    responses: Mapping[Side, MeasuredResponse],
    torque_uncertainty: float | None = None,
    rigid: bool | None = None,
) -> TwoMass:
    """Drive with the best fit of its responses, with or without a spring from motor to ground.

    Args:
        responses: from torque at the motor (N m) to rate (rad/s), by the place of the rate sensor.
        torque_uncertainty: relative standard uncertainty of the torque (torque constant), a
            systematic part of all values in N m.
        rigid: whether the drive is one inertia; None: the response of a single sensor decides.

    A fit with residuals above scatter is a *misfit*: its values have no intervals.
    Raises ValueError for variances that cannot weight a fit, or too few frequencies.
    """
    if not responses:
        raise ValueError("no response of a motor or a load")
    if set(responses) == {"load"}:
        drive = _or_rigid(load_side_fit(responses["load"]), responses, rigid)
        return _with_torque(drive, torque_uncertainty)
    free = two_mass_fit(responses, False)
    held = two_mass_fit(responses, True)
    best = held if held.criterion < free.criterion - 6.0 else free
    if best.misfit and not held.misfit:
        best = held
    return _with_torque(_or_rigid(best, responses, rigid), torque_uncertainty)


def _or_rigid(
    found: TwoMass, responses: Mapping[Side, MeasuredResponse], rigid: bool | None
) -> TwoMass:
    """Replace the fit by one inertia, if that describes the response of a single sensor better.

    By Schwarz' criterion, or for no resonance in band. `rigid` also accepts a misfit.
    """
    if len(responses) > 1 or rigid is False:
        return found
    ((side, measured),) = responses.items()
    one = rigid_fit(measured, side)
    resonance = found.estimates["resonance"]
    visible = resonance.origin is Origin.MEASURED and resonance.has_interval
    visible = visible and measured.frequency[0] <= resonance.value <= measured.frequency[-1]
    better = not visible or one.criterion < found.criterion
    return one if rigid or (better and not one.misfit) else found


def two_mass_fit(responses: Mapping[Side, MeasuredResponse], grounded: bool) -> TwoMass:
    """Fit one of the two structures, with a torque without uncertainty; else as `two_mass`."""
    sides: tuple[Side, ...] = tuple(sorted(responses, reverse=True))  # motor before load
    weights = [Weights.of(responses[side]) for side in sides]
    size = sizes(responses, sides)
    fixed = [] if grounded else [6]
    count = 7 + len(sides) - len(fixed)
    if sum(2 * len(each.frequency) for each in responses.values()) < count + 8:
        raise ValueError("too few frequencies for a two-mass drive")

    def function(scaled: Array) -> tuple[Array, Array]:
        point, left, by = scaled * size, [], []
        for k, (side, weight) in enumerate(zip(sides, weights, strict=True)):
            measured, error = responses[side], weight.error * math.sqrt(weight.mean)
            values = model(measured.frequency, point, side, float(point[7 + k]))
            left.append((values - measured.values) / error)
            change = model_jacobian(measured.frequency, point, sides, side)
            by.append(change * size / error[:, None])
        all_left, all_by = np.concatenate(left), np.concatenate(by)
        all_by[:, fixed] = 0.0
        return (
            np.concatenate([all_left.real, all_left.imag]),
            np.concatenate([all_by.real, all_by.imag]),
        )

    low, high = np.full(len(size), -np.inf), np.full(len(size), np.inf)
    low[1], high[1] = -WIDEST_RATIO, WIDEST_RATIO
    low[[0, 2]], high[[0, 2]] = -LARGEST, LARGEST
    low[fixed] = high[fixed] = 0.0
    with np.errstate(all="ignore"):
        rough = [
            minimum(function, start / size, low, high, steps=ROUGH)
            for start in starts(responses, sides)
        ]
        rough.sort(key=_cost)
        fits = [minimum(function, each.point, low, high, steps=60) for each in rough[:KEPT]]
    best = min(fits, key=_cost)
    free = np.setdiff1d(np.arange(len(size)), fixed)
    inner, open_ = covariance(best.jacobian[:, free])
    spread = np.zeros((len(size), len(size)))
    inflation = max(weight.inflation / weight.mean for weight in weights)
    # Both sensors have the same torque noise and leakage.
    inflation *= len(sides)
    spread[np.ix_(free, free)] = inner * np.outer(size[free], size[free]) * inflation
    point = best.point * size
    n = len(best.residuals) // 2
    left = best.residuals[:n] + 1j * best.residuals[n:]
    excess, misfit = judged_fit(left, len(free), weights[0])
    if not misfit and np.any(open_[:3]):
        misfit = OPEN_COMBINATION()
    spread *= max(excess, 1.0)
    by = gradients(_numbers, point, np.maximum(1e-4 * np.abs(point), 1e-9))
    rows = zip(UNITS.items(), _numbers(point), propagated(by, spread), strict=True)
    estimates = {
        name: of_fit(name, float(value), unit, float(error), misfit, METHOD)
        for (name, unit), value, error in rows
    }
    return TwoMass(
        estimates,
        misfit=misfit,
        excess=excess,
        criterion=best.cost + len(free) * math.log(2 * n),
        sides=sides,
        point=point,
        grounded=grounded,
        covariance=spread,
        correlations={} if misfit else correlations_of(list(UNITS), by, spread),
        condition=condition_of(best.jacobian[:, free]),
    )


def _cost(found: Minimum) -> float:
    return found.cost if math.isfinite(found.cost) else math.inf


def _numbers(point: Array) -> Array:
    """Quantities of `UNITS` at a point, shape (10,)."""
    first, ratio, spring = np.exp(point[:3])
    second, damping = first * ratio, point[3]
    resonance = math.sqrt(spring * (1.0 / first + 1.0 / second)) / (2.0 * math.pi)
    antiresonance = math.sqrt(spring / second) / (2.0 * math.pi)
    share = 0.5 * damping / math.sqrt(spring * second)
    return np.array(
        [first, second, first + second, spring, damping, resonance, mode_damping(point),
         antiresonance, share, ratio]
    )  # fmt: skip


def _with_torque(found: TwoMass, uncertainty: float | None) -> TwoMass:
    """Add the relative uncertainty of the torque as a systematic part of all values in N m."""
    if uncertainty is None:
        return found
    changed = {
        name: shifted_by(each, TORQUE_CONSTANT, abs(each.value) * uncertainty)
        for name, each in found.estimates.items()
        if name in (*PARTS, "total_inertia") and each.has_interval
    }
    return replace(found, estimates={**found.estimates, **changed})
