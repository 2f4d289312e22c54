"""Nonlinear least squares: several starts, bounds, covariance, and what the data cannot tell."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NULL = 1e-8
"""Singular values of the scaled Jacobian below this share of the largest are null."""
INVOLVED = 0.1
"""Component in a null direction from which on a parameter counts as left open by the data."""


@dataclass(frozen=True)
class Parameter:
    """A parameter to fit: bounds and the values that the starts are built from."""

    name: str
    lower: float
    upper: float
    starts: tuple[float, ...]


@dataclass(frozen=True)
class Fit:
    """A least-squares fit.

    Attributes:
        values: by parameter name.
        errors: standard errors by name, for independent residuals; NaN where the data do not
            determine the parameter.
        residuals: data minus model, shape (n,), in the data's unit.
        bic: Bayesian information criterion for Gaussian residuals; lower is better.
        doubts: sentences naming parameters at a bound, not determined by the data, or less than two
            standard errors from zero.
    """

    values: Mapping[str, float]
    errors: Mapping[str, float]
    residuals: Array
    bic: float
    doubts: tuple[str, ...]

    @property
    def rms(self) -> float:
        """Root mean square of the residuals."""
        return float(np.sqrt(np.mean(self.residuals**2)))


def refuse_too_few(points: int, parameters: int) -> None:
    """ValueError unless there are more points than parameters: else nothing shows the scatter."""
    if points <= parameters:
        raise ValueError(
            f"{points} points cannot determine {parameters} parameters and their scatter; "
            f"{parameters + 1} are the fewest"
        )


def fit(
    model: Callable[[Array, Mapping[str, float]], Array],
    x: Array,
    y: Array,
    parameters: Sequence[Parameter],
) -> Fit:
    """Fit y = model(x, parameters), best of all combinations of starts.

    x, y: shape (n,). Raises ValueError when there are no more points than parameters.
    """
    from scipy.optimize import least_squares

    names = [parameter.name for parameter in parameters]
    refuse_too_few(len(y), len(names))
    lower = np.array([parameter.lower for parameter in parameters])
    upper = np.array([parameter.upper for parameter in parameters])

    def residual(vector: Array) -> Array:
        return y - model(x, dict(zip(names, vector, strict=True)))

    grids = np.meshgrid(*(parameter.starts for parameter in parameters), indexing="ij")
    starts = np.stack([grid.ravel() for grid in grids], axis=1)
    solutions = [
        least_squares(residual, np.clip(start, lower, upper), bounds=(lower, upper), x_scale="jac")
        for start in starts
    ]
    best = min(solutions, key=lambda solution: float(solution.cost))
    errors, undetermined = _standard_errors(best.jac, best.fun)
    doubts = [f"{names[i]} is not determined by these data" for i in undetermined]
    doubts += [
        f"{name} ended at its bound {value:.4g}"
        for name, value, side in zip(names, best.x, best.active_mask, strict=True)
        if side != 0
    ]
    doubts += [
        f"{name} cannot be told from zero: {value:.3g} ± {error:.2g} (1σ)"
        for name, value, error in zip(names, best.x, errors, strict=True)
        if error > 0.5 * abs(value)
    ]
    n, k = len(y), len(names)
    mean_square = max(float(np.mean(best.fun**2)), np.finfo(float).tiny)
    return Fit(
        values={name: float(value) for name, value in zip(names, best.x, strict=True)},
        errors={name: float(error) for name, error in zip(names, errors, strict=True)},
        residuals=best.fun,
        bic=n * np.log(mean_square) + k * np.log(n),
        doubts=tuple(doubts),
    )


def _standard_errors(jacobian: Array, residuals: Array) -> tuple[Array, list[int]]:
    """Standard errors, and which parameters the data leave open (a null direction of J)."""
    n, k = jacobian.shape
    variance = float(residuals @ residuals) / (n - k)
    inverse, undetermined = covariance(jacobian)
    errors = np.sqrt(variance * np.diag(inverse))
    errors[undetermined] = np.nan
    return errors, [int(i) for i in np.flatnonzero(undetermined)]


def covariance(
    jacobian: Array, null: float = NULL, flat: float = 0.0
) -> tuple[Array, NDArray[np.bool_]]:
    """(JᵀJ)⁻¹ without null directions, shape (k, k), and which parameters these involve, (k,).

    Units of the parameters decide nothing: each column of J, shape (n, k), is scaled to length 1.

    Args:
        null: share of the largest singular value of that below which a direction is null.
        flat: share of the longest column below which one is null whatever its direction, where
            parameters have comparable units.
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


@dataclass(frozen=True)
class Minimum:
    """Where a sum of squares is smallest between bounds.

    Attributes:
        point: shape (k,).
        residuals, jacobian: there, shapes (n,) and (n, k).
        held: parameters that lie at a bound and would go beyond it, shape (k,).
    """

    point: Array
    residuals: Array
    jacobian: Array
    held: NDArray[np.bool_]

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
    """Smallest sum of squares between bounds: Levenberg and Marquardt, steps cut off at a bound.

    For small problems with a derivative: a tenth of the time of `scipy.optimize.least_squares`,
    most of which goes into its own bookkeeping.

    Args:
        function: residuals (n,) and their Jacobian (n, k) at a point (k,).
        lower, upper: shape (k,); equal ones hold a parameter.
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
        scale = np.diag(np.maximum(np.diag(square), 1e-30 * max(float(np.trace(square)), 1e-300)))
        while damping < 1e12:
            step = np.zeros_like(point)
            step[free] = np.linalg.solve(square + damping * scale, -gradient[free])
            new = np.clip(point + step, lower, upper)
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


def _held(point: Array, gradient: Array, lower: Array, upper: Array) -> NDArray[np.bool_]:
    """Which parameters are at a bound with the descent leading beyond it."""
    return ((point <= lower) & (gradient >= 0)) | ((point >= upper) & (gradient <= 0))


def profile_limit(
    cost_at: Callable[[float], float], start: float, step: float, most: float
) -> float:
    """Where a profile of the sum of squares has risen by `most` above its value at `start`.

    Args:
        cost_at: smallest sum of squares with the parameter held at a value.
        step: first step away from `start`, with its sign; doubled until the rise is passed.

    Raises ValueError where it never rises so far: the data give no limit on that side.
    """
    from scipy.optimize import brentq

    bottom = cost_at(start)
    inner, outer = start, start + step
    for _ in range(60):
        if cost_at(outer) - bottom > most:
            break
        inner, outer = outer, start + 2.0 * (outer - start)
    else:
        raise ValueError("the data give no limit on that side")
    found = brentq(lambda x: cost_at(x) - bottom - most, inner, outer, rtol=1e-6)
    return float(found)
