"""What a bench states of a number, with the interval that its values give it."""

from __future__ import annotations

import math
from typing import Any

import pytest

from campaign.physics.bench import Bench
from campaign.physics.bench_knowledge import NORMAL_95
from campaign.physics.stated_values import stated_value
from campaign.protocol.problems import find_faults

FRICTION = {
    "model": "lugre",
    "coulomb_torque": "16 N m",
    "static_torque": "20 N m",
    "stribeck_velocity": "0.03 rad/s",
    "viscous_friction": "4 N m s/rad",
    "bristle_stiffness": "15000 N m/rad",
    "bristle_damping": "900 N m s/rad",
    "negative": {"coulomb_torque": "17 N m"},
}
OTHER = {**FRICTION, "side": "motor", "coulomb_torque": "0.5 N m", "static_torque": "0.6 N m"}
COULOMB = "friction.load.coulomb_torque"
NEGATIVE = "friction.load.negative.coulomb_torque"


def bench(known: dict[str, Any], correlations: Any = (), **friction: Any) -> Bench:
    made = find_faults(
        Bench,
        {
            "name": "rig",
            "axis": {"name": "tilt", "inertia": "2 kg m^2"},
            "gear": {"ratio": 10.0},
            "friction": {"load": FRICTION, **friction},
            "known": {"values": known, "correlations": correlations},
        },
    )
    assert isinstance(made, Bench), made
    return made


def sigma(size: str) -> dict[str, str]:
    return {"standard_uncertainty": size, "origin": "measured"}


def test_a_value_of_one_interface_has_its_own_interval() -> None:
    rig = bench({COULOMB: sigma("0.2 N m")})
    found = stated_value(rig, "coulomb_torque", {"direction": "positive"}, "N m")
    assert found.value == 16.0
    assert found.combined == pytest.approx((16.0 - 0.2 * NORMAL_95, 16.0 + 0.2 * NORMAL_95))


@pytest.mark.parametrize("share", [-0.8, 0.0, 0.5])
def test_the_mean_of_both_directions_knows_how_they_go_together(share: float) -> None:
    """u^2 of (a + b)/2 is (u_a^2 + u_b^2 + 2 r u_a u_b)/4 (GUM 5.2.2)."""
    known = {COULOMB: sigma("0.2 N m"), NEGATIVE: sigma("0.3 N m")}
    rig = bench(known, [(COULOMB, NEGATIVE, share)])
    found = stated_value(rig, "coulomb_torque", {"direction": "nominal"}, "N m")
    assert found.value == 16.5
    assert found.standard_error == pytest.approx(
        0.5 * math.sqrt(0.04 + 0.09 + 2 * share * 0.2 * 0.3)
    )


def test_a_sum_of_interfaces_needs_all_of_them_known() -> None:
    known = {COULOMB: sigma("0.2 N m")}
    where = ("coulomb_torque", {"direction": "positive"}, "N m")
    assert stated_value(bench(known, motor=OTHER), *where) is None
    known["friction.motor.coulomb_torque"] = sigma("0.1 N m")
    found = stated_value(bench(known, motor=OTHER), *where)
    assert found.value == pytest.approx(16.0 + 10.0 * 0.5)
    assert found.standard_error == pytest.approx(math.hypot(0.2, 10.0 * 0.1))


def test_what_nobody_says_how_well_it_is_known_is_not_stated() -> None:
    rig = bench({COULOMB: {"origin": "assumed"}})
    assert stated_value(rig, "coulomb_torque", {"direction": "positive"}, "N m") is None
    assert stated_value(rig, "no_such_number", {}, "N m") is None


def test_inertia_and_damping_at_rest() -> None:
    rig = bench(
        {
            "axis.inertia": sigma("0.1 kg m^2"),
            "friction.load.bristle_damping": sigma("30 N m s/rad"),
            "friction.load.viscous_friction": sigma("1 N m s/rad"),
        }
    )
    inertia = stated_value(rig, "inertia", {}, "kg m^2")
    damping = stated_value(rig, "damping_at_rest", {}, "N m s/rad")
    assert (inertia.value, inertia.standard_error) == (2.0, pytest.approx(0.1))
    assert damping.value == 904.0
    assert damping.standard_error == pytest.approx(math.hypot(30.0, 1.0))
