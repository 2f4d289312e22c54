"""Coulomb and viscous friction of one direction from a few steady stretches: a straight line.

Friction of sliding, F = Fc + Fv |v|, as far as it shows at the speeds there are. Each stretch is
one observation: what differs between them (place, load, time) is the scatter that the interval
holds, and the samples within a stretch only tell how well its own mean is known. Stretches that
follow each other are alike where friction runs in or drifts, so they stand in order of time, and
their scatter is taken as an AR(1) process (`autocorrelated.errors_of`).
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
"""Fastest over slowest of the speeds, at least: a line through one speed tells no slope."""
METHOD = "straight line through steady stretches, deviation from their scatter, AR(1) in time"
OF_MEAN = "mean of steady stretches, deviation from their scatter, AR(1) in time"
IN_ORDER = 0.8
"""Correlation of speed and time beyond which a drift of friction looks like viscous friction."""


@dataclass(frozen=True)
class FrictionLine:
    """Friction of one direction over its speed, both positive; SI.

    Attributes:
        coulomb: extrapolated to standstill (N m), as fitted.
        viscous: slope (N m s/rad), as fitted.
        covariance: of the two, shape (2, 2).
        freedom: of their scatter: less, where neighbours are alike.
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
    """The line through stretches of one direction.

    Args:
        speed: of each stretch, positive, shape (n,), in order of time.
        torque: friction against the motion, in its direction (positive), shape (n,).

    Raises ValueError where there are fewer than three stretches, or only about one speed.
    """
    if len(speed) < 3:
        raise ValueError(f"{len(speed)} steady stretches show no line; three are the fewest")
    if speed.max() < APART * speed.min():
        raise ValueError("all steady stretches are about as fast, which shows no slope")
    columns = np.column_stack([np.ones(len(speed)), speed])
    found, *_ = np.linalg.lstsq(columns, torque, rcond=None)
    covariance, freedom = _covariance(columns, torque - columns @ found)
    errors = np.sqrt(np.diag(covariance))
    coulomb, viscous = (
        with_error(name, float(value), unit, float(error), freedom, METHOD)
        for name, unit, value, error in zip(
            ("coulomb_torque", "viscous_friction"), ("N m", "N m s/rad"), found, errors, strict=True
        )
    )
    return FrictionLine(coulomb, viscous, covariance, freedom)


def mean_of_stretches(name: str, values: Array, unit: str) -> Estimate:
    """Mean of what stretches show, shape (n,), in order of time; t with n - 1."""
    mean, count = float(np.mean(values)), len(values)
    if count < 2:
        reason = SINGLE_VALUE(what="steady stretch", others="others")
        return Estimate.without_interval(name, mean, unit, reason)
    covariance, freedom = _covariance(np.ones((count, 1)), values - mean)
    return with_error(name, mean, unit, float(np.sqrt(covariance[0, 0])), freedom, OF_MEAN)


def in_order_of_time(speed: Array) -> bool:
    """Whether speeds rise, or fall, as time goes on, so that nobody can tell the two apart."""
    if len(speed) < 3 or np.ptp(speed) == 0:
        return False
    return bool(abs(np.corrcoef(speed, np.arange(len(speed)))[0, 1]) > IN_ORDER)


def _covariance(columns: Array, left: Array) -> tuple[Array, float]:
    """Of least-squares parameters by their residuals in order, and its degrees of freedom.

    Of n values with an AR(1) coefficient r as many as n (1 - r) / (1 + r) are independent; how many
    there are is all that is known of the scatter. Zero where nothing is left over.
    """
    count, parameters = columns.shape
    if float(left @ left) <= np.finfo(float).eps ** 2 * float(np.sum(columns**2)):
        return np.zeros((parameters, parameters)), float(count - parameters)
    found = errors_of(columns, left)
    independent = count * (1.0 - found.correlation) / (1.0 + found.correlation)
    return found.covariance, max(1.0, min(independent, count) - parameters)
