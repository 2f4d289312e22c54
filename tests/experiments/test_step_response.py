"""Steps of the linear loop against scipy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.signal import lsim

from campaign.experiments.interface import bench_of
from campaign.physics.limits import margins
from tests.experiments.laboratory import analyse, execute, finding, trials
from tests.physics.benches import DEG, INERTIA, KE, KIC, KIV, KPC, KPV, KT, RATIO, L, R, bench

KIND = "step_response"


def linear_loop() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """States: rate, current, integrals of the current's and the rate's error; input: command."""
    kp, ki = KPV * DEG, KPV * DEG * KIV
    a = np.array(
        [
            [0, RATIO * KT / INERTIA, 0, 0],
            [(-KE * RATIO - KPC * kp) / L, -(R + KPC) / L, KIC / L, KPC * ki / L],
            [-kp, -1, 0, ki],
            [-1, 0, 0, 0],
        ]
    )
    b = np.array([[0.0], [KPC * kp / L], [kp], [1.0]])
    return a, b, np.array([[1.0, 0, 0, 0]]), np.zeros((1, 1))


def test_the_linear_loop_against_scipy() -> None:
    (item,) = execute(trials(KIND, bench(), {"ramp": "5 ms"}))
    time = np.arange(0.0, 1.1, 1e-4)
    command = np.interp(time, [0.1, 0.105], [0.0, np.deg2rad(1.0)])
    _, expected, _ = lsim(linear_loop(), command, time)
    found = np.interp(item.samples.time, time, expected)
    assert item.samples["gyro_rate"] == pytest.approx(found, abs=2e-3 * np.deg2rad(1.0))


def test_the_design_requirements_of_the_thesis_are_met() -> None:
    result = analyse(KIND, execute(trials(KIND, bench(), {})))
    assert finding(result, "rise_time", compensation="none").value < 0.040
    assert finding(result, "settling_time").value < 0.400
    assert abs(finding(result, "steady_state_error").value) < 1e-6
    assert result.figures[0].thesis == ("4.7",)


def test_only_the_linear_one_is_without_friction() -> None:
    matrix = [{"linear": True}, {"linear": False}]
    linear, real = trials(KIND, bench(), {}, matrix)
    assert not bench_of(linear).friction
    assert set(bench_of(real).friction) == {"load", "motor"}
    result = analyse(KIND, execute([linear, real]))
    free, dragged = (finding(result, "rise_time", linear=value).value for value in (True, False))
    assert dragged > 2 * free


def test_the_command_keeps_to_the_acceleration_limit() -> None:
    (trial,) = trials(KIND, bench(), {})
    (margin,) = [m for m in margins(bench_of(trial), trial.task) if m.limit == "acceleration"]
    assert margin.value == pytest.approx(np.deg2rad(1.0) / 0.005)
    assert not margin.broken


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"ramp": "0.5 s"}, "shorten ramp"),
        ({"ramp": "0 s"}, "jump"),
        ({"step": "0 deg/s"}, "step of zero"),
    ],
)
def test_a_ramp_that_is_no_step_is_refused(options: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        trials(KIND, bench(), options)


def test_a_planned_step_downwards_is_the_mirror_image() -> None:
    up, down = (
        analyse(KIND, execute(trials(KIND, bench(), {"step": step})))
        for step in ("1 deg/s", "-1 deg/s")
    )
    for name in ("rise_time", "settling_time", "overshoot"):
        assert finding(down, name).value == pytest.approx(finding(up, name).value, rel=1e-3)
