"""Breakaway ramps on a bench whose bristles are known."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from campaign.experiments.breakaway import default_positions
from campaign.result import Result
from tests.experiments.laboratory import analyse, execute, failed, finding, table, trials
from tests.physics.benches import bench

RATIO = 141.176
TWO = {"positions": ["-20 deg", "10 deg"], "torque_rate": "2 N m/s"}


def load_only(tree: dict[str, Any]) -> None:
    del tree["friction"]["motor"]


def result_of(edit: Any = None, options: dict[str, Any] = TWO) -> Result:
    return analyse("breakaway", execute(trials("breakaway", bench(edit), options)))


def test_stiffness_of_the_load_side_alone() -> None:
    result = result_of(load_only)
    mean = finding(result, "bristle_stiffness", statistic="mean")
    assert mean.value == pytest.approx(18000.0, rel=0.02)
    (first, *_) = table(result, "presliding").rows
    assert first["interfaces"] == 1
    assert float(str(first["chord"])) < 0.7 * 18000.0
    # The slow ramp breaks away just below Ts, and never above.
    assert 0.97 * 32.0 < float(str(first["breakaway_torque"])) <= 32.0


def test_with_both_interfaces_the_stiffnesses_add_until_the_motor_side_slips() -> None:
    result = result_of()
    after = finding(result, "bristle_stiffness", statistic="mean")
    at_rest = finding(result, "stiffness_at_rest", statistic="mean")
    assert after.value == pytest.approx(18000.0, rel=0.02)
    assert at_rest.value == pytest.approx(18000.0 + RATIO * 1000.0, rel=0.02)
    assert any("two slopes" in note for note in result.notes)


def test_damping_is_assumed_and_says_so() -> None:
    """2 zeta sqrt(sigma0 J) - sigma2, with the stiffness that was found."""
    result = result_of(load_only)
    stiffness = finding(result, "bristle_stiffness", statistic="mean").value
    damping = finding(result, "bristle_damping", statistic="mean").value
    assert damping == pytest.approx(1.6 * np.sqrt(stiffness * 35.0) - 4.0, rel=1e-6)
    assert any("assumed" in note for note in result.notes)
    columns = {column.name: column.label for column in table(result, "presliding").columns}
    assert "assumed" in columns["bristle_damping"]


def test_the_window_matters_little_and_is_reported() -> None:
    rows = table(result_of(load_only), "window").rows
    assert [row["share"] for row in rows] == [0.5, 0.65, 0.8, 0.9]
    for row in rows:
        assert row["mean"] == pytest.approx(18000.0, rel=0.03)


def test_the_ramp_may_begin_at_once() -> None:
    """Without a rest the angle still counts from where the ramp began, not from zero."""
    options = {**TWO, "positions": ["10 deg"], "rest": "0 s"}
    result = result_of(load_only, options)
    found = finding(result, "bristle_stiffness", statistic="mean")
    assert found.value == pytest.approx(18000.0, rel=0.02)


def test_ten_positions() -> None:
    positions = np.rad2deg(default_positions())
    np.testing.assert_allclose(positions, np.linspace(-45.0, 45.0, 10))
    planned = trials("breakaway", bench(), {})
    assert [trial.task.start_angle for trial in planned] == list(default_positions())


def test_a_ramp_that_ends_below_breakaway_is_told() -> None:
    result = result_of(load_only, {**TWO, "peak_torque": "20 N m"})
    assert result.tables == ()
    assert len([note for note in result.notes if "below breakaway" in note]) == 2


def test_failed_trials_and_empty_tests() -> None:
    done = list(execute(trials("breakaway", bench(load_only), TWO)))
    result = analyse("breakaway", [failed(done[0]), done[1]])
    assert len(table(result, "presliding").rows) == 2  # one measurement and the mean
    assert any("1 of 2 trials" in note for note in result.notes)
    assert analyse("breakaway", [failed(item) for item in done]).findings == ()
    assert analyse("breakaway", ()).tables == ()
