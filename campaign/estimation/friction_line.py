"""Coulomb and viscous friction of one direction from a few steady stretches: a straight line.

Friction of sliding, F = Fc + Fv |v|, at the measured speeds. Each stretch is one observation. The
interval includes the scatter between stretches (place, load, time); the samples within a stretch
determine only the error of its own mean. Neighboring stretches are correlated where friction runs
in or drifts. Therefore they are in order of time, and their scatter is an AR(1) process
(`autocorrelated_errors.errors_of`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from campaign.arrays import Array
from campaign.estimate import Estimate
from campaign.estimation.autocorrelated_errors import errors_of
from campaign.estimation.intervals import SINGLE_VALUE, student, with_error
from campaign.estimation.least_squares import propagated

APART = 1.5
"""Least ratio of fastest to slowest speed: a line through one speed has no slope."""
METHOD = "straight line through steady stretches, deviation from their scatter, AR(1) in time"
OF_MEAN = "mean of steady stretches, deviation from their scatter, AR(1) in time"
IN_ORDER = 0.8
"""Correlation of speed and time above which a drift of friction looks like viscous friction."""


@dataclass(frozen=True)
class FrictionLine:
    """Friction of one direction over its speed, both positive; SI.

    Attributes:
        coulomb: extrapolated to standstill (N m), as fitted.
        viscous: slope (N m s/rad), as fitted.
        covariance: of the two, shape (2, 2).
        freedom: degrees of freedom of their scatter: fewer with correlated neighbors.
    """

    coulomb: Estimate
    viscous: Estimate
    covariance: Array
    freedom: float

    def band(self, speed: Array) -> tuple[Array, Array]:
        """Low and high of the line's 95 % band at speeds, each shape (n,)."""
        columns = np.column_stack([np.ones(len(speed)), speed])
        middle = columns @ np.array([self.coulomb.value, self.viscous.value])
        half = student(self.freedom) * propagated(columns, self.covariance)
        return middle - half, middle + half


def friction_line(speed: Array, torque: Array) -> FrictionLine:
    """Line through the stretches of one direction.

    Args:
        speed: of each stretch, positive, shape (n,), in order of time.
        torque: friction against the motion, in its direction (positive), shape (n,).

    Raises ValueError for fewer than three stretches, or almost equal speeds.
    """
    if len(speed) < 3:
        raise ValueError(f"{len(speed)} steady stretches show no line; three are the fewest")
    if speed.max() < APART * speed.min():
        raise ValueError("all steady stretches are about as fast, which shows no slope")
    columns = np.column_stack([np.ones(len(speed)), speed])
    line, *_ = np.linalg.lstsq(columns, torque, rcond=None)
    covariance, freedom = _covariance(columns, torque - columns @ line)
    errors = np.sqrt(np.diag(covariance))
    coulomb, viscous = (
        with_error(name, float(value), unit, float(error), freedom, METHOD)
        for name, unit, value, error in zip(
            ("coulomb_torque", "viscous_friction"), ("N m", "N m s/rad"), line, errors, strict=True
        )
    )
    return FrictionLine(coulomb, viscous, covariance, freedom)


def mean_of_stretches(name: str, values: Array, unit: str) -> Estimate:
    """Mean of values of stretches, shape (n,), in order of time; errors with AR(1)."""
    mean, count = float(np.mean(values)), len(values)
    if count < 2:
        reason = SINGLE_VALUE(what="steady stretch", others="others")
        return Estimate.without_interval(name, mean, unit, reason)
    covariance, freedom = _covariance(np.ones((count, 1)), values - mean)
    return with_error(name, mean, unit, float(np.sqrt(covariance[0, 0])), freedom, OF_MEAN)


def in_order_of_time(speed: Array) -> bool:
    """Whether speeds rise or fall with time, so that both effects cannot be separated."""
    if len(speed) < 3 or np.ptp(speed) == 0:
        return False
    return bool(abs(np.corrcoef(speed, np.arange(len(speed)))[0, 1]) > IN_ORDER)


def _covariance(columns: Array, left: Array) -> tuple[Array, float]:
    """Covariance of least-squares parameters from residuals in order, and degrees of freedom.

    With an AR(1) coefficient r the effective number of n values is n (1 - r) / (1 + r), which
    limits the degrees of freedom. The covariance is zero without residuals.
    """
    count, parameters = columns.shape
    if float(left @ left) <= np.finfo(float).eps ** 2 * float(np.sum(columns**2)):
        return np.zeros((parameters, parameters)), float(count - parameters)
    errors = errors_of(columns, left)
    independent = count * (1.0 - errors.correlation) / (1.0 + errors.correlation)
    return errors.covariance, max(1.0, min(independent, count) - parameters)
