"""Drives with responses that do not determine two inertias."""

from __future__ import annotations

import math

import numpy as np

from campaign.arrays import Array
from campaign.estimation.frequency.drive import UNITS, TwoMass, correlations_of, not_determined
from campaign.estimation.frequency.measured_response import MeasuredResponse
from campaign.estimation.frequency.modes import of_fit
from campaign.estimation.frequency.rational import rational_fit
from campaign.estimation.frequency.two_mass_model import Side
from campaign.estimation.least_squares import gradients, propagated
from campaign.reason import Cause

HIDDEN = Cause(
    "load side alone",
    "a sensor at the load shows no antiresonance: any J1, J2 and k with the same resonance and the "
    "same sum of inertias answer alike; measure the motor's rate too",
)
RIGID = Cause(
    "rigid drive",
    "one inertia explains the response: no second one shows; excite up to above the resonance, or "
    "with more torque around it",
)
NEGATIVE_INERTIA = Cause("negative inertia", "its inertia would be negative")
NO_RESONANCE = Cause("no resonance in band", "no resonance of two inertias lies in the band")
METHOD = "One inertia with viscous friction and a delay, least squares weighted by scatter"
AT_LOAD = ("total_inertia", "resonance", "resonance_damping")
"""Quantities that a sensor at the load alone determines."""


def rigid_fit(measured: MeasuredResponse, side: Side) -> TwoMass:
    """Fit of one inertia: exp(-s delay) / (J s + b)."""
    fit = rational_fit(measured, (0, 1))
    up, down = float(fit.numerator[0]), fit.denominator
    unit = 2.0 * math.pi * fit.scale
    inertia = float(down[1]) / up / unit
    by = np.array([-inertia / up, 0.0, 1.0 / up / unit, 0.0])
    error = math.sqrt(max(float(by @ fit.scatter @ by), 0.0))
    misfit = fit.misfit
    if not misfit and inertia <= 0:
        misfit = NEGATIVE_INERTIA()
    total = of_fit("total_inertia", inertia, "kg m^2", error, misfit, METHOD)
    return TwoMass(
        not_determined(RIGID()) | {"total_inertia": total},
        misfit=misfit,
        excess=fit.excess,
        criterion=fit.criterion,
        sides=(side,),
        point=fit.vector,
        grounded=False,
        rigid=True,
        function=fit,
        covariance=fit.scatter,
        condition=fit.condition,
    )


def load_side_fit(measured: MeasuredResponse) -> TwoMass:
    """Fit to a rate at the load: a function of third order with one zero and a delay.

    With friction at one of the inertias it is (d s + k) / (J1 J2 s³ + ... + b k). It determines the
    sum of the inertias and sqrt(k (1/J1 + 1/J2)), but neither J1, J2 nor k.
    """
    fit = rational_fit(measured, (1, 3))
    if fit.zeros[0].real > 0:
        # A zero in the right half plane with less delay has almost the same response, but no spring
        # has negative damping.
        mirrored = np.array([fit.numerator[0], -fit.numerator[1]])
        later = fit.delay + 2.0 / float(fit.zeros[0].real)
        fit = rational_fit(
            measured, (1, 3), start=np.concatenate([mirrored, fit.denominator, [later]])
        )
    unit = 2.0 * math.pi * fit.scale

    def told(theta: Array) -> Array:
        b, a = theta[:2], theta[2:6]
        total = a[1] / b[0] - a[0] * b[1] / b[0] ** 2
        resonance = math.sqrt(abs(b[0] / a[3] * total)) * unit
        roots = np.polynomial.polynomial.polyroots(a)
        root = max(roots, key=abs)
        return np.array([total / unit, resonance / (2.0 * math.pi), -root.real / abs(root)])

    theta = fit.vector
    values = told(theta)
    by = gradients(told, theta, np.maximum(1e-5 * np.abs(theta), 1e-12))
    error = propagated(by, fit.scatter)
    method = "function of third order with a delay, friction taken to be at one of the inertias"
    misfit = fit.misfit
    if not misfit and (values[0] <= 0 or not fit.lowest <= values[1] <= fit.highest):
        misfit = NO_RESONANCE()
    estimates = {
        name: of_fit(name, float(value), UNITS[name], float(by_fit), misfit, method)
        for name, value, by_fit in zip(AT_LOAD, values, error, strict=True)
    }
    return TwoMass(
        not_determined(HIDDEN()) | estimates,
        misfit=misfit,
        excess=fit.excess,
        criterion=fit.criterion,
        sides=("load",),
        point=theta,
        grounded=False,
        function=fit,
        covariance=fit.scatter,
        correlations={} if misfit else correlations_of(AT_LOAD, by, fit.scatter),
        condition=fit.condition,
    )
