"""Weighted least-squares fit of steady friction over speed (Equation 4.6).

One direction at a time, all numbers positive: T = Tc + (Ts - Tc) exp(-(v / vs)^delta) + sigma2 v.
Ts is not forced above Tc: real axes with Ts < Tc exist.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from campaign.arrays import Array
from campaign.estimation.least_squares import Minimum, covariance, minimum, refuse_too_few

UNITS = {
    "viscous_friction": "N m s/rad",
    "coulomb_torque": "N m",
    "static_torque": "N m",
    "stribeck_velocity": "rad/s",
    "stribeck_exponent": "",
}
PARAMETERS = tuple(UNITS)
SYMBOLS = {
    "viscous_friction": "σ2",
    "coulomb_torque": "Tc",
    "static_torque": "Ts",
    "stribeck_velocity": "vs",
    "stribeck_exponent": "δ",
}
EXPONENTS = (0.2, 5.0)
"""Range of the search for delta."""
BEYOND = 10.0
"""Range of the search for vs: a factor beyond the slowest and the fastest speed."""
STARTS = (24, (0.4, 0.7, 1.0, 1.5, 2.2, 3.3))
"""Grid of starts: number of values of vs, and values of delta."""
TRIED = 2
"""Number of best points of that grid that start a search."""


def stribeck(speed: Array, values: Mapping[str, float]) -> Array:
    """Friction torque (N m) of steady sliding at `speed` >= 0 (rad/s), shape (n,)."""
    fall = np.exp(-((speed / values["stribeck_velocity"]) ** values["stribeck_exponent"]))
    drop = values["static_torque"] - values["coulomb_torque"]
    return np.asarray(values["coulomb_torque"] + drop * fall + values["viscous_friction"] * speed)


@dataclass(frozen=True)
class StribeckFit:
    """Least-squares parameters of one direction of a map.

    Attributes:
        values: all five, by name (SI); without Stribeck effect Ts equals Tc, and vs and delta are
            meaningless start values.
        free: names of the fitted parameters, the rows of `influence`. They include those at a
            bound, whose uncertainty contributes to that of the others.
        bounds: `lower` or `upper`, by name of a parameter at a bound of the search.
        open: names of parameters that the data do not determine at all.
        influence: derivatives of the free parameters by each torque without bounds, H⁻¹JᵀW, shape
            (k, n); H is JᵀWJ, to which `with_misfit` adds the curvature of the misfit.
        residuals: torque minus model (N m), shape (n,).
        deviation: of each torque (N m, 1 sigma), for its weight, shape (n,).
    """

    values: Mapping[str, float]
    free: tuple[str, ...]
    bounds: Mapping[str, str]
    open: tuple[str, ...]
    influence: Array
    residuals: Array
    deviation: Array

    @property
    def chi_square(self) -> float:
        """Sum of squared residuals, each over its deviation."""
        return float(np.sum((self.residuals / self.deviation) ** 2))

    @property
    def rms(self) -> float:
        """Root mean square of the residuals (N m)."""
        return float(np.sqrt(np.mean(self.residuals**2)))

    @property
    def bic(self) -> float:
        """Bayesian information criterion, Gaussian residuals of unknown variance; lower is better.

        Comparable only between fits with the same deviations.
        """
        n = len(self.residuals)
        mean_square = max(self.chi_square / n, np.finfo(float).tiny)
        return n * float(np.log(mean_square)) + len(self.free) * float(np.log(n))

    def variance(self, weights: Mapping[str, float]) -> float:
        """Variance of a weighted sum of parameters; only free ones contribute."""
        w = np.array([weights.get(name, 0.0) for name in self.free])
        return float(w @ self.covariance @ w)

    @property
    def covariance(self) -> Array:
        """Covariance of the free parameters, shape (k, k); (JᵀWJ)⁻¹ without `with_misfit`."""
        weighted = self.influence * self.deviation
        return np.asarray(weighted @ weighted.T)


@dataclass(frozen=True)
class Problem:
    """Torques with their deviations, and bounds of the parameters: equal for one that is held.

    The vector (sigma2 / a, Tc / b, Ts / b, ln vs, ln delta), shape (5,), has numbers of order 1.
    """

    speed: Array
    torque: Array
    deviation: Array
    lower: Array
    upper: Array
    level: float
    slope: float

    @classmethod
    def of(cls, speed: Array, torque: Array, deviation: Array, exponent: float | None) -> Problem:
        """Problem of one direction of a map; `exponent` holds delta."""
        level = float(np.max(np.abs(torque)))
        delta = EXPONENTS if exponent is None else (exponent, exponent)
        lower = [0.0, 0.0, 0.0, np.log(float(speed.min()) / BEYOND), np.log(delta[0])]
        upper = [np.inf, np.inf, np.inf, np.log(float(speed.max()) * BEYOND), np.log(delta[1])]
        slope = level / float(speed.max())
        return cls(speed, torque, deviation, np.array(lower), np.array(upper), level, slope)

    @cached_property
    def log_speed(self) -> Array:
        """Natural logarithm of the speed, shape (n,)."""
        return np.log(self.speed)

    @cached_property
    def weight(self) -> Array:
        """One over the deviation (1/(N m)), shape (n,)."""
        return 1.0 / self.deviation

    @cached_property
    def scale(self) -> Array:
        """Factors of the linear elements of the vector (SI), shape (3,)."""
        return np.array([self.slope, self.level, self.level])

    def __call__(self, vector: Array) -> tuple[Array, Array]:
        """Weighted residuals (n,) and their Jacobian (n, 5), for `minimum`."""
        viscous, coulomb, static = (vector[:3] * self.scale).tolist()
        delta = float(np.exp(vector[4]))
        power = np.exp(delta * (self.log_speed - vector[3]))
        fall = np.exp(-power)
        model = coulomb + (static - coulomb) * fall + viscous * self.speed
        bend = (static - coulomb) * fall * power
        jacobian = np.empty((len(fall), len(PARAMETERS)))
        jacobian[:, 0] = self.slope * self.speed
        jacobian[:, 1] = self.level * (1.0 - fall)
        jacobian[:, 2] = self.level * fall
        jacobian[:, 3] = bend * delta
        jacobian[:, 4] = -bend * np.log(np.maximum(power, 1e-300))
        jacobian *= self.weight[:, None]
        return (model - self.torque) * self.weight, jacobian

    def values(self, vector: Array) -> dict[str, float]:
        """Parameters by name (SI)."""
        natural = np.concatenate([vector[:3] * self.scale, np.exp(vector[3:])])
        return dict(zip(PARAMETERS, natural.tolist(), strict=True))

    def by_parameter(self, vector: Array) -> Array:
        """Derivative of each parameter (SI) by its element of the vector, shape (5,)."""
        return np.concatenate([self.scale, np.exp(vector[3:])])

    def starts(self) -> list[Array]:
        """Best points of a grid of vs and delta, with the linear parameters solved for each."""
        count, exponents = STARTS
        # Within the measured speeds: a search may leave them, but does not start beyond them.
        velocities = np.linspace(np.log(self.speed.min()), np.log(self.speed.max()), count)
        shapes = np.unique(np.clip(np.log(exponents), self.lower[4], self.upper[4]))
        grid = np.stack(np.meshgrid(velocities, shapes, indexing="ij"), axis=-1).reshape(-1, 2)
        power = np.exp(np.exp(grid[:, 1:]) * (np.log(self.speed) - grid[:, :1]))
        fall = np.exp(-power)
        line = np.broadcast_to(self.speed / self.speed.max(), fall.shape)
        design = np.stack([line, 1.0 - fall, fall], axis=2) / self.deviation[:, None]
        target = self.torque / self.level / self.deviation
        square = np.einsum("gni,gnj->gij", design, design)
        square += 1e-12 * np.trace(square, axis1=1, axis2=2)[:, None, None] * np.eye(3)
        linear = np.linalg.solve(square, np.einsum("gni,n->gi", design, target)[:, :, None])[..., 0]
        linear = np.maximum(linear, 0.0)
        cost = np.sum((np.einsum("gni,gi->gn", design, linear) - target) ** 2, axis=1)
        best = np.argsort(cost)[:TRIED]
        return [np.concatenate([linear[i], grid[i]]) for i in best]


def fit_stribeck(
    speed: Array,
    torque: Array,
    deviation: Array | None = None,
    exponent: float | None = None,
    start: Mapping[str, float] | None = None,
    near: Mapping[str, float] | None = None,
) -> StribeckFit:
    """Fit Equation 4.6 to one direction of a map.

    Args:
        speed, torque: positive (rad/s, N m), shape (n,).
        deviation: of the torques (N m, 1 sigma), shape (n,); default: all equal.
        exponent: value of a held delta (2 for the LuGre model); None: delta is fitted.
        start: parameters near the solution, if known; default: a grid is searched.
        near: additional start that may be near the solution: the free fit, where the exponent is
            held. The grid ends at the measured speeds.

    Raises ValueError for no more points than parameters.
    """
    refuse_too_few(len(speed), len(PARAMETERS) - (exponent is not None))
    deviation = np.ones_like(torque) if deviation is None else deviation
    problem = Problem.of(speed, torque, deviation, exponent)
    starts = problem.starts() if start is None else [_vector(problem, start)]
    if near is not None:
        starts.append(np.clip(_vector(problem, near), problem.lower, problem.upper))
    best = min(
        (minimum(problem, each, problem.lower, problem.upper) for each in starts),
        key=lambda solution: solution.cost,
    )
    return _told(problem, best)


def fit_line(speed: Array, torque: Array, deviation: Array) -> StribeckFit:
    """Fit Coulomb and viscous friction without a Stribeck effect; see `fit_stribeck`."""
    refuse_too_few(len(speed), 2)
    problem = Problem.of(speed, torque, deviation, 1.0)
    start = np.array([0.0, 1.0, 1.0, problem.lower[3], 0.0])
    inner = np.array([0, 1])

    def line(pair: Array) -> tuple[Array, Array]:
        vector = np.concatenate([pair, pair[1:], start[3:]])
        residuals, jacobian = problem(vector)
        return residuals, np.stack([jacobian[:, 0], jacobian[:, 1] + jacobian[:, 2]], axis=1)

    solution = minimum(line, start[inner], problem.lower[inner], problem.upper[inner])
    vector = np.concatenate([solution.point, solution.point[1:], start[3:]])
    full = Minimum(vector, solution.residuals, solution.jacobian, solution.held)
    return _told(problem, full, inner)


def held_at(
    found: StribeckFit, speed: Array, torque: Array, name: str, value: float, exponent: float | None
) -> float:
    """Smallest chi-square with one parameter held at `value` (SI): a point of its profile."""
    problem = Problem.of(speed, torque, found.deviation, exponent)
    index = PARAMETERS.index(name)
    held = _vector(problem, {**found.values, name: value})[index]
    held = np.clip(held, problem.lower[index], problem.upper[index])  # as every search
    lower, upper = problem.lower.copy(), problem.upper.copy()
    lower[index] = upper[index] = held
    start = _vector(problem, found.values)
    return minimum(problem, start, lower, upper).cost


def with_misfit(found: StribeckFit, speed: Array, torque: Array) -> StribeckFit:
    """Fit with the influence of each torque for a curve that does not fit the points.

    H is then the whole second derivative of half of chi-square. The covariance H⁻¹JᵀWJH⁻¹ is that
    of the curve of this kind closest to the truth (White, "Maximum likelihood estimation of
    misspecified models", Econometrica 50 (1982)). Unchanged if H is not positive definite.
    """
    held = found.values["stribeck_exponent"]
    problem = Problem.of(speed, torque, found.deviation, held)
    point = _vector(problem, found.values)
    free = np.array([PARAMETERS.index(name) for name in found.free], dtype=int)

    def gradient(vector: Array) -> Array:
        residuals, jacobian = problem(vector)
        return np.asarray((jacobian.T @ residuals)[free])

    step = 1e-5
    shifts = step * np.eye(len(PARAMETERS))[free]
    hessian = np.array([gradient(point + s) - gradient(point - s) for s in shifts]) / (2.0 * step)
    hessian = 0.5 * (hessian + hessian.T)
    if len(free) == 0 or not np.all(np.linalg.eigvalsh(hessian) > 0):
        return found
    _, jacobian = problem(point)
    weighted = np.linalg.solve(hessian, jacobian[:, free].T)
    natural = weighted * problem.by_parameter(point)[free][:, None] / found.deviation
    return replace(found, influence=natural)


def _vector(problem: Problem, values: Mapping[str, float]) -> Array:
    natural = np.array([values[name] for name in PARAMETERS])
    return np.concatenate([natural[:3] / problem.scale, np.log(natural[3:])])


def _told(problem: Problem, found: Minimum, fitted: NDArray[np.int64] | None = None) -> StribeckFit:
    """Fit (SI) from a minimum; `fitted`: elements of the vector in it, default: all not held."""
    point = found.point
    if fitted is None:
        fitted = np.flatnonzero(problem.lower < problem.upper)
        jacobian, held = found.jacobian[:, fitted], found.held[fitted]
    else:
        jacobian, held = found.jacobian, found.held
    natural = jacobian / problem.by_parameter(point)[fitted]
    # A parameter at its bound is included: otherwise it would count as exactly known.
    inverse, left_open = covariance(natural)
    names = np.array(PARAMETERS)
    bounds = {
        str(names[i]): "lower" if point[i] <= problem.lower[i] else "upper" for i in fitted[held]
    }
    return StribeckFit(
        values=problem.values(point),
        free=tuple(names[fitted].tolist()),
        bounds=bounds,
        open=tuple(names[fitted[left_open]].tolist()),
        influence=inverse @ natural.T / problem.deviation,
        residuals=-found.residuals * problem.deviation,
        deviation=problem.deviation,
    )
