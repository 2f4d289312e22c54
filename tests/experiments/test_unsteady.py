"""Points of a map at which the load did not slide steadily are left out of its fit, and told."""

from __future__ import annotations

import math

import pytest

from campaign.experiments.friction_map.runs import VelocityMapOptions
from campaign.experiments.shared.fitting import velocity_map
from campaign.experiments.shared.rig import Rig
from campaign.identification.steadiness import drifting
from campaign.physics.bench import Bench
from tests.experiments.laboratory import Tree, analyse, execute, finding, trials
from tests.physics.benches import bench

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
    (note,) = [note for note in result.notes if "left out of the fit" in note]
    assert "0.1" in note
    # Simulated without noise, so that what is left lies on the bench's own curve.
    static = finding(result, "static_torque", direction="negative", exponent="free").value
    true = sum(f.static_torque * f.at_load(rig.gear.ratio)[0] for f in rig.friction.values())
    assert static == pytest.approx(true, rel=0.01)


def test_the_angle_to_settle_has_the_integral_in_it() -> None:
    """2 Ts / (N Kt Ki): a stuck load lags that far behind before the drive pushes the other way."""
    rig = bench(lazy)
    static = Rig(rig).static_torque
    assert static is not None
    gains = rig.controller.rate
    turned = 2 * static / (rig.gear.ratio * rig.motor.torque_constant * gains.integral_gain)
    assert Rig(rig).unwinding == pytest.approx(turned)
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
