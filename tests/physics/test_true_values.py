"""The numbers that an identification should find, against sums made by hand."""

from __future__ import annotations

import numpy as np
import pytest

from campaign.physics.bench import Bench
from campaign.physics.steady_friction import steady_friction
from campaign.physics.true_values import DIRECTIONS, stribeck_parameters, true_of, true_value
from campaign.physics.variation import of_its_day
from campaign.protocol.bench_file import load_bench
from tests.physics.benches import LOAD, MOTOR, RATIO, bench

PLATFORM = load_bench("platform")


def test_torques_of_interfaces_add_at_the_load() -> None:
    """Table 4.3 is what `platform` was made for: 26 and 33.9 N m are the means of both."""
    own = {"direction": "positive", "exponent": "free"}
    assert true_value(PLATFORM, "coulomb_torque", own) == pytest.approx(
        16.12 + 2 * RATIO * 0.02432 + 2.31
    )
    assert true_value(PLATFORM, "static_torque", {"direction": "nominal"}) == pytest.approx(
        0.5 * (20.84 + 22.36 + 2 * RATIO * (0.03143 + 0.03374) + 2.99 + 3.21)
    )
    assert true_value(PLATFORM, "stribeck_exponent", {"direction": "negative"}) == 0.85


def test_a_motor_that_meets_its_own_rate() -> None:
    """Driven by the motor's rate, its sigma2 counts N^2 and its vs is N times faster at the motor.

    Two Stribeck velocities make no one curve.
    """
    own = {"direction": "positive"}
    assert true_value(bench(), "viscous_friction", own) == pytest.approx(
        LOAD["s2"] + RATIO * MOTOR["s2"]
    )
    assert true_value(bench(), "stribeck_velocity", own) == pytest.approx(LOAD["vs"])
    geared = bench(lambda tree: tree["friction"]["motor"].update(velocity="motor"))
    assert true_value(geared, "viscous_friction", own) == pytest.approx(
        LOAD["s2"] + RATIO**2 * MOTOR["s2"]
    )
    assert true_value(geared, "stribeck_velocity", own) is None
    assert true_value(geared, "static_torque", own) is not None


@pytest.mark.parametrize("sign", DIRECTIONS.values())
def test_they_are_the_steady_friction(sign: float) -> None:
    p = stribeck_parameters(of_its_day(PLATFORM), sign)
    speed = np.geomspace(1e-3, 1.0, 20)
    shape = np.exp(-((speed / p["stribeck_velocity"]) ** p["stribeck_exponent"]))
    fall = (p["static_torque"] - p["coulomb_torque"]) * shape
    dry, viscous = steady_friction(PLATFORM, sign * speed)
    total = p["coulomb_torque"] + fall + p["viscous_friction"] * speed
    assert sign * (dry + viscous) == pytest.approx(total, rel=1e-9)


def test_stiffness_of_one_interface_and_of_all() -> None:
    assert true_value(PLATFORM, "bristle_stiffness", {}) == 15284.0
    assert true_value(PLATFORM, "stiffness_at_rest", {"statistic": "mean"}) == pytest.approx(
        15284.0 + 2 * RATIO * 1000.0 + 141176.0
    )


def test_the_slow_part_of_bliman_and_sorine_takes_from_the_stiffness_at_rest() -> None:
    own = {
        "model": "bliman-sorine", "coulomb_torque": 10.0, "static_torque": 20.0,
        "bristle_stiffness": 9000.0, "slow_stiffness": 3000.0,
    }  # fmt: skip
    rig = Bench.model_validate(
        {**bench().model_dump(mode="json"), "friction": {"load": own}}, context={"si": True}
    )
    assert true_value(rig, "bristle_stiffness", {}) == pytest.approx(6000.0)
    assert true_value(rig, "stiffness_at_rest", {}) == pytest.approx(6000.0)


def test_what_is_no_parameter_has_no_true_value() -> None:
    held = {"direction": "positive", "exponent": "2"}
    assert true_value(PLATFORM, "static_torque", held) is None  # delta is 0.96
    assert true_value(PLATFORM, "stribeck_exponent", held) is None
    assert true_value(bench(), "coulomb_torque", held) is not None
    assert true_value(PLATFORM, "coulomb_torque", {"statistic": "standard deviation"}) is None
    assert true_value(PLATFORM, "coulomb_torque", {"component": "motor"}) is None
    assert true_value(PLATFORM, "bandwidth", {}) is None
    assert true_value(PLATFORM.with_friction({}), "coulomb_torque", {}) is None
    assert true_value(PLATFORM.with_friction({}), "bristle_stiffness", {}) is None


def test_small_motions_meet_the_sum_of_damping_and_the_inertia() -> None:
    """800 + 4 at the load, and (0.5 + 0.001) at the motor, which counts N times."""
    whole = 804.0 + RATIO * 0.501
    assert true_value(bench(), "damping_at_rest", {}) == pytest.approx(whole)
    assert true_value(bench(), "inertia", {}) == 35.0


def test_of_viscous_friction_that_differs_by_direction_small_motions_meet_the_mean() -> None:
    other = bench(
        lambda tree: tree["friction"]["load"].update(negative={"viscous_friction": "2 N m s/rad"})
    )
    found = true_value(other, "damping_at_rest", {})
    assert found == pytest.approx(803.0 + RATIO * 0.501, rel=1e-12)


def test_it_is_told_which_part_of_the_bench_is_true() -> None:
    assert true_of(bench(), "bristle_stiffness") == "friction.load alone"  # 32 N m of 37.6
    assert true_of(bench(), "damping_at_rest") == "the sum of 2 interfaces, before any slips"
    assert true_of(bench(), "inertia") == "the axis"
    assert true_of(bench(), "coulomb_torque") == "the sum of 2 interfaces"
    assert true_of(bench(), "stribeck_velocity") == "each of 2 interfaces"
    alone = bench(lambda tree: tree["friction"].pop("motor"))
    assert true_of(alone, "damping_at_rest") == ""
