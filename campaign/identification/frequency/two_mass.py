"""Two inertias on a spring, from the responses of torque to rate at the motor, the load, or both.

    J1 w1' = T - b1 w1 - kg x1 - tau,    J2 w2' = tau - b2 w2,    tau = k (x1 - x2) + d (w1 - w2)

with the torque at the motor. What a sensor's place tells: at the motor the antiresonance
sqrt(k / J2) and the resonance sqrt(k (1/J1 + 1/J2)), and so with a torque in N m all of J1, J2, k
and d. At the load the antiresonance is not there: only the resonance, its damping and J1 + J2 are
told, and infinitely many J1, J2 and k have the same three.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from campaign.estimate import Estimate, Systematic
from campaign.identification.frequency.measured import MeasuredResponse
from campaign.identification.frequency.modes import of_fit
from campaign.identification.frequency.rational import (
    RationalFit,
    Weights,
    judged_fit,
    rational_fit,
)
from campaign.identification.frequency.two_mass_model import (
    Side,
    mode_damping,
    model,
    sizes,
    starts,
)
from campaign.identification.frequency_response import Array, ComplexArray
from campaign.identification.least_squares import Minimum, covariance, minimum

PARTS = ("motor_inertia", "load_inertia", "stiffness", "damping")
HIDDEN_BY_PLACE = {
    **dict(zip(PARTS, ("kg m^2", "kg m^2", "N m/rad", "N m s/rad"), strict=True)),
    "antiresonance": "Hz",
    "antiresonance_damping": "",
    "inertia_ratio": "",
}
"""What a sensor at the load alone cannot tell, with units."""
STEP = 1e-6
ROUGH = 10
"""Steps after which most starts are given up ..."""
KEPT = 3
"""... and how many are followed to the end."""
LARGEST = 50.0
"""Logarithm of an inertia or a stiffness (SI), either way, that no drive has."""
WIDEST_RATIO = 8.0
"""Largest logarithm of J2 / J1, either way."""
METHOD = "Two inertias on a spring with viscous friction, least squares weighted by scatter"
HIDDEN = (
    "a sensor at the load shows no antiresonance: any J1, J2 and k with the same resonance and the "
    "same sum of inertias answer alike; measure the motor's rate too"
)
NO_SCALE = "the input is not a torque in N m, so that only frequencies and ratios are known"


@dataclass(frozen=True)
class TwoMass:
    """What the responses tell of a two-mass drive; what they do not is *not determined*.

    Attributes:
        motor_inertia, load_inertia, total_inertia: (kg m^2).
        stiffness: (N m/rad). damping: (N m s/rad).
        resonance_damping: damping ratio of the resonance.
        resonance, antiresonance: undamped, sqrt(k (1/J1 + 1/J2)) and sqrt(k / J2) over 2 pi (Hz).
        antiresonance_damping: d / (2 sqrt(k J2)).
        inertia_ratio: J2 / J1.
        misfit: why such a drive is no model of the responses; empty where it may be one.
        excess: weighted square over what a right model leaves in the mean.
        criterion: Schwarz' (BIC).
        sides: that were measured.
        point: parameters of `model` and a delay for each side, shape (p,).
        function: what was fitted instead, to a load alone.
        grounded: whether a spring holds the motor, as friction does before it slides.
    """

    motor_inertia: Estimate
    load_inertia: Estimate
    total_inertia: Estimate
    stiffness: Estimate
    damping: Estimate
    resonance: Estimate
    resonance_damping: Estimate
    antiresonance: Estimate
    antiresonance_damping: Estimate
    inertia_ratio: Estimate
    misfit: str
    excess: float
    criterion: float
    sides: tuple[Side, ...]
    point: Array
    grounded: bool
    function: RationalFit | None = None

    def value(self, frequency: Array, side: Side) -> ComplexArray:
        """The fitted response at `frequency` (Hz), shape (n,)."""
        if self.function is not None:
            return self.function.value(frequency)
        delays = self.point[7:]
        delay = float(delays[self.sides.index(side)]) if side in self.sides else 0.0
        return model(np.asarray(frequency, dtype=float), self.point, side, delay)


def two_mass(
    responses: Mapping[Side, MeasuredResponse],
    torque_known: bool = True,
    torque_uncertainty: float | None = None,
) -> TwoMass:
    """The drive whose responses fit best, with or without a spring that holds the motor.

    Args:
        responses: of torque at the motor (N m) to rate (rad/s), by where the rate was measured.
        torque_known: whether the input is a torque in N m; else only frequencies and the ratio of
            inertias are told.
        torque_uncertainty: relative standard uncertainty of the torque (torque constant), a
            systematic part of all that is in N m.

    A fit that leaves more than scatter is *misfit*: values without intervals.
    Raises ValueError for variances that are no weights, or too few frequencies.
    """
    if not responses:
        raise ValueError("no response of a motor or a load")
    if set(responses) == {"load"}:
        found = load_side_fit(responses["load"])
        return _told(found, torque_known, torque_uncertainty)
    free = two_mass_fit(responses, False)
    held = two_mass_fit(responses, True)
    best = held if held.criterion < free.criterion - 6.0 else free
    if best.misfit and not held.misfit:
        best = held
    return _told(best, torque_known, torque_uncertainty)


def two_mass_fit(responses: Mapping[Side, MeasuredResponse], grounded: bool) -> TwoMass:
    """As `two_mass`, of one of the two structures, with a torque that is known."""
    sides: tuple[Side, ...] = tuple(sorted(responses, reverse=True))  # motor before load
    weights = [Weights.of(responses[side]) for side in sides]
    size = sizes(responses, sides)
    fixed = [] if grounded else [6]
    count = 7 + len(sides) - len(fixed)
    if sum(2 * len(each.frequency) for each in responses.values()) < count + 8:
        raise ValueError("too few frequencies for a two-mass drive")

    def residuals(scaled: Array) -> ComplexArray:
        point = scaled * size
        parts = []
        for k, (side, weight) in enumerate(zip(sides, weights, strict=True)):
            measured = responses[side]
            found = model(measured.frequency, point, side, float(point[7 + k]))
            parts.append((found - measured.values) / weight.error / math.sqrt(weight.mean))
        return np.concatenate(parts)

    def function(scaled: Array) -> tuple[Array, Array]:
        left = residuals(scaled)
        columns = []
        for k in range(len(scaled)):
            if k in fixed:
                columns.append(np.zeros(2 * len(left)))
                continue
            apart = np.zeros(len(scaled))
            apart[k] = STEP
            change = (residuals(scaled + apart) - residuals(scaled - apart)) / (2.0 * STEP)
            columns.append(np.concatenate([change.real, change.imag]))
        return np.concatenate([left.real, left.imag]), np.column_stack(columns)

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
    # Noise of the torque and leakage are the same ones in what both sensors show.
    inflation *= len(sides)
    spread[np.ix_(free, free)] = inner * np.outer(size[free], size[free]) * inflation
    point = best.point * size
    n = len(best.residuals) // 2
    left = best.residuals[:n] + 1j * best.residuals[n:]
    excess, misfit = judged_fit(left, len(free), weights[0])
    if not misfit and np.any(open_[:3]):
        misfit = "the data leave a combination of the inertias and the stiffness open"
    criterion = best.cost + len(free) * math.log(2 * n)
    return _estimates(point, spread * max(excess, 1.0), sides, misfit, excess, criterion, grounded)


def _cost(found: Minimum) -> float:
    return found.cost if math.isfinite(found.cost) else math.inf


def load_side_fit(measured: MeasuredResponse) -> TwoMass:
    """What a rate at the load tells: by a function of third order with one zero and a delay.

    With friction at one of the inertias it is (d s + k) / (J1 J2 s³ + ... + b k), of which the sum
    of the inertias and sqrt(k (1/J1 + 1/J2)) follow, and neither J1, J2 nor k.
    """
    fit = rational_fit(measured, (1, 3))
    if fit.zeros[0].real > 0:
        # A zero with as much delay less answers nearly alike, but no spring has negative damping.
        mirrored = np.array([fit.numerator[0], -fit.numerator[1]])
        later = fit.delay + 2.0 / float(fit.zeros[0].real)
        fit = rational_fit(
            measured, (1, 3), start=np.concatenate([mirrored, fit.denominator, [later]])
        )
    unit = 2.0 * math.pi * fit.scale

    def told(theta: Array) -> Array:
        b, a = theta[:2], theta[2:6]
        total = a[1] / b[0] - a[0] * b[1] / b[0] ** 2
        rise = math.sqrt(abs(b[0] / a[3] * total)) * unit
        roots = np.polynomial.polynomial.polyroots(a)
        root = max(roots, key=abs)
        return np.array([total / unit, rise / (2.0 * math.pi), -root.real / abs(root)])

    theta = np.concatenate([fit.numerator, fit.denominator, [fit.delay]])
    found = told(theta)
    steps = np.diag(np.maximum(1e-5 * np.abs(theta), 1e-12))
    by = np.array([(told(theta + h) - told(theta - h)) / (2.0 * np.sum(h)) for h in steps])
    error = np.sqrt(np.maximum(np.einsum("pi,pq,qi->i", by, fit.scatter, by), 0.0))
    method = "function of third order with a delay, friction taken to be at one of the inertias"
    misfit = fit.misfit
    if not misfit and (found[0] <= 0 or not fit.lowest <= found[1] <= fit.highest):
        misfit = "no resonance of two inertias lies in the band"
    names = (("total_inertia", "kg m^2"), ("resonance", "Hz"), ("resonance_damping", ""))
    estimates = {
        name: of_fit(name, float(value), of, float(by_fit), misfit, method)
        for (name, of), value, by_fit in zip(names, found, error, strict=True)
    }
    for name, of in HIDDEN_BY_PLACE.items():
        estimates[name] = Estimate.without_interval(name, math.nan, of, HIDDEN)
    return TwoMass(
        **estimates,
        misfit=misfit,
        excess=fit.excess,
        criterion=fit.criterion,
        sides=("load",),
        point=theta,
        grounded=False,
        function=fit,
    )


def _estimates(
    point: Array,
    spread: Array,
    sides: tuple[Side, ...],
    misfit: str,
    excess: float,
    criterion: float,
    grounded: bool,
) -> TwoMass:
    first, ratio, spring = (float(each) for each in np.exp(point[:3]))
    unit = np.eye(len(point))
    second = first * ratio
    total = first + second
    rise = math.sqrt(spring * (1.0 / first + 1.0 / second)) / (2.0 * math.pi)
    dip = math.sqrt(spring / second) / (2.0 * math.pi)
    # d log of each by (log J1, log J2 / J1, log k).
    share = second / total
    of_second, of_total = unit[0] + unit[1], unit[0] + share * unit[1]
    by_rise = 0.5 * (unit[2] + of_total - unit[0] - of_second)
    by_dip = 0.5 * (unit[2] - of_second)

    def estimate(name: str, value: float, unit_: str, gradient: Array) -> Estimate:
        error = math.sqrt(max(float(gradient @ spread @ gradient), 0.0))
        return of_fit(name, value, unit_, error, misfit, METHOD)

    share_of = 0.5 / math.sqrt(spring * second)
    by_share = share_of * (unit[3] - 0.5 * float(point[3]) * (unit[2] + of_second))
    damping = mode_damping(point)
    apart = np.maximum(1e-4 * np.abs(point), 1e-9)
    by_damping = [
        (mode_damping(point + step) - mode_damping(point - step)) / (2.0 * np.sum(step))
        for step in np.diag(apart)
    ]
    return TwoMass(
        estimate("motor_inertia", first, "kg m^2", first * unit[0]),
        estimate("load_inertia", second, "kg m^2", second * of_second),
        estimate("total_inertia", total, "kg m^2", total * of_total),
        estimate("stiffness", spring, "N m/rad", spring * unit[2]),
        estimate("damping", float(point[3]), "N m s/rad", unit[3]),
        estimate("resonance", rise, "Hz", rise * by_rise),
        estimate("resonance_damping", damping, "", np.array(by_damping)),
        estimate("antiresonance", dip, "Hz", dip * by_dip),
        estimate("antiresonance_damping", share_of * float(point[3]), "", by_share),
        estimate("inertia_ratio", ratio, "", ratio * unit[1]),
        misfit,
        excess,
        criterion,
        sides,
        point,
        grounded,
    )


def _told(found: TwoMass, torque_known: bool, torque_uncertainty: float | None) -> TwoMass:
    """What can be told from these sides, and with this knowledge of the torque."""
    hidden: dict[str, str] = {}
    if not torque_known:
        hidden = dict.fromkeys((*PARTS, "total_inertia"), NO_SCALE)
    if found.sides == ("load",):
        hidden |= dict.fromkeys(PARTS, HIDDEN)
    changed: dict[str, Any] = {
        name: Estimate.without_interval(name, math.nan, getattr(found, name).unit, reason)
        for name, reason in hidden.items()
    }
    for name in (*PARTS, "total_inertia"):
        each = getattr(found, name)
        if name in changed or not each.has_interval or torque_uncertainty is None:
            continue
        part = Systematic("torque constant", abs(each.value) * torque_uncertainty)
        changed[name] = replace(each, systematic=(*each.systematic, part))
    return replace(found, **changed)
