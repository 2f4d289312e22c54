"""The engine against scipy's LSODA on the thesis' equations, written a second time."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from campaign.signals import Polyline, Sine
from tests.physics.benches import bench, run, task
from tests.physics.reference import trajectory

TIMES = np.arange(1000) * 1e-3
FREQUENCY, ACCELERATION = 1.0, 1.5
# With this phase the hull starts from rest, so that nothing jumps at t = 0.
SWING = Sine(amplitude=ACCELERATION, frequency=FREQUENCY, phase=np.pi / 2)
COMPARED = ("load_rate", "pointing_angle", "relative_angle", "motor_current")


def swinging(t: float) -> float:
    omega = 2 * np.pi * FREQUENCY
    return ACCELERATION / omega * float(np.sin(omega * t))


CASES: dict[str, tuple[dict[str, Any], dict[str, Any], float]] = {
    "none": ({"base_rate": swinging}, {"base_acceleration": SWING}, 0.0),
    "lugre": (
        {"base_rate": swinging, "compensation": "lugre"},
        {"base_acceleration": SWING, "compensation": "lugre"},
        0.0,
    ),
    "observer": (
        {"base_rate": swinging, "compensation": "observer"},
        {"base_acceleration": SWING, "compensation": "observer"},
        0.0,
    ),
    "lugre, relative rate filtered": (
        {"base_rate": swinging, "compensation": "lugre", "low_pass": 2e-3},
        {"base_acceleration": SWING, "compensation": "lugre"},
        2e-3,
    ),
    "torque ramp through breakaway": (
        {"base_rate": lambda t: 0.0, "torque": lambda t: 60.0 * t},
        {"mode": "torque", "command": Polyline(times=(0.0, 1.0), values=(0.0, 60.0))},
        0.0,
    ),
}
# Relative rms error at 0.25 ms. Compensation leaves a residue 500 times smaller than the
# uncompensated error, and it is that residue's own size the error of the rate is compared with.
TOLERANCE = {"lugre": 2.5e-4, "observer": 2.5e-4, "lugre, relative rate filtered": 3e-4}


def errors(case: str, step: float) -> dict[str, float]:
    """Relative rms error of the engine by output."""
    reference, fields, low_pass = CASES[case]
    expected = trajectory(TIMES, **reference)
    on = bench(
        (lambda tree: tree["controller"].update(relative_rate_filter=f"{low_pass} s"))
        if low_pass
        else None
    )
    _, found = run(on, task(**fields), step)

    def rms(values: np.ndarray) -> float:
        return float(np.sqrt(np.mean(values**2)))

    return {name: rms(found[name] - expected[name]) / rms(expected[name]) for name in COMPARED}


@pytest.mark.parametrize("case", CASES)
def test_trajectories_agree_and_converge_with_second_order(case: str) -> None:
    coarse, fine = errors(case, 0.25e-3), errors(case, 0.125e-3)
    assert max(coarse.values()) < TOLERANCE.get(case, 2e-5)
    for name in COMPARED:
        order = np.log2(coarse[name] / fine[name])
        assert 1.8 < order < 2.3, f"{name}: order {order:.2f}"


def test_the_filtered_rate_is_what_is_recorded() -> None:
    expected = trajectory(TIMES, swinging, "lugre", low_pass=2e-3)["filtered_rate"]
    on = bench(lambda tree: tree["controller"].update(relative_rate_filter="2 ms"))
    _, found = run(on, task(base_acceleration=SWING, compensation="lugre"))
    assert np.max(np.abs(found["relative_rate"] - expected)) < 1e-4 * np.max(np.abs(expected))
