"""Protocols on benches that leave something unsaid: who asks for it, where, and all at once."""

from __future__ import annotations

import pytest

from campaign.backends import backends
from campaign.errors import ProtocolError
from campaign.experiments import experiments
from campaign.physics.complete import PURPOSES
from campaign.protocol import Plan, load_protocol, make_plan
from campaign.protocol.limit_check import check_limits, check_loops
from campaign.protocol.missing_values import check_benches
from tests.protocol.conftest import SHIPPED, Desk

BARE = 'name = "rig"\n[axis]\nname = "x"\n'
LIMITS = """
[limits]
angle = "90 deg"
rate = "60 deg/s"
acceleration = "360 deg/s^2"
torque = "100 N m"
current = "20 A"
duration = "10 min"
"""
HELD = BARE + LIMITS
TEST = '[[test]]\nname = "t"\nkind = "{}"\nbench = §"rig.toml"\n'
SPEEDS = TEST.format("speeds") + 'speeds = ["1 deg/s", "5 deg/s"]\n'
SIM = tuple(backends()["sim"].needs)


def planned(desk: Desk, text: str, bench: str) -> Plan:
    desk.write("rig.toml", bench)
    return make_plan(desk.load(text), seed=1)


def test_a_simulation_names_every_missing_field_once_at_the_benchs_file(desk: Desk) -> None:
    desk.write("rig.toml", BARE)
    twice = SPEEDS + SPEEDS.replace('"t"', '"again"')
    protocol = desk.load(twice)
    with pytest.raises(ProtocolError) as caught:
        check_benches(protocol, SIM, "the backend 'sim'")
    (problem,) = caught.value.problems
    assert problem.file == desk.folder / "rig.toml"
    assert problem.line == 1
    assert all(f"{path} ({purpose})" in problem.message for path, purpose in PURPOSES.items())
    assert "analyse recordings" in problem.message


def test_hardware_is_asked_for_what_it_needs_and_no_more(desk: Desk) -> None:
    needs = backends()["serial"].needs
    assert needs == ("limits",)
    desk.write("rig.toml", BARE)
    with pytest.raises(ProtocolError, match=r"does not say: limits \("):
        check_benches(desk.load(SPEEDS), needs, "the backend 'serial'")
    desk.write("rig.toml", HELD)
    check_benches(desk.load(SPEEDS), needs, "the backend 'serial'")


def test_other_tests_benches_are_not_asked_about(desk: Desk) -> None:
    desk.write("rig.toml", BARE)
    whole = SPEEDS.replace('"t"', '"whole"').replace('§"rig.toml"', '"simulink"')
    protocol = desk.load(SPEEDS + whole)
    check_benches(protocol, SIM, "sim", only=("whole",))
    with pytest.raises(ProtocolError):
        check_benches(protocol, SIM, "sim", only=("t",))


def test_what_is_set_or_swept_is_said(desk: Desk) -> None:
    heavy = BARE.replace('name = "x"', 'name = "x"\ninertia = "35 kg m^2"')
    desk.write("rig.toml", heavy)
    sweep = '[test.matrix]\n"bench.axis.inertia" = ["30 kg m^2", "40 kg m^2"]\n'
    check_benches(desk.load(SPEEDS + sweep), ("axis.inertia",), "sim")
    desk.write("rig.toml", BARE)
    protocol = desk.load(SPEEDS, 't.bench.axis.inertia="35 kg m^2"')
    check_benches(protocol, ("axis.inertia",), "sim")
    swept = desk.load(SPEEDS + sweep)
    check_benches(swept, ("axis.inertia",), "sim")


def test_a_plan_that_moves_a_bench_without_limits_is_refused_at_the_test(desk: Desk) -> None:
    desk.write("rig.toml", BARE)
    with pytest.raises(ProtocolError) as caught:
        make_plan(desk.load(SPEEDS), seed=1)
    (problem,) = caught.value.problems
    assert {(problem.file, problem.line, problem.column)} == set(desk.marks)
    assert problem.message.startswith("test 't' (speeds): ")
    assert "limits (what must never be exceeded while it moves)" in problem.message


def test_an_experiment_says_what_its_plan_follows_from_at_the_test(desk: Desk) -> None:
    desk.write("rig.toml", BARE)
    path = desk.write("protocol.toml", TEST.format("velocity_map"))
    with pytest.raises(ProtocolError) as caught:
        make_plan(load_protocol(path, experiments(), shipped=SHIPPED), seed=1)
    (problem,) = caught.value.problems
    assert {(problem.file, problem.line, problem.column)} == set(desk.marks)
    assert problem.message.startswith("test 't' (velocity_map): ")
    assert "limits (what must never be exceeded while it moves)" in problem.message
    desk.write("rig.toml", HELD)
    assert make_plan(load_protocol(path, experiments(), shipped=SHIPPED), seed=1).trials


def test_a_plan_tells_what_it_cannot_predict(desk: Desk) -> None:
    plan = planned(desk, SPEEDS, HELD)
    (test,) = plan.tests
    assert {use.margin.limit for use in test.closest} == {
        "angle",
        "rate",
        "acceleration",
        "duration",
    }
    unpredicted, loops = test.warnings
    assert unpredicted == (
        "its torque and current cannot be predicted: the bench 'rig' does not say axis.inertia, "
        "motor.torque_constant"
    )
    assert loops.startswith("the margins of its loops are not known: the bench 'rig' does not say")
    assert test.loops == ()
    check_limits(plan)
    check_loops(plan)


def test_a_limit_that_can_be_predicted_is_held_all_the_same(desk: Desk) -> None:
    plan = planned(desk, SPEEDS.replace("5 deg/s", "80 deg/s"), HELD)
    assert {use.margin.limit for use in plan.breaches} == {"rate"}


def test_a_plan_on_a_whole_bench_has_nothing_of_that_to_tell(desk: Desk) -> None:
    plan = make_plan(desk.load(SPEEDS.replace('§"rig.toml"', '"simulink"')), seed=1)
    assert plan.tests[0].warnings == ()


def test_an_absent_table_is_absent_from_what_is_archived_of_whole_benches_only(desk: Desk) -> None:
    """A tree says null where nothing is known, as it does of an appendage; it reads back."""
    (trial, *_) = planned(desk, SPEEDS, HELD).trials
    assert [key for key, value in trial.bench.items() if value is None] == [
        "appendage",
        "motor",
        "gear",
        "variation",
        "controller",
    ]
