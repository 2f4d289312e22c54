"""What passes as a parameter of a rig: determined, possible, or bounded from above."""

import math

import pytest

from campaign.estimate import Estimate, Origin, Systematic
from campaign.estimation import gate
from campaign.estimation.gate import admitted, admitted_together


def number(name: str, value: float, half: float, **more: object) -> Estimate:
    return Estimate(name, value, "", value - half, value + half, 0.95, **more)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "value", "half", "matters"),
    [
        ("coulomb", 22.0, 81.0, 10.0),
        ("viscous", 80.0, 220.0, 50.0),
        ("inertia", 0.0005, 0.0038, 0.0),
        ("offset", -1.0, 0.6, 0.0),
    ],
)
def test_a_number_wider_than_half_of_it_and_of_what_matters_is_not_determined(
    name: str, value: float, half: float, matters: float
) -> None:
    found = admitted(number(name, value, half), matters)
    assert found.origin is Origin.NOT_DETERMINED
    assert found.reason in gate.TOO_WIDE
    assert (found.value, found.low, found.high) == (value, value - half, value + half)


def test_a_small_viscous_friction_survives_where_its_width_does_not_matter() -> None:
    one = number("viscous", 0.02, 0.015)
    assert admitted(one).origin is Origin.NOT_DETERMINED
    assert admitted(one, matters=0.1) is one


def test_what_may_be_zero_and_cannot_be_negative_gets_an_upper_bound() -> None:
    unknown, known = Systematic("inertia"), Systematic("band", 0.02)
    found = admitted(number("viscous", 0.01, 0.03, systematic=(known, unknown)), matters=0.2)
    assert found.kind == "at most"
    assert found.combined[0] is None
    # GUM: half-widths add in squares; the bound holds what is systematic once.
    assert found.combined[1] == pytest.approx(0.01 + math.hypot(0.03, 1.959964 * 0.02))
    assert found.systematic == (unknown,)
    assert admitted(found, 0.2) is found
    assert admitted(number("offset", 0.01, 0.03), 0.2).kind == "number"


@pytest.mark.parametrize(
    ("inertia", "coulomb", "cause"),
    [
        (0.3, -0.81, gate.COMPENSATED),
        (-0.12, -0.81, gate.OPPOSITE_SIGNS),
        (-0.12, 0.81, gate.SCALE_OR_DELAY),
    ],
)
def test_a_negative_parameter_is_unphysical_and_the_others_tell_the_likely_cause(
    inertia: float, coulomb: float, cause: object
) -> None:
    found = admitted_together(
        {"inertia": number("inertia", inertia, 0.05), "coulomb": number("coulomb", coulomb, 0.35)},
        {},
    )
    for one in found.values():
        if one.value < 0:
            assert one.origin is Origin.NOT_DETERMINED
            assert one.reason in gate.UNPHYSICAL
            assert dict(one.reason.values)["cause"] == cause.code  # type: ignore[attr-defined]
        else:
            assert one.origin is Origin.MEASURED


def test_what_may_be_negative_is() -> None:
    for name in ("offset", "spring", "gravity_sine", "coulomb_over_temperature", "friction_torque"):
        assert admitted(number(name, -2.0, 0.1)).origin is Origin.MEASURED


def test_only_a_measured_number_is_judged() -> None:
    for one in (
        number("coulomb", -1.0, 0.1, origin=Origin.GIVEN),
        Estimate("coulomb", 1.0, "", high=3.0, level=0.95, origin=Origin.AT_BOUND),
        Estimate.without_interval("delay", math.nan, "s", gate.NEGATIVE()),
    ):
        assert admitted(one) is one


def test_friction_that_is_negative_in_one_direction_only_is_a_constant_force() -> None:
    found = admitted_together(
        {
            "coulomb_positive": number("coulomb_positive", 2.0, 0.01),
            "coulomb_negative": number("coulomb_negative", -2.0, 0.01),
        },
        {},
    )
    for one, cause in zip(found.values(), (gate.ONE_SIDED, gate.UNPHYSICAL), strict=True):
        assert one.origin is Origin.NOT_DETERMINED
        assert one.reason in cause
        assert dict(one.reason.values)["cause"] == gate.CONSTANT_FORCE.code


def test_without_an_inertia_in_the_model_nothing_is_said_of_a_compensated_force() -> None:
    falling = {
        "coulomb_torque_positive": number("coulomb_torque_positive", 2.0, 0.1),
        "viscous_friction_positive": number("viscous_friction_positive", -0.5, 0.1),
    }
    one = admitted_together(falling, {})["viscous_friction_positive"]
    assert dict(one.reason.values)["cause"] == gate.NEGATIVE.code


def test_a_negative_number_without_an_interval_is_unphysical() -> None:
    one = Estimate("coulomb", -22.0, "N m")
    assert admitted(one).reason in gate.UNPHYSICAL
