"""Fourier series of an angle, optimized for inverse dynamics.

The coefficients minimize the condition number of the model's columns, within limits on angle, rate
and acceleration (Swevers, Ganseman, Tükel, De Schutter and Van Brussel, "Optimal robot excitation
and identification", IEEE Trans. Robot. Autom. 13 (1997) 730). Columns are scaled to unit length,
so that the result is independent of units. The series is as large as the limits allow.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from campaign.arrays import Array
from campaign.estimation.inverse.motion import Motion
from campaign.estimation.inverse.terms import TERMS
from campaign.signals import MultiSine

PER_CYCLE = 64
"""Points per cycle of the highest harmonic, at which a series is evaluated."""
STILL = 0.02
"""Share of the largest rate below which samples do not count, as friction equals the force."""
POPULATION = 40
"""Number of series in the population of the search."""
SCALES, CROSSED = (0.4, 0.9), 0.9
"""Differential evolution: range of the scale factor, and crossover probability."""


@dataclass(frozen=True)
class Room:
    """Largest magnitudes of a series; rad, rad/s, rad/s^2, or m for a linear axis.

    angle: largest distance from the middle.
    """

    angle: float
    rate: float
    acceleration: float


@dataclass(frozen=True)
class FourierSeries:
    """sum of sine[k] sin(2 pi (k+1) t / period) + cosine[k] cos(2 pi (k+1) t / period).

    Attributes:
        period: (s).
        sine, cosine: of the angle (rad), each of shape (harmonics,).
    """

    period: float
    sine: tuple[float, ...]
    cosine: tuple[float, ...]

    def sample(self, time: Array, order: int = 0) -> Array:
        """Angle (rad) or its `order`-th derivative at `time` (s), shape (n,)."""
        omega = 2.0 * np.pi * np.arange(1.0, len(self.sine) + 1.0) / self.period
        turned = np.outer(time, omega) + 0.5 * np.pi * order
        sized = omega**order
        return np.asarray(
            np.sin(turned) @ (sized * self.sine) + np.cos(turned) @ (sized * self.cosine)
        )

    @property
    def rate(self) -> MultiSine:
        """First derivative as a signal (rad/s)."""
        sine, cosine = np.array(self.sine), np.array(self.cosine)
        harmonic = np.arange(1.0, len(sine) + 1.0)
        size = np.hypot(sine, cosine) * 2.0 * np.pi * harmonic / self.period
        return MultiSine(
            amplitudes=tuple(map(float, size)),
            frequencies=tuple(float(f"{k / self.period:.12g}") for k in harmonic),
            phases=tuple(map(float, np.arctan2(sine, -cosine))),
        )

    def motion(self, middle: float = 0.0) -> Motion:
        """One period around `middle`, on a grid with an error of extremes of at most 0.12 %."""
        time = _grid(len(self.sine)) * self.period
        angle, rate, acceleration = (self.sample(time, order) for order in range(3))
        return Motion(time, middle + angle, rate, acceleration, np.zeros_like(time))


def _grid(harmonics: int) -> Array:
    """Shares of a period."""
    count = PER_CYCLE * harmonics
    return np.arange(count) / count


def condition(motion: Motion, terms: Sequence[str]) -> float:
    """Condition number of the terms' columns at unit length; infinite for a column of zeros.

    Samples slower than `STILL` of the largest rate do not count.
    """
    columns = np.stack([TERMS[name].column(motion) for name in terms], axis=-1)
    return float(_conditions((columns * _moves(motion.rate)[:, None])[None])[0])


def _moves(rate: Array) -> Array:
    """1 where a series moves, 0 at standstill, shape of `rate` (..., n)."""
    size = np.abs(rate)
    return np.asarray(size >= STILL * np.max(size, axis=-1, keepdims=True), dtype=float)


def _conditions(columns: Array) -> Array:
    """Condition numbers, shape (p,), of p sets of columns, shape (p, n, k)."""
    length = np.linalg.norm(columns, axis=1)
    alike = np.einsum("pnk,pnl->pkl", columns, columns)
    product = length[:, :, None] * length[:, None, :]
    whole = np.all(length > 0, axis=1)
    numbers = np.full(len(columns), np.inf)
    values = np.linalg.eigvalsh(alike[whole] / product[whole])
    with np.errstate(divide="ignore"):
        numbers[whole] = np.sqrt(values[:, -1] / np.maximum(values[:, 0], 0.0))
    return numbers


@lru_cache(maxsize=32)  # a plan uses the same series many times
def best_series(
    period: float,
    harmonics: int,
    terms: tuple[str, ...],
    room: Room,
    middle: float,
    generations: int,
    seed: int,
) -> FourierSeries:
    """Series with the lowest condition number in a seeded search.

    Differential evolution (Storn and Price, J. Global Optim. 11 (1997) 341) from random series.
    Initial rate and acceleration are zero, so that a bench at rest has no jerk.

    Args:
        terms: names of the model's terms (`estimation.inverse.terms`).
        middle: middle angle of the motion (rad), on which gravity depends.

    Raises ValueError for fewer than two harmonics, no room, an unknown term, and terms that no
    motion separates.
    """
    unknown = [name for name in terms if name not in TERMS or "temperature" in name]
    if unknown:
        known = ", ".join(name for name in TERMS if "temperature" not in name)
        raise ValueError(f"there is no term {unknown[0][:60]!r} to excite; there are {known}")
    if harmonics < 2:
        raise ValueError("one harmonic cannot begin at rest: two are the fewest")
    if not min(room.angle, room.rate, room.acceleration) > 0:
        raise ValueError("the limits leave no room to move")
    random = np.random.default_rng(seed)
    size = 2 * harmonics
    best = _allowed(random.standard_normal((POPULATION, size)), period, room)
    scores = _scores(best, terms, period, middle)
    for _ in range(generations):
        one, two = (best[random.permutation(POPULATION)] for _ in range(2))
        scale = random.uniform(*SCALES, (POPULATION, 1))
        towards = best[int(np.argmin(scores))] - best
        tried = best + scale * (towards + one - two)
        kept = random.uniform(size=(POPULATION, size)) > CROSSED
        tried = _allowed(np.where(kept, best, tried), period, room)
        fresh = _scores(tried, terms, period, middle)
        better = fresh < scores
        best[better], scores[better] = tried[better], fresh[better]
    if not np.isfinite(np.min(scores)) or np.min(scores) > 1e6:
        raise ValueError(f"no motion separates {', '.join(terms)}: leave out one of them")
    sine, cosine = np.split(best[int(np.argmin(scores))], 2)
    return FourierSeries(period, tuple(map(float, sine)), tuple(map(float, cosine)))


def _allowed(coefficients: Array, period: float, room: Room) -> Array:
    """Nearest series that begin at rest, scaled to the limits, shape (p, 2 harmonics)."""
    half = coefficients.shape[1] // 2
    harmonic = np.arange(1.0, half + 1.0)
    sine, cosine = coefficients[:, :half], coefficients[:, half:]
    # Initial rate 0: sum of k sine[k] = 0; initial acceleration 0: sum of k^2 cosine[k] = 0.
    sine = sine - np.outer(sine @ harmonic, harmonic) / np.sum(harmonic**2)
    cosine = cosine - np.outer(cosine @ harmonic**2, harmonic**2) / np.sum(harmonic**4)
    rested = np.concatenate([sine, cosine], axis=1)
    bounds = (room.angle, room.rate, room.acceleration)
    peaks = [np.max(np.abs(each), axis=1) for each in _path(rested, period)]
    # Upper bound of the values between the points of the grid (Ehlich and Zeller 1964).
    between = 1.0 / math.cos(math.pi / PER_CYCLE)
    used = np.max([between * p / bound for p, bound in zip(peaks, bounds, strict=True)], axis=0)
    return np.asarray(rested / np.maximum(used, 1e-300)[:, None])


def _path(coefficients: Array, period: float) -> tuple[Array, Array, Array]:
    """Angle, rate and acceleration of p series on the grid, each of shape (p, n)."""
    half = coefficients.shape[1] // 2
    omega = 2.0 * np.pi * np.arange(1.0, half + 1.0) / period
    turned = np.outer(omega * period, _grid(half))
    sine, cosine = np.sin(turned), np.cos(turned)
    a, b = coefficients[:, :half], coefficients[:, half:]
    rate = (a * omega) @ cosine - (b * omega) @ sine
    return a @ sine + b @ cosine, rate, -((a * omega**2) @ sine + (b * omega**2) @ cosine)


def _scores(coefficients: Array, terms: Sequence[str], period: float, middle: float) -> Array:
    angle, rate, acceleration = _path(coefficients, period)
    moved = Motion(np.zeros(0), middle + angle, rate, acceleration, np.zeros(0))
    columns = np.stack([TERMS[name].column(moved) for name in terms], axis=-1)
    return _conditions(columns * _moves(rate)[..., None])
