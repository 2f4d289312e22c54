"""Plants below breakaway by scipy, on equations written here: the truth of tests of the fit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Array = NDArray[np.float64]
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
        v, count = state[1], len(self.interfaces)
        bristles = state[2 : 2 + count]
        force, moves = self.s2 * v, []
        for each, z in zip(self.interfaces, bristles, strict=True):
            s = each.tc + (each.ts - each.tc) * np.exp(-((abs(v) / each.vs) ** each.delta))
            dz = v - each.s0 * abs(v) * z / s
            force += each.s0 * z + each.s1 * dz
            moves.append(dz)
        drive = float(torque(np.array([time]))[0])
        if self.appendage is None:
            return np.array([v, (drive - force) / self.inertia, *moves])
        own, frequency, ratio = self.appendage
        omega = 2.0 * np.pi * frequency
        back = own * (omega**2 * state[-2] + 2.0 * ratio * omega * state[-1])
        acceleration = (drive - force + back) / (self.inertia - own)
        return np.array([v, acceleration, *moves, state[-1], -back / own - acceleration])

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


def multisine(
    seed: int, amplitude: float, lowest: float, highest: float, rise: float = 0.05
) -> Torque:
    """Odd multiples of `lowest` (Hz) in random phases, faded in over `rise` (s), as a function."""
    rng = np.random.default_rng(seed)
    frequency = lowest * np.arange(1, highest / lowest, 2)
    phase = rng.uniform(0.0, 2.0 * np.pi, len(frequency))

    def whole(time: Array) -> Array:
        return np.sin(2.0 * np.pi * np.multiply.outer(time, frequency) + phase).sum(axis=-1)

    scale = amplitude / np.max(np.abs(whole(np.arange(0.0, 1.0 / lowest, 0.05 / highest))))

    def torque(time: Array) -> Array:
        fade = np.clip(time / rise, 0.0, 1.0)
        return np.asarray(scale * whole(time) * fade**3 * (10.0 - 15.0 * fade + 6.0 * fade**2))

    return torque
