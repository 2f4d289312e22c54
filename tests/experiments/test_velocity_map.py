"""The friction-velocity map, from planning to fit, on a bench whose friction is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from campaign.experiments.friction_map.runs import VelocityMapOptions, map_speeds, plan_run
from campaign.experiments.velocity_map import EXPERIMENT
from campaign.result import Result
from campaign.trial import Role
from tests.experiments.laboratory import analyse, execute, failed, finding, table, trials
from tests.physics.benches import bench

RATIO = 141.176
COMBINED = {
    "viscous_friction": 4.0 + RATIO * 0.001,
    "coulomb_torque": 26.0 + RATIO * 0.03,
    "static_torque": 32.0 + RATIO * 0.04,
    "stribeck_velocity": 0.03,
    "stribeck_exponent": 2.0,
}


@pytest.fixture(scope="module")
def full_map() -> Result:
    return analyse("velocity_map", execute(trials("velocity_map", bench(), {})))


@pytest.mark.slow
@pytest.mark.parametrize("direction", ["positive", "negative", "nominal"])
@pytest.mark.parametrize("exponent", ["free", "2"])
def test_the_fit_returns_the_benchs_combined_friction(
    full_map: Result, direction: str, exponent: str
) -> None:
    """Within 1 %, every parameter, both directions; T(load) + N T(motor) at one relative rate."""
    for name, true in COMBINED.items():
        found = finding(full_map, name, direction=direction, exponent=exponent)
        assert found.value == pytest.approx(true, rel=0.01), name


def test_an_imported_torque_is_as_uncertain_as_its_columns_constant() -> None:
    column = {"channels": [{"name": "drive_torque", "relative_uncertainty": 0.02}]}
    planned = trials("velocity_map", bench(), {"points": 8})
    imported = [
        replace(each, trial=each.trial.model_copy(update={"recording": column}))
        for each in execute(planned)
    ]
    found = finding(
        analyse("velocity_map", imported), "coulomb_torque", direction="positive", exponent="2"
    )
    parts = {each.source: each.standard_uncertainty for each in found.known.systematic}
    assert parts["constant of the drive_torque column"] == pytest.approx(0.02 * found.value)


def test_every_point_lies_on_the_curve(full_map: Result) -> None:
    rows = table(full_map, "map").rows
    assert len(rows) == 160
    for row in rows:
        rate = float(str(row["rate"]))
        fall = np.exp(-((rate / 0.03) ** 2))
        curve = COMBINED["coulomb_torque"] + fall * (
            COMBINED["static_torque"] - COMBINED["coulomb_torque"]
        )
        expected = np.sign(rate) * curve + COMBINED["viscous_friction"] * rate
        assert row["torque"] == pytest.approx(expected, rel=1e-3)
        assert rate == pytest.approx(row["speed"], rel=2e-3)


def test_the_shipped_speeds() -> None:
    speeds = np.rad2deg(map_speeds(VelocityMapOptions()))
    assert len(speeds) == 80
    assert speeds[0] == pytest.approx(0.05)
    assert speeds[-1] == pytest.approx(65.0)
    assert np.sum(speeds < 1.72) > 35  # dense below the Stribeck velocity


def deg(value: float) -> float:
    return float(np.deg2rad(value))


@pytest.mark.parametrize(
    ("speed", "window", "rule"),
    [
        # 20 s at 0.1 deg/s are 2 deg, less 0.75 deg to settle: 5 deg do not fit in.
        (0.1, 12.5, "max_time"),
        # 5 deg at 1 deg/s take 5 s, longer than 2 s.
        (1.0, 5.0, "window_angle"),
        # 5 deg at 10 deg/s take 0.5 s, shorter than 2 s; there are 60 deg, 6 s.
        (10.0, 2.0, "window_time"),
        # 60 deg at 60 deg/s are 0.8 s besides the ramps (0.2 s each), 0.3 s to settle.
        (60.0, 0.5, "max_travel"),
    ],
)
def test_windows_follow_the_rules(speed: float, window: float, rule: str) -> None:
    options = VelocityMapOptions()
    run = plan_run(deg(speed), options)
    assert run.window == pytest.approx(window, abs=2e-3)
    assert rule in run.rule
    for direction in (+1.0, -1.0):
        start, stop = run.window_of(direction)
        assert stop - start == pytest.approx(run.window)
        # All of the window lies within the constant speed, and behind the settling.
        commanded = run.command().sample(np.linspace(start + 1e-9, stop - 1e-9, 50))
        np.testing.assert_allclose(commanded, direction * deg(speed))


def test_travel_is_the_shorter_of_an_angle_and_a_time() -> None:
    options = VelocityMapOptions()
    for speed in options.speeds:
        run = plan_run(speed, options)
        motion = 2 * run.ramp + run.cruise
        way = speed * (run.cruise + run.ramp)
        assert motion <= 20.0 + 1e-9
        assert way <= deg(60.0) + 1e-9
        assert motion == pytest.approx(20.0) or way == pytest.approx(deg(60.0))
        command = run.command()
        times, values = np.array(command.times), np.array(command.values)
        there_and_back = np.sum(0.5 * np.diff(times) * (values[1:] + values[:-1]))
        assert there_and_back == pytest.approx(0.0, abs=1e-12)


def test_runs_that_cannot_settle_or_be_sampled_are_refused() -> None:
    with pytest.raises(ValueError, match="settle"):
        plan_run(deg(130.0), VelocityMapOptions())
    for changed in ({"sample_rate": "1 Hz"}, {"speeds": ["-1 deg/s"]}):
        options = EXPERIMENT.options.model_validate(changed)
        with pytest.raises(ValueError, match=r"samples|positive"):
            list(EXPERIMENT.trials(options, bench()))


def test_all_runs_start_at_one_place_after_a_warm_up() -> None:
    planned = trials("velocity_map", bench(), {"speeds": ["1 deg/s", "20 deg/s"]})
    assert [trial.role for trial in planned] == [Role.WARM_UP, Role.MEASUREMENT, Role.MEASUREMENT]
    assert {trial.task.start_angle for trial in planned} == {deg(-30.0)}
    assert all(trial.note for trial in planned)
    measured = execute(planned[1:])
    for done in measured:
        assert done.samples["relative_angle"][-1] == pytest.approx(deg(-30.0), abs=deg(0.1))


FEW = {"speeds": [f"{v} deg/s" for v in (5, 10, 15, 20, 30, 40)], "warm_up_cycles": 0}


def test_failed_trials_are_left_out_and_told() -> None:
    done = list(execute(trials("velocity_map", bench(), FEW)))
    done[2] = failed(done[2])
    result = analyse("velocity_map", done)
    assert len(table(result, "map").rows) == 10
    assert any("1 of 6 trials" in note for note in result.notes)


def curve_at(speed: float) -> float:
    """Equation 4.6 with the bench's combined friction; rad/s, N m."""
    own = COMBINED
    falls = np.exp(-((speed / own["stribeck_velocity"]) ** own["stribeck_exponent"]))
    dry = own["coulomb_torque"] + (own["static_torque"] - own["coulomb_torque"]) * falls
    return float(dry + own["viscous_friction"] * speed)


def test_one_trial_gives_the_friction_at_its_speed() -> None:
    done = execute(trials("velocity_map", bench(), {**FEW, "speeds": ["1 deg/s"]}))
    result = analyse("velocity_map", done)
    assert [t.key for t in result.tables] == ["map"]
    assert len(table(result, "map").rows) == 2
    found = finding(result, "friction_torque", direction="negative")
    assert found.value == pytest.approx(curve_at(deg(1.0)), rel=0.003)
    assert any("1 steady stretches show no line" in note for note in result.notes)


def test_four_speeds_give_a_line() -> None:
    """Above the Stribeck velocity, without noise: the line through four points of the curve."""
    speeds = (10, 20, 30, 40)
    options = {**FEW, "speeds": [f"{each} deg/s" for each in speeds]}
    result = analyse("velocity_map", execute(trials("velocity_map", bench(), options)))
    rates = np.deg2rad(speeds)
    slope, dry = np.polyfit(rates, [curve_at(each) for each in rates], 1)
    for direction in ("positive", "negative"):
        told = finding(result, "coulomb_torque", direction=direction)
        assert told.value == pytest.approx(dry, rel=0.003)
        assert finding(result, "viscous_friction", direction=direction).value == pytest.approx(
            slope, rel=0.02
        )
    (shown,) = (each for each in result.figures if each.key == "map")
    assert [len(panel.curves) for panel in shown.panels] == [4, 4]
    assert {each.quantity for each in result.key_numbers} == {"coulomb_torque", "viscous_friction"}


def test_nothing_measured_gives_nothing() -> None:
    assert analyse("velocity_map", ()).tables == ()
    done = execute(trials("velocity_map", bench(), {**FEW, "speeds": ["10 deg/s"]}))
    result = analyse("velocity_map", [failed(done[0])])
    assert result.findings == ()
    assert result.notes


def stiff(level: float):
    """The bench with bristles of another stiffness: Ts / sigma0 is 32 N m over it."""

    def edit(tree):
        tree["friction"]["load"]["bristle_stiffness"] = f"{level} N m/rad"

    return bench(edit)


def test_too_short_a_settling_is_told_in_the_plan_and_behind_the_run() -> None:
    """Seven times 32 N m / 12 000 N m/rad (0.153 deg) are 1.07 deg; 20 deg/s settles for 6 deg."""
    options = {**FEW, "speeds": ["1 deg/s", "20 deg/s"]}
    advice = "settle for 1.1 deg or more: Ts/sigma0 is 0.153 deg"
    slow, fast = trials("velocity_map", stiff(12_000), options)
    assert advice in slow.note
    assert "settle" not in fast.note
    result = analyse("velocity_map", execute([slow, fast]))
    assert f"At 1 deg/s: {advice}." in result.notes
    assert not any("settle for" in t.note for t in trials("velocity_map", bench(), options))
