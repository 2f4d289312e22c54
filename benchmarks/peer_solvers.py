"""The stabilization trial of the thesis for general solvers, with a compiled right-hand side.

Nothing of `campaign` is used. The equations are those of docs/developers/physics.md with the
numbers of the thesis' appendix; the right-hand side is written for this loop and compiled by numba.

With `noise` the rate controller runs at 1 kHz and reads a gyro with white noise, which is held
over the sample: a solver has to begin anew each millisecond.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
from scipy.integrate import ode, odeint, solve_ivp

try:
    import numbalsoda
except ImportError:
    numbalsoda = None

RATIO, KT, KE, R, L, INERTIA = 141.176, 0.086, 0.071, 0.136, 0.238e-3, 35.0
KPV, KIV, KPC, KIC, DEG = 3.0, 30.0, 0.78, 1000.0, 180.0 / math.pi
FREQUENCY, ACCELERATION = 0.24, math.radians(18.0)
OMEGA = 2.0 * math.pi * FREQUENCY
PERIOD = 1e-3
"""s, of the recording and of the sampled controller."""

# States: relative rate and angle, pointing angle, current, integrals of current and rate error,
# bristles of load and motor in the plant and in the compensation.
V, TURN, ANGLE, CURRENT, CURRENT_SUM, RATE_SUM, Z, STATES = 0, 1, 2, 3, 4, 5, 6, 10
SIZES = np.array([1e-1, 1e-1, 1e-4, 1.0, 1e-2, 1e-2, 1e-3, 1e-3, 1e-3, 1e-3])
"""Of the states; absolute tolerances are a hundredth of the relative one times these."""
START = np.zeros(STATES)
START[V] = ACCELERATION / OMEGA  # at rest in space, while the hull is under way
# Numbers of the loop: whether it is compensated, or sampled with a held current command.
COMPENSATED, SAMPLED, HELD, NUMBERS = 0, 1, 2, 3
# What the sampled controller remembers.
SUM, LAST_V, LOAD_Z, MOTOR_Z, GYRO, POINTING, LAST_TURN, REMEMBERED = 0, 1, 2, 3, 4, 5, 6, 7

Array = np.ndarray


@numba.njit
def stribeck(v, tc, ts):  # type: ignore[no-untyped-def]
    return tc + (ts - tc) * math.exp(-((v / 0.03) ** 2))


@numba.njit
def lugre(v, z, tc, ts, s2, s0, s1):  # type: ignore[no-untyped-def]
    """Torque and dz/dt."""
    dz = v - s0 * abs(v) / stribeck(v, tc, ts) * z
    return s0 * z + s1 * dz + s2 * v, dz


@numba.njit
def derivative(t, y, p, dy):  # type: ignore[no-untyped-def]
    """Writes dy (STATES,); p (NUMBERS,)."""
    v, current = y[V], y[CURRENT]
    rate = v - ACCELERATION / OMEGA * math.cos(OMEGA * t)
    load, dy[Z] = lugre(v, y[Z], 26.0, 32.0, 4.0, 18000.0, 800.0)
    motor, dy[Z + 1] = lugre(v, y[Z + 1], 0.03, 0.04, 0.001, 1000.0, 0.5)
    dy[RATE_SUM], dy[Z + 2], dy[Z + 3] = 0.0, 0.0, 0.0
    if p[SAMPLED] > 0.0:
        wanted = p[HELD]
    else:
        dy[RATE_SUM] = -rate * DEG
        wanted = KPV * (-rate * DEG + KIV * y[RATE_SUM])
        if p[COMPENSATED] > 0.0:
            load_c, dy[Z + 2] = lugre(v, y[Z + 2], 26.0, 32.0, 4.0, 18000.0, 800.0)
            motor_c, dy[Z + 3] = lugre(v, y[Z + 3], 0.03, 0.04, 0.001, 1000.0, 0.5)
            wanted += (load_c + RATIO * motor_c) / (RATIO * KT)
    short = wanted - current
    voltage = KPC * short + KIC * y[CURRENT_SUM]
    acceleration = ACCELERATION * math.sin(OMEGA * t)
    dy[V] = (RATIO * KT * current - load - RATIO * motor) / INERTIA - acceleration
    dy[TURN] = v
    dy[ANGLE] = rate
    dy[CURRENT] = (voltage - R * current - KE * RATIO * v) / L
    dy[CURRENT_SUM] = short


@numba.njit
def rates(t, y, p):  # type: ignore[no-untyped-def]
    dy = np.empty(STATES)
    derivative(t, y, p, dy)
    return dy


@numba.njit
def scaled_rates(t, y, p):  # type: ignore[no-untyped-def]
    return rates(t, y * SIZES, p) / SIZES


@numba.njit
def bristles(z, v0, v1, tc, ts, s2, s0, s1):  # type: ignore[no-untyped-def]
    """One sample of a bristle that relaxes towards its steady state; torque at its end and z."""
    v = 0.5 * (v0 + v1)
    turns = v0 * v1 < 0.0
    speed = 0.5 * (v0 * v0 + v1 * v1) / (abs(v0) + abs(v1)) if turns else abs(v)
    s = stribeck(speed, tc, ts)
    steady = v / speed * s / s0 if speed > 0.0 else 0.0
    new = steady + (z - steady) * math.exp(-s0 * PERIOD * speed / s)
    dz = (new - z) / PERIOD
    gained = v1 - v0 - (abs(v1) * new - abs(v0) * z) * s0 / s
    return s0 * new + s1 * (dz + 0.5 * gained) + s2 * v1, new


@numba.njit
def control(y, t, first, noise, compensated, memory):  # type: ignore[no-untyped-def]
    """One sample of the controller: the current command (A); memory (REMEMBERED,) is advanced."""
    gyro = y[V] - ACCELERATION / OMEGA * math.cos(OMEGA * t) + noise
    if not first:
        memory[POINTING] += 0.5 * PERIOD * (memory[GYRO] + gyro)
    memory[GYRO] = gyro
    memory[SUM] -= PERIOD * gyro * DEG
    wanted = KPV * (-gyro * DEG + KIV * memory[SUM])
    before, v = memory[LAST_V], (y[TURN] - memory[LAST_TURN]) / PERIOD
    memory[LAST_V], memory[LAST_TURN] = v, y[TURN]
    if compensated:
        load, z = bristles(memory[LOAD_Z], before, v, 26.0, 32.0, 4.0, 18000.0, 800.0)
        motor, memory[MOTOR_Z] = bristles(
            memory[MOTOR_Z], before, v, 0.03, 0.04, 0.001, 1000.0, 0.5
        )
        memory[LOAD_Z] = z
        wanted += (load + RATIO * motor) / (RATIO * KT)
    return wanted


Whole = Callable[[Array, bool, float], Array]
"""(times (n,), compensated, tolerance) -> pointing angle (n,)."""
Piece = Callable[[float, Array, Array, float], Array]
"""(time, states, numbers, tolerance) -> states a PERIOD later."""


@dataclass(frozen=True)
class Solver:
    """A general solver, for the whole trial and for a millisecond of it.

    Attributes:
        tolerances: relative ones that are tried.
        noisy: those with noise; a solver that takes minutes there has few.
        by_samples: the loop with noise in place of `piece`, where the solver can be called by
            compiled code.
    """

    name: str
    whole: Whole
    piece: Piece
    tolerances: tuple[float, ...]
    noisy: tuple[float, ...]
    by_samples: Callable[[Array, bool, float], Array] | None = None

    def sampled(self, noise: Array, compensated: bool, rtol: float) -> Array:
        """Pointing angle by the gyro (n,) with a controller at 1 kHz and noise (n,) of its gyro."""
        if self.by_samples is not None:
            return self.by_samples(noise, compensated, rtol)
        y, memory = START.copy(), np.zeros(REMEMBERED)
        p = np.array([float(compensated), 1.0, 0.0])
        angle = np.empty(len(noise))
        for k, error in enumerate(noise):
            p[HELD] = control(y, k * PERIOD, k == 0, error, compensated, memory)
            angle[k] = memory[POINTING]
            y = self.piece(k * PERIOD, y, p, rtol)
        return angle


def by_odeint() -> Solver:
    """ODEPACK's LSODA, called once for all instants."""

    def solve(at: Array, y: Array, p: Array, rtol: float) -> Array:
        return odeint(
            rates, y, at, (p,), tfirst=True, rtol=rtol, atol=rtol * SIZES * 1e-2, mxstep=100_000
        )

    return Solver(
        "scipy odeint",
        lambda at, compensated, rtol: solve(at, START, _numbers(compensated), rtol)[:, ANGLE],
        lambda t, y, p, rtol: solve(np.array([t, t + PERIOD]), y, p, rtol)[-1],
        (1e-4, 1e-6, 1e-8, 1e-10),
        (1e-4, 1e-6, 1e-8),
    )


def by_solve_ivp(method: str, tolerances: tuple[float, ...], noisy: tuple[float, ...]) -> Solver:
    """A method of `solve_ivp`."""

    def solve(at: Array, y: Array, p: Array, rtol: float) -> Array:
        found = solve_ivp(
            rates, (at[0], at[-1]), y, method, at, args=(p,), rtol=rtol, atol=rtol * SIZES * 1e-2
        )
        return np.asarray(found.y.T)

    return Solver(
        f"scipy solve_ivp {method}",
        lambda at, compensated, rtol: solve(at, START, _numbers(compensated), rtol)[:, ANGLE],
        lambda t, y, p, rtol: solve(np.array([t, t + PERIOD]), y, p, rtol)[-1],
        tolerances,
        noisy,
    )


def by_dop853() -> Solver:
    """Dormand and Prince's pair of order 8: the reference."""

    def advance(solver: Any, t: float) -> Array:
        y = solver.integrate(t) * SIZES
        if not solver.successful():
            raise ArithmeticError(f"dop853 gave up at {t:g} s")
        return np.asarray(y)

    def begin(t: float, y: Array, p: Array, rtol: float) -> Any:
        solver = ode(scaled_rates).set_f_params(p)
        solver.set_integrator("dop853", rtol=rtol, atol=rtol, nsteps=1_000_000)
        return solver.set_initial_value(y / SIZES, t)

    def whole(at: Array, compensated: bool, rtol: float) -> Array:
        solver = begin(at[0], START, _numbers(compensated), rtol)
        return np.array([0.0, *(advance(solver, t)[ANGLE] for t in at[1:])])

    return Solver(
        "dop853", whole, lambda t, y, p, rtol: advance(begin(t, y, p, rtol), t + PERIOD), (), ()
    )


def by_numbalsoda() -> Solver | None:
    """LSODA in C++, which compiled code calls; None where it is not installed."""
    if numbalsoda is None:
        return None
    lsoda = numbalsoda.lsoda

    @numba.cfunc(numbalsoda.lsoda_sig)
    def right_hand_side(t, u, du, data):  # type: ignore[no-untyped-def]
        scaled, out = numba.carray(u, (STATES,)), numba.carray(du, (STATES,))
        dy = np.empty(STATES)
        derivative(t, scaled * SIZES, numba.carray(data, (NUMBERS,)), dy)
        out[:] = dy / SIZES

    address = right_hand_side.address

    @numba.njit
    def solve(at, y, p, rtol):  # type: ignore[no-untyped-def]
        found, good = lsoda(address, y / SIZES, at, p, rtol, rtol * 1e-2)
        return found * SIZES, good

    @numba.njit
    def by_samples(noise, compensated, rtol):  # type: ignore[no-untyped-def]
        y, memory, p = START.copy(), np.zeros(REMEMBERED), np.zeros(NUMBERS)
        p[SAMPLED] = 1.0
        at, angle = np.zeros(2), np.empty(len(noise))
        for k in range(len(noise)):
            at[0], at[1] = k * PERIOD, (k + 1) * PERIOD
            p[HELD] = control(y, at[0], k == 0, noise[k], compensated, memory)
            angle[k] = memory[POINTING]
            y = solve(at, y, p, rtol)[0][1]
        return angle

    return Solver(
        "numbalsoda",
        lambda at, compensated, rtol: solve(at, START, _numbers(compensated), rtol)[0][:, ANGLE],
        lambda t, y, p, rtol: solve(np.array([t, t + PERIOD]), y, p, rtol)[0][-1],
        (1e-4, 1e-6, 1e-8, 1e-10),
        (1e-4, 1e-6, 1e-8),
        by_samples,
    )


def _numbers(compensated: bool) -> Array:
    return np.array([float(compensated), 0.0, 0.0])


def solvers() -> list[Solver]:
    """Those that are here."""
    found = [
        by_odeint(),
        by_numbalsoda(),
        by_solve_ivp("LSODA", (1e-4, 1e-6, 1e-8), (1e-4, 1e-6)),
        by_solve_ivp("Radau", (1e-4, 1e-6), (1e-4,)),
    ]
    return [solver for solver in found if solver is not None]
