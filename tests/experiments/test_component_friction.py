"""Each friction interface on its own, read with a sensor of finite resolution."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from campaign.estimation.scatter import WITHIN_A_COUNT
from campaign.experiments.interface import bench_of
from campaign.result import Result
from tests.experiments.laboratory import analyse, execute, failed, finding, table, trials
from tests.physics.benches import RATIO, bench

KIND = "component_friction"


def three(tree: dict[str, Any]) -> None:
    """Motor, gearbox and load, with friction like Table 4.1's."""
    motor = tree["friction"]["motor"] | {"bristle_stiffness": "100 N m/rad"}
    tree["friction"]["motor"] = motor | {"static_torque": "0.033 N m"}
    tree["friction"]["gearbox"] = motor | {"static_torque": "0.0375 N m"}
    tree["friction"]["load"] |= {"static_torque": "21.4 N m", "coulomb_torque": "18 N m"}


def scattering(tree: dict[str, Any]) -> None:
    three(tree)
    together = {"paths": ["coulomb_torque", "static_torque"], "relative": 0.07}
    tree["variation"] = {"seed": 3, "trial_to_trial": {"torques": together}}


def result_of(edit: Any, **options: Any) -> Result:
    return analyse(KIND, execute(trials(KIND, bench(edit), options)))


def test_a_perfect_sensor_reads_each_components_own_static_torque() -> None:
    result = result_of(three, measurements=1, sensor_resolution="0 N m", torque_rate="1 N m/s")
    for component, expected in (
        ("load", 21.4),
        ("motor", RATIO * 0.033),
        ("gearbox", RATIO * 0.0375),
    ):
        found = finding(result, "breakaway_torque", component=component, statistic="mean").value
        assert 0.96 * expected < found <= 1.001 * expected


def test_motor_side_readings_are_multiples_of_one_count_seen_through_the_gear() -> None:
    """0.01 N m times 141.176 is 1.41 N m: 0.033 N m reads 0.03, and 0.0375 reads 0.04."""
    result = result_of(three, measurements=1)
    motor = finding(result, "breakaway_torque", component="motor", statistic="mean").value
    gearbox = finding(result, "breakaway_torque", component="gearbox", statistic="mean").value
    load = finding(result, "breakaway_torque", component="load", statistic="mean").value
    assert motor == pytest.approx(3 * 0.01 * RATIO)
    assert gearbox == pytest.approx(4 * 0.01 * RATIO)
    assert load * 100 == pytest.approx(round(load * 100))


def test_sum_and_share_follow_from_the_means() -> None:
    result = result_of(three, measurements=2)
    means = {
        name: finding(result, "breakaway_torque", component=name, statistic="mean").value
        for name in ("motor", "gearbox", "load")
    }
    total = finding(result, "breakaway_torque", component="sum").value
    assert total == pytest.approx(sum(means.values()))
    assert finding(result, "load_share").value == pytest.approx(means["load"] / total)


def test_trials_scatter_and_the_deviation_is_theirs() -> None:
    result = result_of(scattering, components=["load"], measurements=10)
    readings = [
        float(str(row["load"]))
        for row in table(result, "component-friction").rows
        if isinstance(row["measurement"], int)
    ]
    assert len(readings) == 10
    deviation = finding(result, "breakaway_torque", statistic="standard deviation").value
    assert deviation == pytest.approx(np.sqrt(np.mean((readings - np.mean(readings)) ** 2)))
    assert 0.03 < deviation / np.mean(readings) < 0.12  # ten draws of 7 %
    assert not [f for f in result.findings if f.quantity == "load_share"]


def test_a_deviation_of_ten_readings_is_one_draw() -> None:
    """Chi-square with nine: 0.688 to 1.826 of s, which divides by nine."""
    result = result_of(scattering, components=["load"], measurements=10)
    found = finding(result, "breakaway_torque", statistic="standard deviation").estimate
    assert found is not None
    assert found.low == pytest.approx(0.688 * found.value * np.sqrt(10 / 9), rel=2e-3)
    assert found.high == pytest.approx(1.826 * found.value * np.sqrt(10 / 9), rel=2e-3)
    mean = finding(result, "breakaway_torque", statistic="mean").estimate
    assert mean is not None
    assert mean.half_width == pytest.approx(2.262 * found.value / 3.0, rel=1e-3)


def test_a_deviation_below_one_count_is_a_bound() -> None:
    """Ten readings on one count of 1.41 N m: friction may scatter by 0.44 of a count, unseen."""
    result = result_of(three, components=["motor"], measurements=10)
    found = finding(result, "breakaway_torque", statistic="standard deviation").estimate
    assert found is not None
    assert (found.value, found.low) == (0.0, 0.0)
    assert found.high == pytest.approx(0.443 * 0.01 * RATIO, rel=2e-3)
    assert found.reason in WITHIN_A_COUNT
    mean = finding(result, "breakaway_torque", statistic="mean").estimate
    assert mean is not None
    assert mean.half_width == pytest.approx(1.96 * 0.01 * RATIO / np.sqrt(12), rel=2e-3)


def test_every_number_has_an_interval_or_says_why() -> None:
    result = result_of(scattering, measurements=3)
    assert all(found.known.says_enough and found.estimate for found in result.findings)
    share = finding(result, "load_share").estimate
    assert share is not None
    means = {
        name: finding(result, "breakaway_torque", component=name, statistic="mean").estimate
        for name in ("motor", "gearbox", "load")
    }
    values = {name: each.value for name, each in means.items() if each is not None}
    errors = {name: each.standard_error for name, each in means.items() if each is not None}
    total, others = sum(values.values()), values["motor"] + values["gearbox"]
    by_load = others / total**2 * errors["load"]
    by_others = values["load"] / total**2 * np.hypot(errors["motor"], errors["gearbox"])
    assert share.standard_error == pytest.approx(np.hypot(by_load, by_others))


def test_both_directions_are_measured_in_turn() -> None:
    def lopsided(tree: dict[str, Any]) -> None:
        tree["friction"]["load"] |= {"negative": {"static_torque": "40 N m"}}

    options = {"components": ["load"], "measurements": 2}
    result = result_of(lopsided, **options)
    first, second = (
        finding(result, "breakaway_torque", measurement=number).value for number in (1, 2)
    )
    assert 0.96 * 32 < first < 32.01
    assert 0.96 * 40 < second < 40.01
    only = result_of(lopsided, **options, direction="negative")
    assert finding(only, "breakaway_torque", measurement=1).value == pytest.approx(second, abs=0.02)


def test_scatter_may_be_the_tests_own() -> None:
    (trial, _) = trials(KIND, bench(three), {"components": ["load"], "measurements": 2})
    assert bench_of(trial).variation is None
    options = {"components": ["load"], "measurements": 10, "scatter": 0.05}
    deviation = finding(
        result_of(three, **options), "breakaway_torque", statistic="standard deviation"
    )
    assert 0.02 * 21.4 < deviation.value < 0.09 * 21.4


def test_what_scatters_elsewhere_is_left_out() -> None:
    def edit(tree: dict[str, Any]) -> None:
        scattering(tree)
        tree["variation"]["day_to_day"] = {
            "load.coulomb_torque": 0.1,
            "motor": {"static_torque": 0.1},
        }
        tree["gear"]["preload"] = {
            "torque": "33 N m",
            "nominal": "33 N m",
            "shares": {"load.static_torque": 1.0},
        }

    for trial in trials(KIND, bench(edit), {"components": ["motor"], "measurements": 2}):
        alone = bench_of(trial)
        assert alone.variation is not None
        assert [line.name for line in alone.variation.days] == ["motor.static_torque"]
        assert [line.name for line in alone.variation.trials] == ["torques"]
        assert alone.gear.preload is not None
        assert alone.gear.preload.by_path == {}


def test_only_one_component_is_on_the_bench() -> None:
    planned = trials(KIND, bench(three), {"measurements": 3})
    assert len(planned) == 9
    for trial in planned:
        assert list(bench_of(trial).friction) == [trial.point["component"]]


def test_a_component_the_bench_does_not_have() -> None:
    with pytest.raises(ValueError, match="no friction interface 'gearbox'; it has load, motor"):
        trials(KIND, bench(), {"components": ["gearbox"]})


def test_a_component_that_was_not_measured_makes_no_sum() -> None:
    done = [
        failed(item) if item.trial.point["component"] == "motor" else item
        for item in execute(trials(KIND, bench(three), {"measurements": 1}))
    ]
    result = analyse(KIND, done)
    assert not [f for f in result.findings if f.conditions.get("component") in ("sum", "motor")]
    assert finding(result, "breakaway_torque", component="load", statistic="mean").value > 18
