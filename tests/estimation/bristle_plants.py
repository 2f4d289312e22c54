"""Plants below breakaway by scipy, on equations written here: the truth of tests of the fit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numba
import numpy as np
from scipy.integrate import solve_ivp

from campaign.arrays import Array

Torque = Callable[[Array], Array]


@dataclass(frozen=True)
class Interface:
    """LuGre: sigma0, sigma1, Ts, Tc, vs, delta."""

    s0: float
    s1: float
    ts: float
    tc: float
    vs: float
    delta: float = 2.0


@dataclass(frozen=True)
class Truth:
    """Inertia, sigma2, interfaces; appendage as inertia, frequency (Hz), damping ratio."""

    inertia: float
    s2: float
    interfaces: tuple[Interface, ...]
    appendage: tuple[float, float, float] | None = None

    def slope(self, time: float, state: Array, torque: Torque) -> Array:
        """d(q, v, z..., e, de/dt)/dt, e the angle of the appendage relative to the load."""
        drive = torque.at(time) if isinstance(torque, Multisine) else torque(np.array([time]))[0]
        return _slope(state, float(drive), self.inertia, self.s2, self._table, self._part)

    @cached_property
    def _table(self) -> Array:
        """Interfaces as rows."""
        return np.array([(i.s0, i.s1, i.ts, i.tc, i.vs, i.delta) for i in self.interfaces])

    @cached_property
    def _part(self) -> Array:
        """The appendage; empty without one."""
        return np.array(self.appendage or (), dtype=float)

    def answer(
        self, torque: Torque, time: Array, method: str = "LSODA", **options: float
    ) -> tuple[Array, Array]:
        """Angle and rate at `time`, from rest and with bent bristles that hold the first torque."""
        count = len(self.interfaces)
        start = np.zeros(2 + count + (2 if self.appendage else 0))
        total = sum(each.s0 for each in self.interfaces)
        start[2 : 2 + count] = float(torque(time[:1])[0]) / total
        solved = solve_ivp(
            self.slope,
            (time[0], time[-1]),
            start,
            method=method,
            t_eval=time,
            args=(torque,),
            rtol=1e-9,
            atol=1e-14,
            **options,
        )
        assert solved.success
        return solved.y[0], solved.y[1]


LUGRE_1995 = Truth(1.0, 0.4, (Interface(1e5, float(np.sqrt(1e5)), 1.5, 1.0, 0.001),))
"""Canudas de Wit et al. (1995), Table 1."""


@numba.njit
def _slope(
    state: Array, drive: float, inertia: float, s2: float, interfaces: Array, appendage: Array
) -> Array:
    found = np.empty_like(state)
    v = state[1]
    force = s2 * v
    for i in range(len(interfaces)):
        s0, s1, ts, tc, vs, delta = interfaces[i]
        s = tc + (ts - tc) * np.exp(-((abs(v) / vs) ** delta))
        dz = v - s0 * abs(v) * state[2 + i] / s
        force += s0 * state[2 + i] + s1 * dz
        found[2 + i] = dz
    found[0] = v
    if len(appendage) == 0:
        found[1] = (drive - force) / inertia
        return found
    own, frequency, ratio = appendage
    omega = 2.0 * np.pi * frequency
    back = own * (omega**2 * state[-2] + 2.0 * ratio * omega * state[-1])
    found[1] = (drive - force + back) / (inertia - own)
    found[-2] = state[-1]
    found[-1] = -back / own - found[1]
    return found


@numba.njit
def _sines(time: float, omega: Array, phase: Array) -> float:
    total = 0.0
    for i in range(len(omega)):
        total += np.sin(omega[i] * time + phase[i])
    return total


def _faded(share: Array) -> Array:
    fade = np.clip(share, 0.0, 1.0)
    return np.asarray(fade**3 * (10.0 - 15.0 * fade + 6.0 * fade**2))


@dataclass(frozen=True, eq=False)
class Multisine:
    """A torque (N m) at times (s): `scale` times the sum of sines, faded in over `rise`."""

    omega: Array
    phase: Array
    rise: float
    scale: float = 1.0

    def whole(self, time: Array) -> Array:
        """Without the beginning."""
        return self.scale * np.sin(np.multiply.outer(time, self.omega) + self.phase).sum(axis=-1)

    def __call__(self, time: Array) -> Array:
        return np.asarray(self.whole(time) * _faded(time / self.rise))

    def at(self, time: float) -> float:
        """At one time, for solvers that ask for each by itself."""
        begun = 1.0 if time >= self.rise else float(_faded(np.float64(time / self.rise)))
        return self.scale * _sines(time, self.omega, self.phase) * begun


def multisine(
    seed: int, amplitude: float, lowest: float, highest: float, rise: float = 0.05
) -> Multisine:
    """Odd multiples of `lowest` (Hz) in random phases, faded in over `rise` (s), as a function."""
    rng = np.random.default_rng(seed)
    frequency = lowest * np.arange(1, highest / lowest, 2)
    phase = rng.uniform(0.0, 2.0 * np.pi, len(frequency))
    made = Multisine(2.0 * np.pi * frequency, phase, rise)
    largest = np.max(np.abs(made.whole(np.arange(0.0, 1.0 / lowest, 0.05 / highest))))
    return replace(made, scale=float(amplitude / largest))
