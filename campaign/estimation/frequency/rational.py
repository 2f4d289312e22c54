"""Fit of a rational function with delay to a measured response.

    G(s) = exp(-s delay) * (b0 + b1 s' + ...) / (a0 + a1 s' + ...),    s' = s / (2 pi scale)

Start: Sanathanan and Koerner's iteration (IEEE Trans. AC-8 (1963) 56) for several delays. Then the
Levenberg-Marquardt method minimizes the weighted square, which is maximum likelihood for errors of
known variance (Pintelon and Schoukens, "System Identification: A Frequency Domain Approach" (2012),
9.11).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from campaign.arrays import Array, ComplexArray
from campaign.estimation.frequency.measured_response import ALIKE, LEAST_FREEDOM, MeasuredResponse
from campaign.estimation.least_squares import covariance, minimum
from campaign.reason import NONE, Cause, Reason

SANATHANAN = 8
"""Iterations before the refinement."""
DELAYS = 6
"""Number of delays from which a fit starts."""
EXACT = 1e-6
"""Least relative error of a value: the resolution of the fit's arithmetic."""
MOST_EXCESS = 2.0
"""Weighted square over its expectation above which a function is no model of the response."""
SURE = 3.3
"""Standard deviations above which a statistic is significant (0.05 %, one-sided)."""
LARGE_RESIDUALS = Cause(
    "residuals too large", "it leaves {times:.1f} times the square that scatter would"
)
ALIKE_RESIDUALS = Cause(
    "residuals alike",
    "its residuals correlate at neighbouring frequencies ({correlation:.2f})",
)


@dataclass(frozen=True)
class Weights:
    """Weights of a fit, with the statistics of a weighted square for estimated variances.

    Attributes:
        error: standard deviation of either part of each value, shape (n,).
        mean: expectation of one squared, weighted residual of a correct model.
        spread: variance of the sum of the two squares of one value.
        inflation: factor of a covariance for the scatter of the weights.
    """

    error: Array
    mean: float
    spread: float
    inflation: float

    @staticmethod
    def of(measured: MeasuredResponse) -> Weights:
        """Weights; ValueError for missing variances, or with too few degrees of freedom."""
        freedom = float(np.min(measured.freedom, initial=math.inf))
        if not np.all(np.isfinite(measured.variance)) or freedom < LEAST_FREEDOM:
            raise ValueError(
                "the variance of the response is not determined well enough to weigh a fit with: "
                "more averages, periods or realisations are needed"
            )
        floor = EXACT * np.abs(measured.values)
        error = np.sqrt(0.5 * (measured.variance + ALIKE * measured.bias**2))
        error = np.maximum(error, floor)
        if math.isinf(freedom):
            return Weights(error, 1.0, 4.0, 1.0)
        # |error|² / variance follows F(2, freedom).
        mean = freedom / (freedom - 2.0)
        spread = 4.0 * freedom**3 / ((freedom - 2.0) ** 2 * (freedom - 4.0))
        return Weights(error, mean, spread, freedom / (freedom - 4.0))


@dataclass(frozen=True)
class RationalFit:
    """A fitted function; coefficients of powers of s over `2 pi scale`, lowest power first.

    Attributes:
        numerator, denominator: shapes (nb + 1,) and (na + 1,).
        delay: (s).
        scale: (Hz).
        covariance: of (numerator, denominator, delay), shape (p, p), without `excess`.
        residuals: weighted, complex, shape (n,); the mean square of either part is 1.
        excess: weighted square over its expectation for a correct model.
        misfit: why it is no model of the response; `NONE` if it may be one.
        parameters: number of free parameters.
        lowest, highest: of the frequencies (Hz).
        condition: condition number of the weighted Jacobian with columns of length 1.
    """

    numerator: Array
    denominator: Array
    delay: float
    scale: float
    covariance: Array
    residuals: ComplexArray
    excess: float
    misfit: Reason
    parameters: int
    lowest: float
    highest: float
    condition: float = math.nan

    @property
    def vector(self) -> Array:
        """Numerator, denominator and delay, shape (p,)."""
        return np.concatenate([self.numerator, self.denominator, [self.delay]])

    def value(self, frequency: Array) -> ComplexArray:
        """G at `frequency` (Hz), shape (n,)."""
        s = np.asarray(1j * np.asarray(frequency, dtype=float) / self.scale)
        return _model(self.vector, s, len(self.numerator) - 1, self.scale)

    def log_jacobian(self, frequency: Array) -> ComplexArray:
        """Derivative of log G by (numerator, denominator, delay), shape (n, p)."""
        s = 1j * np.asarray(frequency, dtype=float) / self.scale
        powers = _powers(s, self.numerator, self.denominator)
        return _log_jacobian(powers, s, self.numerator, self.denominator, self.scale)

    @property
    def polynomials(self) -> tuple[Array, Array]:
        """Numerator and denominator by powers of s (1/s), lowest first, without the delay."""
        unit = 2.0 * np.pi * self.scale
        up, down = (c / unit ** np.arange(len(c)) for c in (self.numerator, self.denominator))
        return up, down

    @cached_property
    def scatter(self) -> Array:
        """Covariance of (numerator, denominator, delay), including `excess`."""
        return np.asarray(self.covariance * max(self.excess, 1.0))

    @cached_property
    def poles(self) -> ComplexArray:
        """Poles (rad/s)."""
        return _roots(self.denominator, self.scale)

    @cached_property
    def zeros(self) -> ComplexArray:
        """Zeros (rad/s)."""
        return _roots(self.numerator, self.scale)

    @property
    def criterion(self) -> float:
        """Schwarz' criterion (BIC): lower is better."""
        values = 2 * len(self.residuals)
        square = float(np.sum(np.abs(self.residuals) ** 2))
        return square + self.parameters * math.log(values)


def _roots(coefficients: Array, scale: float) -> ComplexArray:
    roots = np.polynomial.polynomial.polyroots(coefficients)
    return np.asarray(roots * (2.0 * np.pi * scale), dtype=complex)


def _powers(s: ComplexArray, numerator: Array, denominator: Array) -> ComplexArray:
    """Powers of s, shape (n, larger number of coefficients)."""
    return np.asarray(s[:, None] ** np.arange(max(len(numerator), len(denominator))))


def _log_jacobian(
    powers: ComplexArray, s: ComplexArray, numerator: Array, denominator: Array, scale: float
) -> ComplexArray:
    up = powers[:, : len(numerator)] / (powers[:, : len(numerator)] @ numerator)[:, None]
    down = powers[:, : len(denominator)] / (powers[:, : len(denominator)] @ denominator)[:, None]
    return np.column_stack([up, -down, -s * (2.0 * np.pi * scale)])


def rational_fit(
    measured: MeasuredResponse,
    order: tuple[int, int],
    delays: Array | None = None,
    start: Array | None = None,
) -> RationalFit:
    """Best fit of a function of one `order` (of numerator, of denominator).

    Args:
        measured: at n frequencies, with a variance of enough degrees of freedom.
        delays: start values (s); default: `delays_to_try`.
        start: start value (numerator, denominator, delay) instead.

    Raises ValueError for too few frequencies, a numerator of higher order than the denominator, or
    variances that cannot weight a fit.
    """
    up, down = order
    free = up + down + 2
    if up > down or up < 0 or down < 1:
        raise ValueError("the numerator's order must not be above the denominator's")
    if 2 * len(measured.frequency) < free + 4:
        raise ValueError(
            f"{len(measured.frequency)} frequencies cannot determine {free} parameters"
        )
    weights = Weights.of(measured)
    frequency = measured.frequency
    scale = float(np.sqrt(frequency[0] * frequency[-1]))
    s = np.asarray(1j * frequency / scale)
    if start is not None:
        return _refined(measured, weights, s, scale, up, start)
    starts = []
    for delay in delays_to_try(measured) if delays is None else delays:
        advanced = measured.values * np.exp(s * (2.0 * np.pi * scale * delay))
        starts.append(np.append(_sanathanan(s, advanced, weights.error, order), delay))

    def square(theta: Array) -> float:
        left = (_model(theta, s, up, scale) - measured.values) / weights.error
        return float(np.sum(np.abs(left) ** 2))

    return _refined(measured, weights, s, scale, up, min(starts, key=square))


def delays_to_try(measured: MeasuredResponse) -> Array:
    """Delays (s) from 0 to 1.2 times the phase slope in the upper third of the band."""
    upper = measured.frequency >= measured.frequency[-1] * 2.0 / 3.0
    most = 0.0
    if np.count_nonzero(upper) > 3:
        phase = np.unwrap(np.angle(measured.values[upper]))
        slope = np.polyfit(2.0 * np.pi * measured.frequency[upper], phase, 1)[0]
        most = max(-1.2 * float(slope), 0.0)
    return np.linspace(0.0, most, DELAYS) if most > 0 else np.zeros(1)


def _sanathanan(
    s: ComplexArray, values: ComplexArray, error: Array, order: tuple[int, int]
) -> Array:
    """Start coefficients (numerator, denominator), of norm 1."""
    up, down = order
    powers = s[:, None] ** np.arange(down + 1)
    linear = np.column_stack([powers[:, : up + 1], -values[:, None] * powers])
    previous = np.ones(len(s))
    best, least = np.zeros(up + down + 2), math.inf
    for _ in range(SANATHANAN):
        weighted = linear / (error * previous)[:, None]
        stacked = np.concatenate([weighted.real, weighted.imag])
        length = np.maximum(np.linalg.norm(stacked, axis=0), 1e-300)
        _, _, right = np.linalg.svd(stacked / length, full_matrices=False)
        theta = right[-1] / length
        theta = theta / np.linalg.norm(theta)
        previous = np.maximum(np.abs(powers @ theta[up + 1 :]), 1e-12)
        left = (linear @ theta) / (error * previous)
        square = float(np.sum(np.abs(left) ** 2))
        if square < least:
            best, least = theta, square
    return best


def _model(theta: Array, s: ComplexArray, up: int, scale: float) -> ComplexArray:
    numerator, denominator = theta[: up + 1], theta[up + 1 : -1]
    over = _polynomial(s, denominator)
    over = np.where(np.abs(over) > 1e-300, over, 1e-300)
    delayed = np.exp(-s * (2.0 * np.pi * scale * theta[-1]))
    return np.asarray(delayed * _polynomial(s, numerator) / over)


def _polynomial(s: ComplexArray, coefficients: Array) -> ComplexArray:
    """Polynomial by Horner's scheme; as numpy's `polyval`, without checks of arguments."""
    value = coefficients[-1] + s * 0.0
    for coefficient in coefficients[-2::-1].tolist():
        value = coefficient + value * s
    return np.asarray(value)


def _refined(
    measured: MeasuredResponse,
    weights: Weights,
    s: ComplexArray,
    scale: float,
    up: int,
    start: Array,
) -> RationalFit:
    values, error = measured.values, weights.error
    # The largest term of the denominator is fixed, because a common factor is arbitrary.
    down = len(start) - up - 3
    powers = np.abs(s[:, None]) ** np.arange(down + 1)
    held = up + 1 + int(np.argmax(np.max(powers, axis=0) * np.abs(start[up + 1 : -1])))
    start = np.append(start[:-1] / start[held], start[-1])
    size = np.append(np.maximum(np.abs(start[:-1]), 1e-12), 1.0 / (2.0 * np.pi * scale))
    powers_of_s = _powers(s, start[: up + 1], start[up + 1 : -1])

    def function(scaled: Array) -> tuple[Array, Array]:
        theta = scaled * size
        model = _model(theta, s, up, scale)
        left = (model - values) / error
        by = _log_jacobian(powers_of_s, s, theta[: up + 1], theta[up + 1 : -1], scale)
        by = by * (model / error)[:, None] * size
        return np.concatenate([left.real, left.imag]), np.concatenate([by.real, by.imag])

    low, high = np.full(len(start), -np.inf), np.full(len(start), np.inf)
    scaled = start / size
    low[held] = high[held] = scaled[held]
    with np.errstate(all="ignore"):
        best = minimum(function, scaled, low, high, steps=200)
    free = np.setdiff1d(np.arange(len(start)), held)
    inner, _ = covariance(best.jacobian[:, free])
    spread = np.zeros((len(start), len(start)))
    spread[np.ix_(free, free)] = inner * np.outer(size[free], size[free]) * weights.inflation
    theta = best.point * size
    n = len(values)
    parts = best.residuals / math.sqrt(weights.mean)
    residuals: ComplexArray = np.asarray(parts[:n] + 1j * parts[n:], dtype=complex)
    excess, misfit = judged_fit(residuals, len(free), weights)
    return RationalFit(
        theta[: up + 1],
        theta[up + 1 : -1],
        float(theta[-1]),
        scale,
        spread,
        residuals,
        excess,
        misfit,
        len(free),
        float(measured.frequency[0]),
        float(measured.frequency[-1]),
        condition_of(best.jacobian[:, free]),
    )


def condition_of(jacobian: Array) -> float:
    """Condition number with columns scaled to length 1; independent of the parameters' units."""
    length = np.linalg.norm(jacobian, axis=0)
    if not np.all(np.isfinite(length)) or not np.all(length > 0):
        return math.inf
    return float(np.linalg.cond(jacobian / length))


def judged_fit(residuals: ComplexArray, parameters: int, weights: Weights) -> tuple[float, Reason]:
    """Weighted square over its expectation, and the reason of a misfit or `NONE`.

    Args:
        residuals: weighted, shape (n,); the mean square of either part is 1.
    """
    n = len(residuals)
    left = max(2 * n - parameters, 1)
    square = float(np.sum(np.abs(residuals) ** 2))
    excess = square / left
    chance = math.sqrt(n * weights.spread) / weights.mean / left
    together = float(np.real(np.sum(residuals[1:] * np.conj(residuals[:-1])))) / max(square, 1e-300)
    # For white residuals `together` has the standard deviation 1 / sqrt(2 n), less after a fit.
    alike = together * math.sqrt(2.0 * n)
    if excess > MOST_EXCESS and excess > 1.0 + SURE * chance:
        return excess, LARGE_RESIDUALS(times=excess)
    if alike > SURE and excess > 1.0 + SURE * chance:
        return excess, ALIKE_RESIDUALS(correlation=together)
    return excess, NONE
