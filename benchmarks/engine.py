"""How fast the engine is beside scipy's LSODA, at comparable accuracy.

Run with `python benchmarks/engine.py`. Both simulate the stabilization loop of the thesis' appendix
with load and motor LuGre friction, once without and once with LuGre compensation. The right-hand
side that scipy gets is compiled by numba, so what is compared are the methods. Runs alternate, and
medians are printed: the ratio means something on a busy machine too, the times do not.
"""

from __future__ import annotations

import math
import statistics
import time
import tomllib
from collections.abc import Callable
from pathlib import Path

import numba
import numpy as np
from scipy.integrate import solve_ivp

from campaign.physics.bench import Bench
from campaign.physics.simulate import simulate
from campaign.signals import Sine
from campaign.trial import Task

SIMULINK = Path(__file__).parents[1] / "protocols" / "benches" / "simulink.toml"
BENCH = Bench.model_validate(tomllib.loads(SIMULINK.read_text(encoding="utf-8")))
FREQUENCY, ACCELERATION = 0.24, math.radians(18.0)
CYCLES, SETTLE = 6, 2
DURATION = (CYCLES + SETTLE) / FREQUENCY
REPEATS = 5
TRUE_ERROR = {"none": 0.488412958e-3, "lugre": 0.000594855e-3}
"""rad; by an order-8 Runge-Kutta method with located reversals."""


@numba.njit
def friction(v, z, tc, ts, s2, s0, s1):  # type: ignore[no-untyped-def]
    s = tc + (ts - tc) * math.exp(-((v / 0.03) ** 2))
    dz = v - s0 * abs(v) / s * z
    return s0 * z + s1 * dz + s2 * v, dz


@numba.njit
def loop(t, y, compensated):  # type: ignore[no-untyped-def]
    """State: w, its integral, i, both PI integrals, bristles of plant and compensation."""
    ratio, kt, j = 141.176, 0.086, 35.0
    omega = 2 * math.pi * FREQUENCY
    v = y[0] + ACCELERATION / omega * math.cos(omega * t)
    load, dz0 = friction(v, y[5], 26.0, 32.0, 4.0, 18000.0, 800.0)
    motor, dz1 = friction(v, y[6], 0.03, 0.04, 0.001, 1000.0, 0.5)
    added, dz2, dz3 = 0.0, 0.0, 0.0
    if compensated:
        load_c, dz2 = friction(v, y[7], 26.0, 32.0, 4.0, 18000.0, 800.0)
        motor_c, dz3 = friction(v, y[8], 0.03, 0.04, 0.001, 1000.0, 0.5)
        added = load_c + ratio * motor_c
    error = -y[0] * 180 / math.pi
    current_error = 3.0 * (error + 30.0 * y[4]) + added / (ratio * kt) - y[2]
    voltage = 0.78 * current_error + 1000.0 * y[3]
    out = np.empty(9)
    out[0] = (ratio * kt * y[2] - load - ratio * motor) / j
    out[1] = y[0]
    out[2] = (voltage - 0.136 * y[2] - 0.071 * ratio * v) / 0.238e-3
    out[3] = current_error
    out[4] = error
    out[5], out[6], out[7], out[8] = dz0, dz1, dz2, dz3
    return out


def by_scipy(compensation: str, rtol: float) -> float:
    """Stabilization error (rad)."""
    at = np.arange(round(SETTLE / FREQUENCY * 1000), round(DURATION * 1000)) * 1e-3
    scale = np.array([1e-3, 1e-4, 1.0, 1e-2, 1e-2, 1e-3, 1e-3, 1e-3, 1e-3])
    found = solve_ivp(
        loop,
        (0.0, DURATION),
        np.zeros(9),
        method="LSODA",
        t_eval=at,
        rtol=rtol,
        atol=rtol * scale * 1e-2,
        args=(compensation == "lugre",),
    )
    return float(np.std(found.y[1]))


def by_engine(compensation: str, step: float) -> float:
    """Stabilization error (rad)."""
    task = Task(
        mode="rate",
        base_acceleration=Sine(amplitude=ACCELERATION, frequency=FREQUENCY),
        compensation=compensation,
        duration=DURATION,
        window=(SETTLE / FREQUENCY, DURATION),
        sample_rate=1000.0,
    )
    blocks = list(simulate(BENCH, task, 1, step))
    when = np.concatenate([at for at, _ in blocks])
    angle = np.concatenate([out[4] for _, out in blocks])
    return float(np.std(angle[when >= SETTLE / FREQUENCY]))


def timed(job: Callable[[], float]) -> tuple[float, float]:
    start = time.perf_counter()
    error = job()
    return time.perf_counter() - start, error


def compare(compensation: str, step: float, rtol: float) -> None:
    jobs = {
        f"engine, {step * 1e3:g} ms": lambda: by_engine(compensation, step),
        f"scipy LSODA, rtol {rtol:g}": lambda: by_scipy(compensation, rtol),
    }
    runs: dict[str, list[tuple[float, float]]] = {name: [] for name in jobs}
    for job in jobs.values():
        job()  # compile
    for _ in range(REPEATS):
        for name, job in jobs.items():
            runs[name].append(timed(job))
    medians = []
    print(f"\ncompensation: {compensation}")
    for name, results in runs.items():
        seconds = statistics.median(duration for duration, _ in results)
        medians.append(seconds)
        off = results[0][1] / TRUE_ERROR[compensation] - 1
        each = 1e3 * seconds / DURATION
        print(f"  {name:26} {each:8.3f} ms per simulated second   error off by {off:+.1e}")
    print(f"  ratio                      {medians[1] / medians[0]:8.1f}")


if __name__ == "__main__":
    compare("none", step=1e-3, rtol=1e-6)
    compare("none", step=0.25e-3, rtol=1e-7)
    compare("lugre", step=0.25e-3, rtol=1e-6)
    compare("lugre", step=0.1e-3, rtol=1e-7)
