"""A move is a trapezoid of rate whose integral is the way, and the axis gets there."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from campaign.errors import LimitError
from campaign.experiments import experiments
from campaign.experiments.move import trapezoid
from campaign.physics.bench import Bench
from campaign.protocol import check_limits, load_protocol, make_plan
from campaign.resources import protocols_folder
from campaign.trial import Role
from tests.experiments.laboratory import analyse, execute, failed, table, trials
from tests.physics.benches import bench


@pytest.fixture
def simulink() -> Bench:
    return bench()


HOME = {"angle": "20 deg", "position": "-10 deg"}


@given(
    st.floats(-3, 3).filter(lambda way: abs(way) > 1e-6), st.floats(1e-3, 5), st.floats(1e-2, 100)
)
def test_the_integral_is_the_way(way: float, speed: float, acceleration: float) -> None:
    ramp, stretch, rate = trapezoid(way, speed, acceleration)
    assert rate * (ramp + stretch) == pytest.approx(way, rel=1e-9)
    assert abs(rate) <= speed
    assert abs(rate) / ramp == pytest.approx(acceleration)
    assert stretch >= 0


@pytest.mark.parametrize("options", [{}, {"speed": "30 deg/s"}, {"cycles": 2}])
def test_the_command_goes_there(simulink: Bench, options: dict[str, Any]) -> None:
    (trial,) = trials("move", simulink, {**HOME, **options})
    command = trial.task.command
    corners = sorted(set(command.times))  # type: ignore[union-attr]
    way, _ = quad(lambda t: float(command.sample(np.array([t]))[0]), 0, corners[-1],
                  points=corners, limit=200)  # fmt: skip
    assert np.rad2deg(way) == pytest.approx(0.0 if options.get("cycles") else 30.0, abs=1e-6)
    assert np.rad2deg(trial.task.start_angle) == pytest.approx(-10)


def test_the_axis_gets_there(simulink: Bench) -> None:
    done = execute(trials("move", simulink, {**HOME, "speed": "10 deg/s"}))
    (row,) = table(analyse("move", done), "moves").rows
    assert row["role"] == "home"
    assert np.rad2deg(row["reached"]) == pytest.approx(20, abs=0.2)
    assert row["deviation"] == pytest.approx(row["reached"] - np.deg2rad(20))
    # No faster and no further than it was told, but for what the loop overshoots.
    recording = done[0].recording()
    assert np.rad2deg(np.abs(recording["relative_rate"]).max()) < 11
    assert np.rad2deg(recording["relative_angle"].max()) < 20.2


def test_a_warm_up_comes_back(simulink: Bench) -> None:
    options = {"angle": "5 deg", "role": "warm-up", "cycles": 2, "speed": "20 deg/s"}
    done = execute(trials("move", simulink, options))
    assert done[0].trial.role is Role.WARM_UP
    (row,) = table(analyse("move", done), "moves").rows
    assert row["target"] == 0.0
    assert np.rad2deg(row["reached"]) == pytest.approx(0, abs=0.2)


def test_what_did_not_complete_is_said(simulink: Bench) -> None:
    done = execute(trials("move", simulink, {"angle": "1 deg"}))
    result = analyse("move", [failed(item) for item in done])
    assert not result.tables
    assert "1 of 1" in result.notes[0]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"angle": "5 deg", "position": "5 deg"}, "nothing to move"),
        ({"angle": "5 deg", "role": "warm-up"}, "set cycles"),
    ],
)
def test_what_makes_no_sense(simulink: Bench, options: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        trials("move", simulink, options)


def test_its_limits_are_checked(tmp_path: Any) -> None:
    path = tmp_path / "far.toml"
    path.write_text(
        '[[test]]\nname = "home"\nkind = "move"\nbench = "simulink"\nangle = "400 deg"\nseed = 1\n'
    )
    plan = make_plan(load_protocol(path, experiments(), shipped=protocols_folder()))
    assert plan.trials[0].role is Role.HOME
    with pytest.raises(LimitError, match=r"home: angle up to 400 deg"):
        check_limits(plan)
