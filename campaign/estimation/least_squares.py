"""Least squares on arrays: a small search between bounds, covariance, null directions, profiles.

For fast functions (microseconds) with derivatives; `multi_start` fits slow functions from several
starts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from campaign.arrays import Array, Flags

NULL = 1e-8
"""Singular values of the scaled Jacobian below this share of the largest are null."""
INVOLVED = 0.1
"""Component in a null direction above which the data do not determine a parameter."""


def refuse_too_few(points: int, parameters: int) -> None:
    """Raise ValueError unless points outnumber parameters: otherwise the scatter is unknown."""
    if points <= parameters:
        raise ValueError(
            f"{points} points cannot determine {parameters} parameters and their scatter; "
            f"{parameters + 1} are the fewest"
        )


def covariance(jacobian: Array, null: float = NULL, flat: float = 0.0) -> tuple[Array, Flags]:
    """(JᵀJ)⁻¹ without null directions, shape (k, k), and mask of the parameters in these, (k,).

    Independent of the parameters' units: each column of J, shape (n, k), is scaled to length 1.

    Args:
        null: share of the largest singular value below which a direction is null.
        flat: share of the longest column below which a column is null, for parameters of comparable
            units.
    """
    length = np.linalg.norm(jacobian, axis=0)
    nothing = length <= flat * float(length.max(initial=0.0))
    safe = np.where(nothing, 1.0, length)
    _, singular, vt = np.linalg.svd(np.where(nothing, 0.0, jacobian / safe), full_matrices=False)
    small = singular <= null * singular[0]
    involved = np.abs(vt[small]).max(axis=0, initial=0.0) > INVOLVED
    inverse = np.where(small, 0.0, 1.0 / np.where(small, 1.0, singular))
    scaled = (vt.T * inverse**2) @ vt
    return scaled / np.outer(safe, safe), np.asarray(nothing | involved)


def straight_line(values: Array) -> Array:
    """Straight line through evenly spaced values, shape (n,)."""
    place = np.linspace(-1.0, 1.0, len(values))
    return np.asarray(values.mean() + place * (place @ values) / (place @ place))


def gradients(function: Callable[[Array], Array], point: Array, steps: Array) -> Array:
    """Derivatives of numbers (k,) by parameters (p,): central differences of `steps`, (k, p)."""
    sides = [(function(point + step) - function(point - step)) for step in np.diag(steps)]
    return np.asarray(np.stack(sides, axis=-1) / (2.0 * steps))


def propagated(by: Array, covariance: Array) -> Array:
    """Standard deviations of numbers by the delta method, shape (k,) (GUM 5.2.2).

    by: their derivatives by the parameters, shape (k, p); covariance of the parameters: (p, p).
    """
    return np.asarray(np.sqrt(np.maximum(np.einsum("kp,pq,kq->k", by, covariance, by), 0.0)))


@dataclass(frozen=True)
class Minimum:
    """Minimum of a sum of squares between bounds.

    Attributes:
        point: shape (k,).
        residuals, jacobian: at the point, shapes (n,) and (n, k).
        held: mask of parameters at a bound with the descent beyond it, shape (k,).
    """

    point: Array
    residuals: Array
    jacobian: Array
    held: Flags

    @property
    def cost(self) -> float:
        """Sum of squares."""
        return float(self.residuals @ self.residuals)


def minimum(
    function: Callable[[Array], tuple[Array, Array]],
    start: Array,
    lower: Array,
    upper: Array,
    steps: int = 100,
) -> Minimum:
    """Minimize a sum of squares between bounds: Levenberg-Marquardt, steps cut off at a bound.

    For small problems with a derivative: a tenth of the time of `scipy.optimize.least_squares`,
    which is mostly overhead.

    Args:
        function: residuals (n,) and their Jacobian (n, k) at a point (k,).
        lower, upper: shape (k,); equal bounds fix a parameter.
    """
    point = np.clip(start, lower, upper)
    residuals, jacobian = function(point)
    cost, damping = float(residuals @ residuals), 1e-3
    for _ in range(steps):
        gradient = jacobian.T @ residuals
        held = _held(point, gradient, lower, upper)
        free = np.flatnonzero(~held)
        if len(free) == 0:
            break
        part = jacobian[:, free]
        square = part.T @ part
        diagonal = square.diagonal()
        scale = np.maximum(diagonal, 1e-30 * max(float(diagonal.sum()), 1e-300))
        descent = -gradient[free]
        while damping < 1e12:
            damped, new = square.copy(), point.copy()
            damped.ravel()[:: len(free) + 1] += damping * scale
            new[free] += np.linalg.solve(damped, descent)
            new = np.minimum(np.maximum(new, lower), upper)
            new_residuals, new_jacobian = function(new)
            new_cost = float(new_residuals @ new_residuals)
            if new_cost <= cost:
                break
            damping *= 5.0
        else:
            break
        gain = cost - new_cost
        point, residuals, jacobian, cost = new, new_residuals, new_jacobian, new_cost
        damping = max(0.1 * damping, 1e-12)
        if gain <= 1e-12 * cost:
            break
    held = _held(point, jacobian.T @ residuals, lower, upper)
    return Minimum(point, residuals, jacobian, held)


def _held(point: Array, gradient: Array, lower: Array, upper: Array) -> Flags:
    """Mask of the parameters at a bound with the descent beyond it."""
    return ((point <= lower) & (gradient >= 0)) | ((point >= upper) & (gradient <= 0))


def profile_limit(
    cost_at: Callable[[float], float],
    start: float,
    step: float,
    most: float,
    accuracy: float = 1e-6,
    doublings: int = 60,
) -> float:
    """Value at which a profile of the sum of squares is `most` above that at `start`.

    Args:
        cost_at: smallest sum of squares with the parameter fixed at a value.
        step: first step from `start`, with its sign; doubled until the rise exceeds `most`.
        accuracy: relative accuracy of the limit.
        doublings: largest number of doublings.

    Raises ValueError where the rise is smaller: the data give no limit on that side.
    """
    from scipy.optimize import brentq

    cost_at = cache(cost_at)  # the search evaluates both ends again
    bottom = cost_at(start)
    inner, outer = start, start + step
    for _ in range(doublings):
        if cost_at(outer) - bottom > most:
            break
        inner, outer = outer, start + 2.0 * (outer - start)
    else:
        raise ValueError("the data give no limit on that side")
    limit = brentq(lambda x: cost_at(x) - bottom - most, inner, outer, rtol=accuracy)
    return float(limit)
