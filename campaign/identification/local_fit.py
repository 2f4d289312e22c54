"""A response between its measured points: polynomials of log L over log frequency, with errors.

The logarithm of an open loop is smooth where the closed loop may have a resonance, and its real
part (log magnitude) and imaginary part (phase) have the same error. All that is read between points
is read from here, so that noise and interpolation are judged in one place.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from campaign.identification.frequency_response import Array, ComplexArray, Response

COUNTS = (25, 21, 17, 13, 10, 8, 7, 6, 5)
"""Points that a local fit may take: the most that its polynomial describes."""
WIDEST = 0.5
"""Half-width of a fit's window, in the logarithm of frequency: a factor of 1.65."""
DEGREE = 2
MISFIT = 0.75
"""Standard deviations by which chi-square over its freedom may pass 1."""
BEND = 1.5
"""Second derivative of log L over log frequency that may hide between two points h apart, where it
moves log L by up to h^2/8 times this: friction and small modes bend a response so that no
polynomial through far points shows it. 22 points from 1 to 300 Hz need 1.1 on `platform`."""
NOISE_SHARE = 0.5
"""of the variance of a difference of two fits that is not counted as interpolation."""
FEWEST = 2
"""Points below which nothing is read between them."""
STEPS = 64
"""into which the place of a crossing is cut before it is refined."""


@dataclass(frozen=True)
class LocalFit:
    """A polynomial of log L in x = log(frequency) - `centre`.

    Attributes:
        coefficients: complex, shape (degree + 1,), lowest power first.
        covariance: of the real and likewise of the imaginary parts, shape (degree + 1,) * 2.
        misfit: chi-square over its freedom; 1 where nothing is left over.
    """

    centre: float
    coefficients: ComplexArray
    covariance: Array
    misfit: float

    def value(self, log_frequency: Array) -> ComplexArray:
        """Log L, shape (n,)."""
        x = log_frequency - self.centre
        return np.asarray(np.polynomial.polynomial.polyval(x, self.coefficients))

    def at(self, log_frequency: float) -> tuple[complex, complex, float]:
        """Log L, its slope, and the standard deviation of each of its two parts from noise."""
        x = log_frequency - self.centre
        slope = np.polynomial.polynomial.polyder(self.coefficients)
        powers = x ** np.arange(len(self.coefficients))
        error = math.sqrt(max(float(powers @ self.covariance @ powers), 0.0))
        evaluate = np.polynomial.polynomial.polyval
        return complex(evaluate(x, self.coefficients)), complex(evaluate(x, slope)), error


def fitted(loop: Response, at: float, count: int, degree: int) -> LocalFit:
    """The polynomial through, or between, the `count` points nearest to `at` (log frequency).

    Weights follow from the fitted size, not from the measured one: a point that noise makes large
    would else seem surer than one that noise makes small.
    """
    x: Array = np.log(loop.frequency)
    near = np.sort(np.argsort(np.abs(x - at), kind="stable")[:count])
    x, error, size = x[near] - at, loop.error[near], np.abs(loop.values[near])
    logarithm = np.log(size) + 1j * loop.phase[near]
    basis = np.vander(x, degree + 1, increasing=True)
    freedom = 2 * (len(x) - degree - 1)
    known = bool(np.any(error > 0))
    for _ in range(3 if known and freedom > 0 else 1):
        weight = size / np.maximum(error, 1e-6 * np.max(error)) if known else np.ones(len(x))
        scale = np.linalg.norm(basis * weight[:, None], axis=0)
        inverse = np.linalg.pinv(basis * weight[:, None] / scale) / scale[:, None]
        found = inverse @ (logarithm * weight)
        size = np.exp((basis @ found).real)
    if not known:  # nothing is said of noise: whatever is left over is misfit
        return LocalFit(at, found, np.zeros_like(inverse @ inverse.T), np.inf if freedom else 1.0)
    left = np.sum(np.abs((logarithm - basis @ found) * weight) ** 2)
    return LocalFit(at, found, inverse @ inverse.T, float(left) / freedom if freedom else 1.0)


def best_fits(loop: Response, at: float) -> tuple[LocalFit, LocalFit]:
    """The fit to read from around `at` (log frequency), and one that says how far it may be off.

    The first is a parabola of as many points as it describes within their errors, the second one of
    two more degrees. Where points are too far apart for that: polynomials through four and through
    six of them, or as many as there are. Raises ValueError for fewer than `FEWEST` points.
    """
    if len(loop.frequency) < FEWEST:
        raise ValueError(f"fewer than {FEWEST} points")
    distance = np.sort(np.abs(np.log(loop.frequency) - at))
    for count in COUNTS:
        if count > len(distance) or distance[count - 1] > WIDEST:
            continue
        fit = fitted(loop, at, count, DEGREE)
        freedom = 2 * (count - DEGREE - 1)
        if fit.misfit < 1.0 + MISFIT * np.sqrt(2.0 / freedom):
            return fit, fitted(loop, at, count, min(DEGREE + 2, count - 1))
    most = min(6, len(distance))
    few = max(most - 2, 2)
    return fitted(loop, at, few, few - 1), fitted(loop, at, most, most - 1)


@dataclass(frozen=True)
class Reading:
    """A place at which log L meets a condition, and a number read there.

    Attributes:
        log_frequency, value: as read.
        frequency_error, value_error: standard deviations from noise.
        frequency_gap, value_gap: how far the second fit is off the first, less what noise explains.
        frequency_bend, value_bend: how far both may be off by what hides between two points.
    """

    log_frequency: float
    value: float
    frequency_error: float
    value_error: float
    frequency_gap: float
    value_gap: float
    frequency_bend: float
    value_bend: float


Quantity = Callable[[ComplexArray], Array]
"""A real number of log L, e.g. its imaginary part; analytic: the real part of a function of it."""


def read(
    loop: Response, place: tuple[float, float], zero: Quantity, value: Quantity
) -> Reading | None:
    """Where `zero` of log L vanishes between two log frequencies, and `value` there.

    None where a local fit does not vanish in or next to that place. Raises ValueError for too few
    points.
    """
    found = _vanishing(best_fits(loop, 0.5 * (place[0] + place[1]))[0], place, zero)
    if found is None:
        return None
    fit, other = best_fits(loop, found)
    here = _vanishing(fit, place, zero)
    if here is None:
        return None
    bend = BEND / 8.0 * _step(loop, here) ** 2
    first = _told(fit, here, zero, value)
    hidden = _told(fit, here, zero, value, bend)[2:]
    there = _vanishing(other, place, zero)
    if there is None:  # the two do not agree where: then anywhere in that place
        ends = value(fit.value(np.array(place)))
        gaps = place[1] - place[0], abs(float(ends[1] - ends[0]))
    else:
        second = _told(other, there, zero, value)
        gaps = _gap(first, second, 0), _gap(first, second, 1)
    return Reading(*first, *gaps, *hidden)


def _step(loop: Response, at: float) -> float:
    """Distance of the two points around `at`, in the logarithm of frequency."""
    x = np.log(loop.frequency)
    k = int(np.clip(np.searchsorted(x, at), 1, len(x) - 1))
    return float(x[k] - x[k - 1])


Told = tuple[float, float, float, float]
"""Log frequency, value, and the standard deviations of both."""


def _gap(one: Told, other: Told, k: int) -> float:
    """Difference of two nested fits, less half of the variance that noise gives it (Hausman).

    Less all of it, bandwidths of random loops with close points were held in 93 to 94 %.
    """
    noise = max(other[k + 2] ** 2 - one[k + 2] ** 2, 0.0)
    return float(np.sqrt(max((one[k] - other[k]) ** 2 - NOISE_SHARE * noise, 0.0)))


def _vanishing(fit: LocalFit, place: tuple[float, float], zero: Quantity) -> float | None:
    """Where `zero` vanishes nearest to the middle of `place`, a place's width around it."""
    low, high = place
    middle, width = 0.5 * (low + high), max(high - low, 1e-3)
    grid = np.linspace(low - width, high + width, 3 * STEPS)
    for _ in range(3):
        level = zero(fit.value(grid))
        at = np.flatnonzero((level[:-1] > 0) != (level[1:] > 0))
        if not at.size:
            return None
        share = level[at] / (level[at] - level[at + 1])
        found = grid[at] + share * (grid[at + 1] - grid[at])
        best = int(np.argmin(np.abs(found - middle)))
        middle = float(found[best])
        step = grid[1] - grid[0]
        grid = np.linspace(grid[at[best]] - 1e-3 * step, grid[at[best] + 1] + 1e-3 * step, 9)
    return middle


def _told(
    fit: LocalFit, at: float, zero: Quantity, value: Quantity, error: float | None = None
) -> Told:
    """The reading at `at` with what an error of log L, the fit's own or another, does to both."""
    logarithm, slope, own = fit.at(at)
    error = own if error is None else error
    step = 1e-6
    moved = np.array([logarithm, logarithm + step, logarithm + 1j * step])

    def gradient(quantity: Quantity) -> tuple[float, float, float]:
        told = quantity(moved)
        return float(told[0]), float(told[1] - told[0]) / step, float(told[2] - told[0]) / step

    _, zero_re, zero_im = gradient(zero)
    number, value_re, value_im = gradient(value)
    zero_slope = zero_re * slope.real + zero_im * slope.imag
    value_slope = value_re * slope.real + value_im * slope.imag
    along = value_slope / zero_slope
    place_error = error * np.hypot(zero_re, zero_im) / abs(zero_slope)
    value_error = error * np.hypot(value_re - along * zero_re, value_im - along * zero_im)
    return at, number, float(place_error), float(value_error)
