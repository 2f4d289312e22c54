"""Energy: what comes in is stored, or dissipated, or done as work; nothing is made or lost.

All from recorded channels at the step grid, with integrals by the trapezoidal rule: where the
channels are of second order in the step, so is what the balance leaves over.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from campaign.signals import Polyline, Sine
from tests.physics.benches import INERTIA, KT, LOAD, RATIO, Tree, bench, run, stribeck, task

DURATION = 2.0
RAMPS = Polyline(times=(0.0, 1.0, 2.0), values=(0.0, 60.0, -60.0))
TRIALS: dict[str, dict[str, Any]] = {
    "hull from rest": {
        "base_acceleration": Sine(amplitude=1.5, frequency=1.0, phase=math.pi / 2),
        "mode": "rate",
    },
    "hull under way": {"base_acceleration": Sine(amplitude=1.5, frequency=1.0), "mode": "rate"},
    "torque through breakaway": {"command": RAMPS, "mode": "torque"},
}


def order(coarse: float, fine: float) -> float:
    """Of convergence, from steps that differ by 2."""
    return math.log2(coarse / fine)


def left_over(fields: dict[str, Any], step: float) -> float:
    """Largest gap between the load's kinetic energy and the work on it, of all work done.

    J w^2 / 2 grows by the work of motor and friction, (N Kt i - T) w, seen from space.
    """
    on = task(duration=DURATION, sample_rate=1.0 / step, **fields)
    at, found = run(bench(), on, step)
    rate = found["load_rate"]
    power = (RATIO * KT * found["motor_current"] - found["friction_torque"]) * rate
    kinetic = 0.5 * INERTIA * rate**2
    gap = kinetic - kinetic[0] - cumulative_trapezoid(power, at, initial=0.0)
    return float(np.max(np.abs(gap)) / np.trapezoid(np.abs(power), at))


@pytest.mark.parametrize("trial", TRIALS)
def test_the_load_gains_what_motor_and_friction_do(trial: str) -> None:
    coarse, fine = left_over(TRIALS[trial], 0.25e-3), left_over(TRIALS[trial], 0.125e-3)
    assert fine < 5e-3
    assert order(coarse, fine) == pytest.approx(2.0, abs=0.1)


def _dry(tree: Tree) -> None:
    tree["friction"] = {
        "load": stribeck(32.0, 26.0, 4.0),
        "motor": stribeck(0.04, 0.03, 0.001, side="motor"),
    }


DRY_TRIALS: dict[str, dict[str, Any]] = {
    "hull from rest": TRIALS["hull from rest"],
    "torque through breakaway": TRIALS["torque through breakaway"],
    "stick-slip": {
        "mode": "spring",
        "command": Polyline(times=(0.0, 2.0), values=(0.0, 0.2)),
        "spring_stiffness": 900.0,
    },
}


def left_over_by_dry_friction(fields: dict[str, Any], step: float) -> float:
    """Largest gap between the load's energy and the work on it, of what friction takes.

    All as the hull sees it: J v^2 / 2 grows by the work of what drives the load, of the inertial
    torque and of friction. Friction jumps only where the rate is zero, so its power does not.
    """
    at, found = run(bench(_dry), task(duration=DURATION, sample_rate=1.0 / step, **fields), step)
    rate, drive = found["relative_rate"], RATIO * KT * found["motor_current"]
    if fields["mode"] == "spring":
        far = np.interp(at, fields["command"].times, fields["command"].values)
        drive = fields["spring_stiffness"] * (far - found["relative_angle"])
    base = fields.get("base_acceleration")
    shaken = INERTIA * (0.0 if base is None else base.sample(at))
    work = cumulative_trapezoid((drive - shaken - found["friction_torque"]) * rate, at, initial=0.0)
    kinetic = 0.5 * INERTIA * rate**2
    gap = np.max(np.abs(kinetic - kinetic[0] - work))
    return float(gap / np.trapezoid(np.abs(found["friction_torque"] * rate), at))


@pytest.mark.parametrize("trial", DRY_TRIALS)
def test_dry_friction_takes_what_the_load_does_not_gain(trial: str) -> None:
    coarse, middle, fine = (
        left_over_by_dry_friction(DRY_TRIALS[trial], step) for step in (1e-3, 0.25e-3, 0.0625e-3)
    )
    assert middle < 1e-6
    assert coarse > 100 * fine  # 256 times, if events fell alike in their steps


def _undamped(tree: Tree) -> None:
    """Bristles without damping, alone: the torque tells their deflection, z = T / sigma0."""
    load = tree["friction"]["load"]
    load |= {"bristle_damping": "0 N m s/rad", "viscous_friction": "0 N m s/rad"}
    tree["friction"] = {"load": load}
    tree["compensation"] = {}


def not_stored_nor_dissipated(step: float) -> float:
    """Largest gap between the work of a prescribed motion and what bristles store and dissipate.

    T v = d/dt (T^2 / 2 sigma0) + |v| T^2 / s(v), from Equations 4.2 to 4.4 with sigma1 = 0.
    """
    motion = Sine(amplitude=0.05, frequency=1.0)  # through presliding, the Stribeck dip and back
    on = task(mode="prescribed", command=motion, duration=DURATION, sample_rate=1.0 / step)
    at, found = run(bench(_undamped), on, step)
    rate, torque = found["relative_rate"], found["friction_torque"]
    s = LOAD["tc"] + (LOAD["ts"] - LOAD["tc"]) * np.exp(-((rate / LOAD["vs"]) ** 2))
    stored = 0.5 * torque**2 / LOAD["s0"]
    dissipated = cumulative_trapezoid(np.abs(rate) * torque**2 / s, at, initial=0.0)
    work = cumulative_trapezoid(torque * rate, at, initial=0.0)
    return float(np.max(np.abs(work - stored - dissipated)) / work[-1])


def test_bristles_store_or_dissipate_all_work() -> None:
    coarse, fine = (not_stored_nor_dissipated(step) for step in (0.5e-3, 0.25e-3))
    assert fine < 1e-6
    assert order(coarse, fine) == pytest.approx(2.0, abs=0.2)
