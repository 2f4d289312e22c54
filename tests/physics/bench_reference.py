"""Trajectories of any bench with a continuous controller, by scipy's solvers.

The equations are those of `bench_equations`. LSODA and DOP853, which share nothing, agree.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from scipy.integrate import ode, odeint

from campaign.physics.bench import Bench
from campaign.trial import Task
from tests.physics.bench_equations import (
    FILTERED,
    LOW_PASS,
    POINTING,
    Array,
    Equations,
    I,
    Q,
    V,
    equations,
    rates,
    scaled_rates,
    torques,
)

CHANNELS = (
    "relative_rate",
    "relative_angle",
    "motor_current",
    "pointing_angle",
    "compensation_torque",
    "friction_torque",
    "load_rate",
)
Method = Literal["lsoda", "dop853"]


def reference(
    bench: Bench, task: Task, rtol: float = 1e-10, method: Method = "lsoda"
) -> dict[str, Array]:
    """CHANNELS at every recorded instant, each (n,), by name.

    A first run at 1e-6 finds how large each state is; `rtol` then counts relative to that, and
    to the state. Raises ArithmeticError where the solver gives up.
    """
    system = equations(bench, task)
    times = np.arange(max(1, math.floor(task.duration * task.sample_rate + 1e-9)))
    times = times / task.sample_rate
    rough = _states(system, times, 1e-6, np.full(len(system.start), 1e-12), "lsoda")
    size = np.sqrt(np.mean(rough**2, axis=0))
    states = _states(system, times, rtol, rtol * np.maximum(size, 1e-14), method)
    torque = np.empty((len(times), 3))
    for piece in _pieces(system, times):
        here = piece.instants
        torque[here] = torques(
            times[here], states[here], piece.numbers, system.friction, system.sines
        )
    seen = states[:, FILTERED] if system.numbers[LOW_PASS] > 0.0 else states[:, V]
    return {
        "relative_rate": seen,
        "relative_angle": states[:, Q],
        "motor_current": states[:, I],
        "pointing_angle": states[:, POINTING],
        "compensation_torque": torque[:, 1],
        "friction_torque": torque[:, 0],
        "load_rate": torque[:, 2],
    }


@dataclass(frozen=True)
class Piece:
    """The part of a trial between two knots: no corner inside.

    instants: which of the recorded ones lie in it, each in one piece only; numbers: those of a
    loop that hold here.
    """

    left: float
    right: float
    instants: Array
    numbers: Array


def _pieces(system: Equations, times: Array) -> list[Piece]:
    inner = [t for t in system.knots if times[0] < t < times[-1]]
    ends = [float(times[0]), *inner, float(times[-1])]
    of_instant = np.clip(np.searchsorted(ends, times, side="right") - 1, 0, len(ends) - 2)
    return [
        Piece(left, right, np.flatnonzero(of_instant == k), system.between(left, right))
        for k, (left, right) in enumerate(pairwise(ends))
    ]


def _states(system: Equations, times: Array, rtol: float, atol: Array, method: Method) -> Array:
    """(n, states); every piece is a run of its own, from where the last one ended."""
    solve = _by_lsoda if method == "lsoda" else _by_dop853
    states, state = np.empty((len(times), len(system.start))), system.start
    for piece in _pieces(system, times):
        wanted = times[piece.instants]
        at = np.unique([piece.left, *wanted, piece.right])
        every = solve(at, state, rtol, atol, (piece.numbers, system.friction, system.sines))
        states[piece.instants] = every[np.searchsorted(at, wanted)]
        state = every[-1]
    return states


def _by_lsoda(at: Array, start: Array, rtol: float, atol: Array, args: tuple[Array, ...]) -> Array:
    found, info = odeint(
        rates, start, at, args, rtol=rtol, atol=atol, mxstep=1_000_000, hmax=5e-3,
        tfirst=True, full_output=True,
    )  # fmt: skip
    if info["message"] != "Integration successful." or not np.all(np.isfinite(found)):
        raise ArithmeticError(info["message"])
    return np.asarray(found)


def _by_dop853(at: Array, start: Array, rtol: float, atol: Array, args: tuple[Array, ...]) -> Array:
    size = atol / rtol  # it takes one absolute tolerance, so all states are made alike
    solver = ode(scaled_rates).set_f_params(size, *args)
    solver.set_integrator("dop853", rtol=rtol, atol=rtol, nsteps=100_000)
    solver.set_initial_value(start / size, at[0])
    found = np.empty((len(at), len(start)))
    found[0] = start
    for k in range(1, len(at)):
        found[k] = solver.integrate(at[k]) * size
        if not solver.successful():
            raise ArithmeticError(f"dop853 gave up at {at[k]:g} s")
    return found
