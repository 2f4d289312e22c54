"""Standard errors of least-squares fits with autocorrelated residuals.

Sensor noise is seldom white. Then ordinary least squares has no bias, but its standard errors are
too small: three times with AR(1) residuals of coefficient 0.8.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from campaign.arrays import Array

COEFFICIENTS = np.linspace(0.0, 0.95, 20)
"""AR(1) coefficients of the search; negatively correlated residuals count as white."""
MOST_AT_ONCE = 1 << 18
"""Most elements of whitened designs in memory at the same time."""
MISFIT = 1.5
"""Residual variance over that between neighbors, above which the residuals are the model's own
error, and no interval is valid."""


@dataclass(frozen=True)
class FitErrors:
    """Errors of the parameters of a fit, from its residuals.

    Attributes:
        covariance: of the parameters, shape (k, k).
        freedom: residuals less parameters.
        correlation: AR(1) coefficient of the residuals, by restricted maximum likelihood.
        misfit: residual variance over half the mean square difference of neighbors (von Neumann):
            1 for white residuals, much more where the model does not fit the data.
    """

    covariance: Array
    freedom: int
    correlation: float
    misfit: float


def errors_of(jacobian: Array, residuals: Array) -> FitErrors:
    """Errors of a least-squares fit with AR(1) residuals, in order and evenly spaced.

    jacobian: of the model, shape (n, k); residuals: data less model, shape (n,). Restricted maximum
    likelihood (Harville, J. Am. Stat. Assoc. 72, 1977) estimates the coefficient without the bias
    by the fitted parameters. Raises ValueError when n <= k or the parameters are dependent.
    """
    count, parameters = jacobian.shape
    freedom = count - parameters
    if freedom < 1:
        raise ValueError(f"{count} values cannot determine {parameters} parameters")
    scale = np.linalg.norm(jacobian, axis=0)
    if not np.all(scale > 0):
        raise ValueError("a parameter of the fit changes nothing")
    count = min(len(COEFFICIENTS), 1 + len(COEFFICIENTS) * jacobian.size // MOST_AT_ONCE)
    blocks = np.array_split(COEFFICIENTS, count)
    tried = [_likelihoods(jacobian / scale, residuals, block)[0] for block in blocks]
    best = int(np.argmax(np.concatenate(tried)))
    _, triangles, variances = _likelihoods(jacobian / scale, residuals, COEFFICIENTS[[best]])
    triangle, variance = triangles[0], float(variances[0])
    if np.linalg.cond(triangle) > 1e8:
        raise ValueError("the parameters of the fit are not distinguishable")
    inverse = np.linalg.inv(triangle) / scale[:, None]
    return FitErrors(
        variance * (inverse @ inverse.T),
        freedom,
        float(COEFFICIENTS[best]),
        misfit(residuals, parameters),
    )


def misfit(residuals: Array, parameters: int) -> float:
    """Residual variance over that between neighbors: near 1, unless the model does not fit.

    Infinite when neighbors are equal.
    """
    between = 0.5 * float(np.mean(np.diff(residuals) ** 2))
    variance = float(residuals @ residuals) / max(len(residuals) - parameters, 1)
    return variance / between if between > 0 else np.inf


def whitened(values: Array, coefficient: float) -> Array:
    """Innovations of the values of an AR(1) process, shape (n,) or (n, k)."""
    first = np.sqrt(1.0 - coefficient**2) * values[:1]
    return np.concatenate([first, values[1:] - coefficient * values[:-1]])


def _likelihoods(
    design: Array, residuals: Array, coefficients: Array
) -> tuple[Array, Array, Array]:
    """Restricted log likelihoods of m AR(1) coefficients, shape (m,).

    Also triangles of the whitened design (m, k, k), and variances of the innovations (m,).
    """
    first = np.sqrt(1.0 - coefficients**2)
    columns = np.ascontiguousarray(design.T)
    inner = np.empty((len(coefficients), *columns.shape))
    inner[:, :, 0] = first[:, None] * columns[:, 0]
    inner[:, :, 1:] = columns[:, 1:] - coefficients[:, None, None] * columns[:, :-1]
    left = np.empty((len(coefficients), len(residuals)))
    left[:, 0] = first * residuals[0]
    left[:, 1:] = residuals[1:] - coefficients[:, None] * residuals[:-1]
    orthogonal, triangle = np.linalg.qr(inner.transpose(0, 2, 1))
    share = np.matmul(left[:, None, :], orthogonal)[:, 0, :, None]
    left -= np.matmul(orthogonal, share)[:, :, 0]
    freedom = len(residuals) - design.shape[1]
    tiny = float(np.finfo(float).tiny)
    variance = np.maximum(np.einsum("mn,mn->m", left, left) / freedom, tiny)
    diagonal = np.abs(np.diagonal(triangle, axis1=1, axis2=2))
    determinant = 2.0 * np.sum(np.log(np.maximum(diagonal, tiny)), axis=1)
    likelihood = -0.5 * (freedom * np.log(variance) - np.log(1.0 - coefficients**2) + determinant)
    return likelihood, triangle, variance
