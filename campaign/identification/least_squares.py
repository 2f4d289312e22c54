"""Nonlinear least squares with several starts, standard errors, and what the data cannot tell."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


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


def fit(
    model: Callable[[Array, Mapping[str, float]], Array],
    x: Array,
    y: Array,
    parameters: Sequence[Parameter],
) -> Fit:
    """Fit y = model(x, parameters), best of all combinations of starts.

    x, y: shape (n,). Raises ValueError when there are fewer points than parameters.
    """
    from scipy.optimize import least_squares

    names = [parameter.name for parameter in parameters]
    if len(y) < len(names):
        raise ValueError(f"{len(y)} points cannot determine {len(names)} parameters")
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
    variance = float(residuals @ residuals) / max(n - k, 1)
    scale = np.linalg.norm(jacobian, axis=0)
    flat = scale == 0.0
    scaled = jacobian / np.where(flat, 1.0, scale)
    _, singular, vt = np.linalg.svd(scaled, full_matrices=False)
    small = singular <= 1e-8 * singular[0]
    undetermined = np.abs(vt[small]).max(axis=0, initial=0.0) > 0.1
    inverse = np.where(small, 0.0, 1.0 / np.where(small, 1.0, singular))
    errors = np.sqrt(variance * ((vt.T * inverse) ** 2).sum(axis=1)) / np.where(flat, 1.0, scale)
    errors[undetermined] = np.nan
    return errors, [int(i) for i in np.flatnonzero(undetermined)]
