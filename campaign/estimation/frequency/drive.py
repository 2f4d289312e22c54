"""Parameters of a two-inertia drive from its responses."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from campaign.arrays import Array, ComplexArray
from campaign.estimate import Estimate
from campaign.estimation.frequency.rational import RationalFit
from campaign.estimation.frequency.two_mass_model import Side, model, model_jacobian, polynomials
from campaign.reason import Reason

UNITS = {
    "motor_inertia": "kg m^2",
    "load_inertia": "kg m^2",
    "total_inertia": "kg m^2",
    "stiffness": "N m/rad",
    "damping": "N m s/rad",
    "resonance": "Hz",
    "resonance_damping": "",
    "antiresonance": "Hz",
    "antiresonance_damping": "",
    "inertia_ratio": "",
}
"""Units of the estimates of `TwoMass`."""
PARTS = ("motor_inertia", "load_inertia", "stiffness", "damping")
Correlations = Mapping[tuple[str, str], float]


@dataclass(frozen=True)
class TwoMass:
    """Two-mass drive.

    Attributes:
        estimates: by the names of `UNITS`; *not determined* if the responses do not determine
            them. Resonance and antiresonance are undamped, sqrt(k (1/J1 + 1/J2)) and sqrt(k / J2)
            over 2 pi (Hz). `antiresonance_damping` is d / (2 sqrt(k J2)), `inertia_ratio` J2 / J1.
        misfit: why such a drive is no model of the responses; `NONE` if it may be one.
        excess: weighted square over its expectation for a correct model.
        criterion: Schwarz' (BIC).
        sides: the measured sides.
        point: parameters of `model` and a delay for each side, shape (p,).
        function: fitted in place of `model`, for a load alone or one inertia.
        rigid: whether one inertia explains the responses; then they do not show a second one.
        grounded: whether a spring holds the motor, as friction does before sliding.
        covariance: of `point` by scatter, shape (p, p).
        correlations: of the estimates by scatter; keys are pairs of names.
        condition: condition number of the weighted Jacobian with columns of length 1.
    """

    estimates: Mapping[str, Estimate]
    misfit: Reason
    excess: float
    criterion: float
    sides: tuple[Side, ...]
    point: Array
    grounded: bool
    rigid: bool = False
    function: RationalFit | None = None
    covariance: Array = field(default_factory=lambda: np.zeros((0, 0)))
    correlations: Correlations = field(default_factory=dict)
    condition: float = math.nan

    def value(self, frequency: Array, side: Side) -> ComplexArray:
        """Fitted response at `frequency` (Hz), shape (n,)."""
        if self.function is not None:
            return self.function.value(frequency)
        frequency = np.asarray(frequency, dtype=float)
        return model(frequency, self.point, side, self.delay(side))

    def delay(self, side: Side) -> float:
        """Delay of the response of a side (s); zero for a side without a measurement."""
        if self.function is not None:
            return self.function.delay
        return float(self.point[7 + self.sides.index(side)]) if side in self.sides else 0.0

    def jacobian(self, frequency: Array, side: Side) -> ComplexArray:
        """Derivative of `value` by `point`, shape (n, p)."""
        if self.function is not None:
            return self.function.value(frequency)[:, None] * self.function.log_jacobian(frequency)
        return model_jacobian(frequency, self.point, self.sides, side)

    def polynomials(self, side: Side) -> tuple[Array, Array]:
        """Numerator and denominator without the delay, by powers of s (1/s), lowest first."""
        if self.function is not None:
            return self.function.polynomials
        return polynomials(self.point, side)


def not_determined(reason: Reason) -> dict[str, Estimate]:
    """Estimates of all quantities, not determined."""
    return {
        name: Estimate.without_interval(name, math.nan, unit, reason)
        for name, unit in UNITS.items()
    }


def correlations_of(names: Sequence[str], gradients: Array, spread: Array) -> Correlations:
    """Correlations of numbers from their gradients (k, p) and the parameters' covariance (p, p)."""
    together = gradients @ spread @ gradients.T
    error = np.sqrt(np.maximum(np.diag(together), 0.0))
    return {
        (names[i], names[j]): float(np.clip(together[i, j] / error[i] / error[j], -1.0, 1.0))
        for i in range(len(names))
        for j in range(i)
        if error[i] > 0 and error[j] > 0
    }
