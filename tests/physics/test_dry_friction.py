"""Static Stribeck friction as the plant's own: sticking, breaking away, sliding, no chatter."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from campaign.signals import Polyline, Sine
from tests.physics.benches import INERTIA, KT, RATIO, bench, run, stribeck, task

RAMP = Polyline(times=(0.0, 4.0), values=(0.0, 40.0))
STEP = 0.25e-3
START = 0.1


def ramp(*interfaces: dict[str, Any]) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """A torque ramp of 10 N m/s on a bench with these static friction interfaces."""

    def only(tree: dict[str, Any]) -> None:
        tree["friction"] = {f"interface{i}": item for i, item in enumerate(interfaces)}

    ramp_task = task(mode="torque", command=RAMP, duration=4.0, start_angle=START)
    return run(bench(only), ramp_task, STEP)


def test_sticks_below_and_breaks_away_at_the_static_torque() -> None:
    _, out = ramp(stribeck(32.0, 26.0, 4.0))
    drive = out["motor_current"] * RATIO * KT
    moving = int(np.argmax(np.abs(out["load_rate"]) > 1e-12))
    assert drive[moving - 1] < 32.0 + 1e-2
    assert drive[moving] == pytest.approx(32.0, abs=0.02)  # one sample of the ramp is 0.01 N m
    # Sticking: the friction is the drive torque itself, and nothing creeps.
    stuck = slice(0, moving)
    assert np.max(np.abs(out["load_rate"][stuck])) < 1e-15
    assert np.max(np.abs(out["relative_angle"][stuck] - START)) < 1e-15
    later = slice(5, moving)  # when the current has settled: in a step, torque is a line
    np.testing.assert_allclose(out["friction_torque"][later], drive[later], atol=2e-6)


def test_slides_with_equation_4_6() -> None:
    """J dw/dt = drive - (Tc + (Ts - Tc) exp(-(v/vs)^2) + sigma2 v), from the recorded rate."""
    time, out = ramp(stribeck(32.0, 26.0, 4.0))
    rate = out["load_rate"]
    curve = 26.0 + 6.0 * np.exp(-((rate / 0.03) ** 2)) + 4.0 * rate
    acceleration = np.gradient(rate, time)
    sliding = (rate > 1e-3)[2:-2]
    balance = out["motor_current"] * RATIO * KT - INERTIA * acceleration - curve
    assert sliding.sum() > 500
    assert np.max(np.abs(balance[2:-2][sliding])) < 0.02
    recorded = out["friction_torque"][2:-2][sliding] - curve[2:-2][sliding]
    assert np.max(np.abs(recorded)) < 1e-6


def test_two_interfaces_in_parallel_are_their_sum() -> None:
    """Also where one of them acts on the motor's side: 0.1 N m there are 14.1176 at the load."""
    _, one = ramp(stribeck(32.0, 26.0, 4.0))
    share = 0.1 * RATIO
    _, two = ramp(
        stribeck(32.0 - share, 26.0 - 0.75 * share, 2.0),
        stribeck(0.1, 0.075, 2.0 / RATIO, side="motor"),
    )
    for name in ("load_rate", "friction_torque"):
        np.testing.assert_allclose(two[name], one[name], atol=1e-9 * np.max(np.abs(one[name])))


@pytest.mark.parametrize("step", [1e-3, 0.25e-3])
def test_reversals_do_not_chatter(step: float) -> None:
    """Per cycle of the base motion: two slides and two sticks, whatever the step."""

    def dry(tree: dict[str, Any]) -> None:
        tree["friction"] = {
            "load": stribeck(32.0, 26.0, 4.0),
            "motor": stribeck(0.04, 0.03, 0.001, side="motor"),
        }

    swing = Sine(amplitude=float(np.deg2rad(18.0)), frequency=0.24)
    time, out = run(bench(dry), task(base_acceleration=swing, duration=4 / 0.24), step)
    rate = out["relative_rate"][time > 1 / 0.24]
    state = np.sign(np.where(np.abs(rate) < 1e-9, 0.0, rate))
    assert np.count_nonzero(np.diff(state)) == 12  # 3 cycles: start and end of each stick
    # Where it comes to rest the friction may jump (the load no longer brakes), and then, as long
    # as it sticks, it runs smoothly to the other sign.
    torque = out["friction_torque"][time > 1 / 0.24]
    inside = (state[:-2] == 0) & (state[1:-1] == 0) & (state[2:] == 0)
    assert inside.sum() > 300
    assert np.max(np.abs(np.diff(torque)[1:][inside])) < 2.0
    assert np.max(np.abs(torque)) < 32.0 + 0.04 * RATIO + 4.2 * np.max(np.abs(rate))


def test_static_friction_below_coulomb_is_allowed() -> None:
    """Ts < Tc is met on real axes: it breaks away at Ts and friction then rises."""
    time, out = ramp(stribeck(20.0, 26.0, 4.0))
    moving = int(np.argmax(np.abs(out["load_rate"]) > 1e-12))
    assert time[moving] == pytest.approx(2.0, abs=0.003)
