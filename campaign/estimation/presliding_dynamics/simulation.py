"""Response of a plant below breakaway to a sampled torque: an exponential integrator.

Below breakaway the equations are linear except for the yielding of the bristles,
n = sigma0 |v| z / s. The solution of the linear part is exact for all poles. Torque and yielding
are parabolas over each step (exponential collocation at the ends and the middle of a step,
Hochbruck and Ostermann, Acta Numerica 19, 2010, section 2). Between samples the torque is a spline.

Checked against Radau at a tolerance of 1e-9: with the step of `steps_per_sample` the rate is within
1e-4 of its largest value (tests/estimation/test_presliding_dynamics.py).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from campaign.arrays import Array
from campaign.estimation.presliding_dynamics.plant import Plant
from campaign.physics.compilation import called, compiled

FINEST = 0.25
"""Largest step times the fastest relevant frequency (rad)."""
ORDER = 5
"""Order of the spline through the torque: at 0.15 of the sampling rate the error of a cubic one is
1e-3, and that of an inertia fitted with it 4e-4."""
PASSES = 3
"""Iterations of the yielding in each step; few, because it is small below breakaway."""


@dataclass(frozen=True)
class Motion:
    """A simulated motion, on a grid of the sampling step over `per_sample`.

    Attributes:
        step: of the grid (s); the grid begins at time 0.
        per_sample: grid steps per sample.
        angle, rate, acceleration: of the load (rad, rad/s, rad/s^2), shape (k,).
        bristle_torque: sigma0 z, shape (k, interfaces) (N m).
    """

    step: float
    per_sample: int
    angle: Array
    rate: Array
    acceleration: Array
    bristle_torque: Array

    def rate_at(self, delay: float) -> Array:
        """Rate at `delay` (s) before each sample, shape (n,): cubic Hermite."""
        return self._at(self.rate, self.acceleration, delay)

    def angle_at(self, delay: float) -> Array:
        """Angle at `delay` (s) before each sample, shape (n,)."""
        return self._at(self.angle, self.rate, delay)

    def _at(self, values: Array, slopes: Array, delay: float) -> Array:
        count = (len(values) - 1) // self.per_sample + 1
        place = np.arange(count) * float(self.per_sample) - delay / self.step
        place = np.clip(place, 0.0, len(values) - 1.0)
        left = np.minimum(place.astype(np.intp), len(values) - 2)
        x = place - left
        with np.errstate(invalid="ignore", over="ignore"):  # for a diverged motion
            rise = values[left + 1] - values[left]
            m0, m1 = slopes[left] * self.step, slopes[left + 1] * self.step
            turned = (1.0 - x) * x * ((1.0 - x) * (m0 - rise) - x * (m1 - rise))
            return np.asarray(values[left] + x * rise + turned)


def steps_per_sample(plant: Plant, sample_step: float, highest: float) -> int:
    """Grid steps per sample that resolve the plant and a torque of up to `highest` (Hz)."""
    fastest = 2.0 * np.pi * max(2.0 * plant.natural_frequency, highest)
    return max(1, int(np.ceil(fastest * sample_step / FINEST)))


def torque_on_grid(torque: Array, per_sample: int) -> Array:
    """Torque at beginning, middle and end of each grid step, shape (steps, 3)."""
    from scipy.interpolate import make_interp_spline

    steps = (len(torque) - 1) * per_sample
    fine = np.arange(2 * steps + 1) / (2.0 * per_sample)
    values = make_interp_spline(np.arange(len(torque)), torque, k=ORDER)(fine)
    return np.ascontiguousarray(np.column_stack([values[:-2:2], values[1::2], values[2::2]]))


def simulate(
    plant: Plant,
    torque: Array,
    sample_step: float,
    *,
    per_sample: int = 1,
    bristle_torque: Array | float | None = None,
    rate: float = 0.0,
) -> Motion:
    """Motion for `torque` of `torque_on_grid` (N m), shape (steps, 3), from angle 0.

    bristle_torque: initial sigma0 z of each interface (N m); a number: their sum, divided in
    proportion to stiffness; None: equal to the first torque. rate: initial rate (rad/s).
    Samples of a diverged motion are infinite or NaN.
    """
    system = _System.of(plant)
    step = sample_step / per_sample
    half, to_middle = system.held(0.5 * step, step)
    whole, to_end = system.held(step, step)
    state = np.zeros(system.size)
    state[1] = rate
    total = torque[0, 0] if bristle_torque is None else bristle_torque
    shares = np.array([each.stiffness for each in plant.bristles])
    bent = np.full(len(shares), total / plant.stiffness) if np.ndim(total) == 0 else total / shares
    state[2 : 2 + len(shares)] = bent
    states = np.empty((len(torque) + 1, system.size))
    yields = np.empty((len(torque) + 1, len(shares)))
    table = np.array(
        [
            (b.stiffness * b.compliance, b.coulomb_share, 1.0 / b.stribeck_velocity,
             b.stribeck_exponent)
            for b in plant.bristles
        ]
    )  # fmt: skip
    _run(table, state, torque, half, to_middle, whole, to_end, states, yields)
    applied = np.append(torque[:, 0], torque[-1, 2])
    with np.errstate(over="ignore", invalid="ignore"):  # for a diverged motion
        acceleration = states @ system.linear[1] + system.inputs[1, 0] * applied
        acceleration += yields @ system.inputs[1, 1:]
    return Motion(
        step,
        per_sample,
        states[:, 0],
        states[:, 1],
        acceleration,
        states[:, 2 : 2 + len(shares)] * shares,
    )


@dataclass(frozen=True)
class _System:
    """dx/dt = linear x + inputs (T, n_1, ...), x = (q, v, z_1, ..., appendage's angle and rate)."""

    linear: Array
    inputs: Array

    @property
    def size(self) -> int:
        return len(self.linear)

    @classmethod
    def of(cls, plant: Plant) -> _System:
        count = len(plant.bristles)
        part = plant.appendage
        size = 2 + count + (2 if part else 0)
        load = plant.inertia - (part.inertia if part else 0.0)
        linear, inputs = np.zeros((size, size)), np.zeros((size, 1 + count))
        linear[0, 1] = 1.0
        inputs[1, 0] = 1.0 / load
        linear[1, 1] = -(plant.viscous + sum(each.damping for each in plant.bristles)) / load
        for index, each in enumerate(plant.bristles):
            linear[1, 2 + index] = -each.stiffness / load
            linear[2 + index, 1] = 1.0
            inputs[1, 1 + index] = each.damping / load
            inputs[2 + index, 1 + index] = -1.0
        if part:
            # Angle and rate of the appendage relative to the load.
            omega = 2.0 * np.pi * part.frequency
            stiffness, damping = part.inertia * omega**2, 2.0 * part.damping_ratio * omega
            linear[1, -2:] = stiffness / load, damping * part.inertia / load
            linear[-2, -1] = 1.0
            linear[-1] = -linear[1]
            linear[-1, -2:] -= omega**2, damping
            inputs[-1] = -inputs[1]
        return cls(linear, inputs)

    def held(self, until: float, step: float) -> tuple[Array, Array]:
        """Transition over `until`, shape (m, m), and effect of the inputs, (3, m, 1 + n).

        The inputs are parabolas through their values at 0, step / 2 and step.
        """
        from scipy.linalg import expm

        m, k = self.inputs.shape
        chain = np.zeros((m + 3 * k, m + 3 * k))  # the inputs as states: 1, t, t^2 / 2
        chain[:m, :m], chain[:m, m : m + k] = self.linear, self.inputs
        chain[m : m + 2 * k, m + k :] = np.eye(2 * k)
        whole = expm(chain * until)
        one, linear, square = (whole[:m, m + i * k : m + (i + 1) * k] / step**i for i in range(3))
        square = 2.0 * square
        nodes = (
            one - 3.0 * linear + 2.0 * square,
            4.0 * (linear - square),
            2.0 * square - linear,
        )
        return np.ascontiguousarray(whole[:m, :m]), np.ascontiguousarray(nodes)


@compiled
def _run(
    table: Array,
    state: Array,
    torque: Array,
    half: Array,
    to_middle: Array,
    whole: Array,
    to_end: Array,
    states: Array,
    yields: Array,
) -> None:
    """Advance `state` through all steps and fill `states` and `yields`.

    table: per interface sigma0 / Ts, Tc / Ts, 1 / vs and delta, shape (k, 4); half, whole:
    transitions (m, m); to_middle, to_end: effect of the inputs at the beginning, middle and end of
    a step, shape (3, m, 1 + k).
    """
    size, count = len(state), len(table)
    begin, middle, end = np.empty(count), np.empty(count), np.empty(count)
    free_middle, free_end = np.empty(size), np.empty(size)
    x_middle, x_end = np.empty(size), np.empty(size)
    for i in range(count):
        begin[i] = _yielding(table[i], state[1], state[2 + i])
        states[0] = state
        yields[0, i] = begin[i]
    for index in range(len(torque)):
        _freely(half, to_middle, state, torque[index], begin, free_middle)
        _freely(whole, to_end, state, torque[index], begin, free_end)
        for i in range(count):
            middle[i] = end[i] = begin[i]
        for _ in range(PASSES):
            for r in range(size):
                a, b = free_middle[r], free_end[r]
                for i in range(count):
                    a += to_middle[1, r, 1 + i] * middle[i] + to_middle[2, r, 1 + i] * end[i]
                    b += to_end[1, r, 1 + i] * middle[i] + to_end[2, r, 1 + i] * end[i]
                x_middle[r], x_end[r] = a, b
            for i in range(count):
                middle[i] = _yielding(table[i], x_middle[1], x_middle[2 + i])
                end[i] = _yielding(table[i], x_end[1], x_end[2 + i])
        for r in range(size):
            state[r] = x_end[r]
            states[index + 1, r] = x_end[r]
        for i in range(count):
            begin[i] = end[i]
            yields[index + 1, i] = end[i]


@called
def _freely(
    held: Array, inputs: Array, state: Array, torque: Array, begin: Array, found: Array
) -> None:
    """Fill `found` with the state from torque and the yielding at the beginning of the step."""
    for r in range(len(state)):
        total = 0.0
        for c in range(len(state)):
            total += held[r, c] * state[c]
        for node in range(3):
            total += inputs[node, r, 0] * torque[node]
        for i in range(len(begin)):
            total += inputs[0, r, 1 + i] * begin[i]
        found[r] = total


@called
def _yielding(row: Array, rate: float, bent: float) -> Any:
    """sigma0 |v| z / s(v) (rad/s)."""
    speed = abs(rate)
    share = row[1]
    if share != 1.0:
        share += (1.0 - share) * math.exp(-((speed * row[2]) ** row[3]))
    return row[0] * speed * bent / share
