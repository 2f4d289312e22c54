"""Points of a map at which the load did not slide steadily are left out of its fit, and told."""

from __future__ import annotations

import math
import tomllib

import pytest

from campaign.axis_kind import axis_terms, sides_in
from campaign.estimation.steadiness import NOT_REACHED, STICK_SLIP, drifting
from campaign.experiments.friction_map.curves import fit_map
from campaign.experiments.friction_map.default_options import velocity_map
from campaign.experiments.friction_map.points import Point, points_of, steady
from campaign.experiments.friction_map.runs import VelocityMapOptions
from campaign.experiments.shared.rig import Rig
from campaign.physics.bench import Bench
from tests.experiments.laboratory import Done, Tree, analyse, execute, finding, trials
from tests.physics.benches import SIMULINK, bench

LINEAR = SIMULINK.with_name("linear.toml")

SLOW = {
    "speeds": ["0.1 deg/s", "0.5 deg/s", "1 deg/s", "2 deg/s", "4 deg/s", "8 deg/s", "16 deg/s",
               "30 deg/s"],
    "warm_up_cycles": 0, "settle_angle": "0.2 deg", "settle_time": "0.1 s", "max_time": "15 s",
}  # fmt: skip


def lazy(tree: Tree) -> None:
    """A rate loop whose integral takes degrees to turn from +Ts to -Ts."""
    tree["controller"]["rate"]["integral"] = "0.3 1/s"


def test_a_load_that_stuck_in_its_window_is_no_point_of_the_curve() -> None:
    rig: Bench = bench(lazy)
    result = analyse("velocity_map", execute(trials("velocity_map", rig, SLOW)))
    told = [note for note in result.notes if "left out of the fit" in note]
    assert sum(int(note.split()[0]) for note in told) == 4
    assert any("0.1" in note for note in told)
    # Simulated without noise, so that what is left lies on the bench's own curve.
    static = finding(result, "static_torque", direction="negative", exponent="free").value
    true = sum(f.static_torque * f.at_load(rig.gear.ratio)[0] for f in rig.friction.values())
    assert static == pytest.approx(true, rel=0.01)


def test_a_load_that_stays_stuck_is_no_point_and_told_once() -> None:
    """Up to 2 deg/s the gain alone does not break it away, and the integral takes 98 deg."""

    def weak(tree: Tree) -> None:
        tree["controller"]["rate"]["integral"] = "0.02 1/s"

    result = analyse("velocity_map", execute(trials("velocity_map", bench(weak), SLOW)))
    assert any(
        note.startswith("8 of 16 points are left out of the fit, for speed not reached (0.1, -0.1")
        for note in result.notes
    )
    (settling,) = [note for note in result.notes if "or more: Ts/sigma0" in note]
    assert settling.startswith("At 0.1 to 4 deg/s: settle for 99 deg or more")


def test_the_angle_to_settle_has_the_integral_in_it() -> None:
    """2 Ts / (N Kt Ki): a stuck load lags that far behind before the drive pushes the other way."""
    rig = bench(lazy)
    static = Rig(rig).static_torque
    assert static is not None
    gains = rig.controller.rate
    turned = 2 * static / (rig.gear.ratio * rig.motor.torque_constant * gains.integral_gain)
    assert Rig(rig).unwinding(0.0) == pytest.approx(turned)
    # At a speed the proportional gain gives Kp v of it at once.
    per_ampere = rig.gear.ratio * rig.motor.torque_constant
    speed = static / (per_ampere * gains.proportional)
    assert Rig(rig).unwinding(speed) == pytest.approx(0.5 * turned)
    assert Rig(rig).turned_within(0.5 * turned) == pytest.approx(speed)
    assert Rig(rig).unwinding(2.1 * speed) == 0.0
    chosen = velocity_map(VelocityMapOptions(max_travel="2000 deg"), rig)["settle_angle"]
    assert chosen.value >= 0.99 * turned
    assert "integral" in chosen.reason


@pytest.mark.parametrize(
    ("change", "half", "steady"),
    [(0.0, 0.0, True), (0.0, 0.05, False), (0.04, 0.0, False), (-0.04, 0.0, False)],
)
def test_a_rate_that_changes_or_is_uncertain_is_not_steady(
    change: float, half: float, steady: bool
) -> None:
    """Of 0.1 rad/s: either alone is enough."""
    assert bool(drifting(change, half, 0.1)) is not steady
    assert not drifting(change, math.nan, 1.0)


@pytest.mark.parametrize(("mean", "reached"), [(0.1, True), (0.08, True), (0.07, False)])
def test_a_load_that_creeps_has_not_reached_its_speed(mean: float, *, reached: bool) -> None:
    """Commanded 0.1 rad/s: a stuck load bends its bristles at a steady rate of its own."""
    assert (drifting(0.0, 1e-6, mean, 0.1) in NOT_REACHED) is not reached
    assert not drifting(0.0, 1e-6, mean)


def soft(proportional: str) -> Bench:
    """The linear bench with friction that falls as exp(-v/vs), in the guides alone."""
    tree = tomllib.loads(LINEAR.read_text(encoding="utf-8"))
    tree["friction"] = {"load": {**tree["friction"]["load"], "stribeck_exponent": 1.0}}
    tree["controller"]["rate"] |= {"proportional": proportional, "integral": "10 1/s"}
    with axis_terms(sides_in(tree)):
        return Bench.model_validate(tree)


def points_on(rig: Bench) -> tuple[list[Point], Done]:
    """Points of a map as `init` would write it; m is written as rad."""
    options = {
        "slowest": "0.00019 rad/s", "fastest": "0.036 rad/s", "points": 40, "warm_up_cycles": 0,
        "settle_angle": "0.0085 rad", "window_angle": "0.005 rad", "max_travel": "0.06 rad",
        "max_time": "60 s", "settle_time": "0.6 s", "acceleration": "0.3 rad/s^2",
    }  # fmt: skip
    items = execute(trials("velocity_map", rig, options))
    return points_of(items, []), items[0]


def holds(points: list[Point], first: Done) -> list[bool]:
    """Whether the interval of the exponent holds 1, by direction."""
    fits = fit_map(points, first).estimates("free")
    found = [fits[way]["stribeck_exponent"].combined for way in ("positive", "negative")]
    return [low is not None and high is not None and low <= 1.0 <= high for low, high in found]


@pytest.mark.slow
def test_points_that_stick_and_slip_do_not_bend_the_curve() -> None:
    """A rate loop that is too soft: up to about vs (4 mm/s) the carriage sticks and slips."""
    rig = soft("4 A s/m")
    points, first = points_on(rig)
    notes: list[str] = []
    kept, left = steady(points, notes)
    slow = [point for point in points if abs(point.speed) < 3.3e-3]
    assert len(slow) > 40
    assert all(point.unsteady in STICK_SLIP for point in slow)
    assert all(point.unsteady.text in point.rule for point in left)
    assert not any(point.unsteady for point in points if abs(point.speed) > 4.5e-3)
    assert f"{len(slow)} of 80 points are left out of the fit, for stick-slip" in notes[0]
    assert holds(kept, first) == [True, True]


@pytest.mark.slow
def test_a_stiffer_rate_loop_slides_steadily() -> None:
    """What the note advises."""
    rig = soft("12 A s/m")
    assert not any(point.unsteady for point in points_on(rig)[0])
