"""A response between its measured points: log L over log frequency, with errors.

The logarithm of an open loop is smooth, also where the closed loop has a resonance. Noise causes
the same error of its real part (log magnitude) and imaginary part (phase). The same is assumed for
the scatter of friction, although that shifts the phase of small motions more. All readings between
points use this module, so that noise and interpolation are estimated in one place.

The model is a parabola plus a random function with a Matérn covariance of order 3/2, which has a
slope but no curvature: friction, small modes and an amplitude that begins to fall bend a response
more sharply than polynomials. The points around a place determine three parameters: size and length
of the random part, and the scatter of points beside their noise (friction differs between trials).
Every combination has its likelihood as weight, so that their uncertainty widens the interval
(Rasmussen and Williams, "Gaussian Processes for Machine Learning" (2006), sections 2.7, 4.2 and
5.4).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from campaign.arrays import Array, ComplexArray
from campaign.estimation.frequency_response import Response

WIDEST = 1.3
"""Half-width of a fit's window, in the logarithm of frequency: a factor of 3.7."""
MOST = 9
"""Most points of a fit, the nearest, because smoothness is local. Of 24 points, 0.5 Hz apart, some
lie on a mode at 11 Hz, and made an interval at 7 Hz 28 times as wide."""
FEWEST = 2
"""Fewest points for a reading."""
TREND = 3
"""Coefficients of the parabola, with a flat prior."""
LENGTHS = np.geomspace(0.15, 4.0, 6)
"""Lengths of the random part, in the logarithm of frequency."""
SIZES = np.geomspace(1e-5, 3.0, 14)
"""Standard deviations of the random part, in log L."""
SCATTERS = (0.0, *2e-4 * 2.0 ** np.arange(11))
"""Standard deviations of log L between points, besides the noise of each."""
EXACT = 1e-6
"""Least standard deviation of log L of a point: the resolution of the factorization."""
NEGLIGIBLE = 0.01
"""Likelihood over the largest below which a combination is not used."""
FRICTION = 5e-4
"""Standard deviation of log L that the scatter of points does not show: friction responds to sensor
noise, so that a loop with noise has a larger lag: on 21 benches with friction by 0.5e-4 to 6.5e-4
rad of phase."""
STEPS = 64
"""Steps of the place of a crossing before its refinement."""


@dataclass(frozen=True)
class LocalFit:
    """Log L around a place: a mean of g Gaussian processes through n points with q coefficients.

    Attributes:
        centre: log frequency of that place.
        points: log frequency less `centre`, shape (n,).
        share: weight of each process in the mean, its likelihood, shape (g,).
        length, size: of its random part, shape (g,).
        scatter: variance of each point besides its noise, shape (g,).
        noise: variance of each point by its own noise, shape (n,).
        trend: complex coefficients of the parabola, lowest power first, shape (g, q).
        rest: inverse covariance times residuals of the parabola, complex, shape (g, n).
        inverse: of the covariance of the points, shape (g, n, n).
        information: on the coefficients, HᵀK⁻¹H, shape (g, q, q).
    """

    centre: float
    points: Array
    share: Array
    length: Array
    size: Array
    scatter: Array
    noise: Array
    trend: ComplexArray
    rest: ComplexArray
    inverse: Array
    information: Array

    def value(self, log_frequency: Array) -> ComplexArray:
        """Log L, shape (m,)."""
        return np.asarray(self.share @ self._means(log_frequency - self.centre))

    def at(self, log_frequency: float) -> tuple[complex, complex, float, float]:
        """Log L, its slope, and the standard deviations of each of its two parts.

        The first deviation is by noise, the second by the curve between the points and by their
        scatter besides noise.
        """
        step = 1e-4
        x = log_frequency - self.centre + step * np.array([-1.0, 0.0, 1.0])
        means = self._means(x)
        before, here, after = self.share @ means
        near, powers = self._covariance(x[1:2])[:, 0], _powers(x[1:2], self.trend.shape[1])[0]
        weights = np.einsum("gij,gj->gi", self.inverse, near)
        basis = _powers(self.points, len(powers))
        left = powers - weights @ basis
        known = np.linalg.solve(self.information, left[:, :, None])[:, :, 0]
        weights += np.einsum("gij,jq,gq->gi", self.inverse, basis, known)
        noise = np.sum(weights**2 * self.noise, axis=1)
        scatter = np.sum(weights**2, axis=1) * self.scatter
        signal = self._covariance(self.points)
        between = self.size**2 - 2.0 * np.sum(weights * near, axis=1)
        between += np.einsum("gi,gij,gj->g", weights, signal, weights)
        apart = 0.5 * np.abs(means[:, 1] - here) ** 2  # of each part: half of the square
        gap = self.share @ (np.maximum(between, 0.0) + scatter + apart)
        slope = complex(after - before) / (2.0 * step)
        return complex(here), slope, math.sqrt(self.share @ noise), math.sqrt(gap)

    def sizes(self, loop: Response) -> Array:
        """|L| at all points of the response, shape (k,): fitted within the fit's points."""
        x = np.log(loop.frequency) - self.centre
        inside = (x >= self.points[0]) & (x <= self.points[-1])
        smooth = loop.size.copy()
        smooth[inside] = np.exp(self.value(x[inside] + self.centre).real)
        return smooth

    def _means(self, x: Array) -> ComplexArray:
        """Mean of each process at `x`, shape (g, m)."""
        parabola = self.trend @ _powers(x, self.trend.shape[1]).T
        return np.asarray(parabola + np.einsum("gmn,gn->gm", self._covariance(x), self.rest))

    def _covariance(self, x: Array) -> Array:
        """Covariance of the random parts at `x` and at the points, shape (g, m, n)."""
        apart = np.abs(x[:, None] - self.points)
        return np.asarray(self.size[:, None, None] ** 2 * _matern(apart, self.length))


def _powers(x: Array, count: int) -> Array:
    return np.vander(x, count, increasing=True)


def _matern(distance: Array, length: Array) -> Array:
    """Correlation of order 3/2 for each length (k,), shape (k, ...)."""
    scaled = math.sqrt(3.0) * distance / length.reshape(-1, *[1] * distance.ndim)
    return np.asarray((1.0 + scaled) * np.exp(-scaled))


def fitted(loop: Response, at: float, size: Array | None = None) -> LocalFit:
    """Fit of the curve around `at` (log frequency), from the points nearest to it.

    `size`: |L| at the points, for their relative errors; default: the size of the response.
    Restricted likelihood (without the parabola) weights the parameters of the random part; their
    prior is uniform on the grid. Raises ValueError for fewer than `FEWEST` points.
    """
    if len(loop.frequency) < FEWEST:
        raise ValueError(f"fewer than {FEWEST} points")
    distance = np.abs(np.log(loop.frequency) - at)
    near = np.argsort(distance, kind="stable")[:MOST]
    near = np.sort(near[: max(2 * TREND, np.count_nonzero(distance[near] < WIDEST))])
    x = np.log(loop.frequency[near]) - at
    logarithm = np.log(np.abs(loop.values[near])) + 1j * loop.phase[near]
    basis = _powers(x, min(TREND, len(x) - 1))
    pairs = np.array(list(itertools.product(LENGTHS, SCATTERS)))
    noise = (loop.error / (loop.size if size is None else size))[near] ** 2
    scatter = pairs[:, 1] ** 2 + EXACT**2
    variance = noise + scatter[:, None]
    # One decomposition of the noise-weighted correlation serves all sizes.
    weight = 1.0 / np.sqrt(variance)
    correlation = _matern(np.abs(x[:, None] - x), pairs[:, 0])
    own, modes = np.linalg.eigh(correlation * weight[:, :, None] * weight[:, None, :])
    columns = np.column_stack([basis, logarithm.real, logarithm.imag])
    turned = np.einsum("gji,gjc->gic", modes, weight[:, :, None] * columns)
    shrink = 1.0 / (1.0 + SIZES[:, None] ** 2 * np.maximum(own, 0.0)[:, None, :])
    square = np.einsum("gsn,gni,gnj->gsij", shrink, turned, turned, optimize=True)
    q = basis.shape[1]
    information, across = square[..., :q, :q], square[..., :q, q:]
    trend = np.linalg.solve(information, across)
    left = np.trace(square[..., q:, q:], axis1=-2, axis2=-1) - np.sum(across * trend, axis=(-2, -1))
    spread = np.sum(np.log(variance), axis=1)[:, None] - np.sum(np.log(shrink), axis=-1)
    # Real and imaginary part: the determinants count twice, without the factor 1/2.
    likelihood = -0.5 * left - spread - np.linalg.slogdet(information)[1]
    share = np.exp(likelihood - np.max(likelihood))
    pair, which = np.nonzero(share > NEGLIGIBLE)
    kept = share[pair, which]
    root = modes[pair] * weight[pair][:, :, None]
    inverse = np.einsum("gik,gk,gjk->gij", root, shrink[pair, which], root, optimize=True)
    coefficients = trend[pair, which, :, 0] + 1j * trend[pair, which, :, 1]
    return LocalFit(
        at,
        x,
        kept / np.sum(kept),
        pairs[pair, 0],
        SIZES[which],
        scatter[pair],
        noise,
        coefficients,
        np.einsum("gij,gj->gi", inverse, logarithm - coefficients @ basis.T),
        inverse,
        information[pair, which],
    )


@dataclass(frozen=True)
class Reading:
    """Log frequency at which log L meets a condition, and a value there.

    Attributes:
        log_frequency, value: the two numbers.
        frequency_error, value_error: standard deviations by noise.
        frequency_gap, value_gap: standard deviations by interpolation and friction.
    """

    log_frequency: float
    value: float
    frequency_error: float
    value_error: float
    frequency_gap: float
    value_gap: float


Quantity = Callable[[ComplexArray], Array]
"""Real function of log L, such as its imaginary part; the real part of an analytic function."""


def read(
    loop: Response, place: tuple[float, float], zero: Quantity, value: Quantity
) -> Reading | None:
    """Zero of `zero` of log L between two log frequencies, and `value` there.

    None where a local fit has no zero in or next to `place`. Raises ValueError for too few points.
    """
    rough = fitted(loop, 0.5 * (place[0] + place[1]))
    at = _vanishing(rough, place, zero)
    if at is None:
        return None
    fit = fitted(loop, at, rough.sizes(loop))
    at = _vanishing(fit, place, zero)
    if at is None:
        return None
    logarithm, slope, noise, between = fit.at(at)
    gap = math.hypot(between, FRICTION)
    number, along, across = _sensitivity(logarithm, slope, zero, value)
    return Reading(at, number, along * noise, across * noise, along * gap, across * gap)


def _vanishing(fit: LocalFit, place: tuple[float, float], zero: Quantity) -> float | None:
    """Zero of `zero` nearest to the middle of `place`, searched one width beyond both ends."""
    low, high = place
    middle, width = 0.5 * (low + high), max(high - low, 1e-3)
    grid = np.linspace(low - width, high + width, 3 * STEPS)
    for _ in range(3):
        level = zero(fit.value(grid))
        at = np.flatnonzero((level[:-1] > 0) != (level[1:] > 0))
        if not at.size:
            return None
        share = level[at] / (level[at] - level[at + 1])
        zeros = grid[at] + share * (grid[at + 1] - grid[at])
        best = int(np.argmin(np.abs(zeros - middle)))
        middle = float(zeros[best])
        step = grid[1] - grid[0]
        grid = np.linspace(grid[at[best]] - 1e-3 * step, grid[at[best] + 1] + 1e-3 * step, 9)
    return middle


def _sensitivity(
    logarithm: complex, slope: complex, zero: Quantity, value: Quantity
) -> tuple[float, float, float]:
    """`value`, and the factors from an error of log L to those of log frequency and value.

    For independent errors of the same standard deviation in both parts of log L.
    """
    step = 1e-6
    moved = np.array([logarithm, logarithm + step, logarithm + 1j * step])

    def gradient(quantity: Quantity) -> tuple[float, float, float]:
        at = quantity(moved)
        return float(at[0]), float(at[1] - at[0]) / step, float(at[2] - at[0]) / step

    _, zero_re, zero_im = gradient(zero)
    number, value_re, value_im = gradient(value)
    zero_slope = zero_re * slope.real + zero_im * slope.imag
    along = (value_re * slope.real + value_im * slope.imag) / zero_slope
    moves = math.hypot(zero_re, zero_im) / abs(zero_slope)
    return number, moves, math.hypot(value_re - along * zero_re, value_im - along * zero_im)
