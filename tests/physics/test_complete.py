"""A bench is facts: what it may leave unsaid, and who asks for what it leaves out."""

from __future__ import annotations

import pickle
import re
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from campaign.physics.bench import Bench
from campaign.physics.bench_facts import facts_of
from campaign.physics.bench_fingerprint import fingerprint
from campaign.physics.complete import (
    PURPOSES,
    CompleteBench,
    IncompleteBenchError,
    complete,
    lacking,
    require,
)
from campaign.physics.limits import margins, unpredicted
from campaign.physics.linear_friction import NoLoopError
from campaign.physics.plan_loops import loops_of, loops_used
from campaign.physics.resolution import resolution_margins
from campaign.physics.steady_friction import steady_friction
from campaign.physics.variation import of_its_day
from campaign.protocol.bench_file import load_bench
from campaign.signals import Polyline, Sine
from campaign.trial import Task, Trial
from tests.physics.benches import RATIO, bench, stribeck

BARE = {"name": "rig", "axis": {"name": "x"}}
RATE = Task(
    mode="rate",
    command=Sine(amplitude=0.1, frequency=1.0),
    duration=1.0,
    window=(0.0, 1.0),
    sample_rate=100.0,
)
TORQUE = RATE.model_copy(
    update={"mode": "torque", "command": Polyline(times=(0.0, 1.0), values=(0.0, 5.0))}
)


def without(*paths: str) -> Bench:
    """The simulink bench, nothing said at these dotted paths."""

    def edit(tree: dict[str, Any]) -> None:
        for path in paths:
            *tables, last = path.split(".")
            table = tree
            for name in tables:
                table = table.get(name, {})
            table.pop(last, None)

    return bench(edit)


def test_a_name_and_an_axis_are_a_bench() -> None:
    rig = Bench.model_validate(BARE)
    assert (rig.name, rig.axis.name, rig.friction) == ("rig", "x", {})
    assert lacking(rig) == tuple(PURPOSES)
    assert rig.torque_per_current is None
    again = Bench.model_validate(rig.model_dump(mode="json"), context={"si": True})
    assert again == rig
    for missing in ("name", "axis"):
        with pytest.raises(ValidationError, match=missing):
            Bench.model_validate({key: value for key, value in BARE.items() if key != missing})


def test_what_a_simulation_needs() -> None:
    """Every symbol of the loop's equations (`physics/loop.py`), and the limits."""
    motor = ("torque_constant", "back_emf_constant", "resistance", "inductance")  # Kt, Ke, R, L
    others = {"axis.inertia", "controller.rate", "controller.current", "limits"}
    assert set(PURPOSES) == {f"motor.{name}" for name in motor} | others


def test_all_that_is_missing_is_named_with_what_it_is_for() -> None:
    with pytest.raises(IncompleteBenchError) as caught:
        complete(Bench.model_validate(BARE), "the backend 'sim'")
    assert caught.value.paths == tuple(PURPOSES)
    message = str(caught.value)
    assert message.startswith("the backend 'sim' needs what the bench 'rig' does not say: ")
    for path, purpose in PURPOSES.items():
        assert f"{path} ({purpose})" in message
    elsewhere = pickle.loads(pickle.dumps(caught.value))
    assert (str(elsewhere), elsewhere.paths) == (message, tuple(PURPOSES))


@pytest.mark.parametrize("path", [path for path in PURPOSES if path != "motor.torque_constant"])
def test_each_fact_is_missed_by_itself(path: str) -> None:
    incomplete = without(path)
    assert lacking(incomplete) == (path,)
    with pytest.raises(ValidationError):  # and the types say the same
        CompleteBench.model_validate(incomplete.model_dump(mode="json"), context={"si": True})
    with pytest.raises(IncompleteBenchError, match=re.escape(path)):
        complete(incomplete)


def test_a_motor_is_its_torque_constant_at_least() -> None:
    with pytest.raises(ValidationError, match="torque_constant"):
        without("motor.torque_constant")
    assert lacking(without("motor")) == tuple(path for path in PURPOSES if "motor." in path)


def test_completing_adds_nothing_and_changes_nothing() -> None:
    rig = load_bench("platform")
    whole = complete(rig)
    assert isinstance(whole, CompleteBench)
    assert complete(whole) is whole
    assert whole.model_dump(mode="json") == rig.model_dump(mode="json")
    assert whole.model_fields_set == rig.model_fields_set
    assert fingerprint(whole) == fingerprint(rig)
    assert isinstance(of_its_day(whole), CompleteBench)


def test_what_was_archived_of_a_shipped_bench_is_archived_still() -> None:
    """The tree, and so the fingerprint of a trial, as the program wrote it that needed all of it.

    Computed with it (commit a28323c): a field that may now be absent has left no trace.
    """
    tree = load_bench("platform").model_dump(mode="json")
    trial = Trial(number=1, test="t", kind="k", seed=7, bench=tree, task=RATE)
    assert trial.fingerprint == KEPT


KEPT = "328a56096b56336aaaf60a028d82668e9823d3b79f69bed1e10fd1c5955898d4"


def test_what_is_absent_is_not_in_the_fingerprint_of_a_bench() -> None:
    known = {**BARE, "motor": {"torque_constant": "0.4 N m/A"}}
    more = {**known, "friction": {}, "description": "said in full"}
    assert fingerprint(Bench.model_validate(known)) == fingerprint(Bench.model_validate(more))
    assert fingerprint(Bench.model_validate(known)) != fingerprint(Bench.model_validate(BARE))


def test_friction_of_the_motors_side_needs_the_gear() -> None:
    rig = {**BARE, "friction": {"bearing": stribeck(5.0, 4.0)}}
    dry, _ = steady_friction(Bench.model_validate(rig), np.array([10.0]))
    assert dry == pytest.approx([4.0])
    for key in ("side", "velocity"):
        rig["friction"] = {"motor": stribeck(5.0, 4.0, **{key: "motor"})}
        with pytest.raises(ValidationError, match=r"friction.motor.*gear.ratio"):
            Bench.model_validate(rig)
        Bench.model_validate({**rig, "gear": {"ratio": RATIO}})


def test_sensors_of_an_unknown_controller_are_facts() -> None:
    """Only of a controller that is said to be continuous it is known that it sees exactly."""
    gyro = {"sensors": {"gyro": {"noise": "1 deg/s"}}}
    assert Bench.model_validate({**BARE, **gyro}).sensors.gyro.noise > 0
    Bench.model_validate({**BARE, **gyro, "controller": {"pointing_high_pass": "1 Hz"}})
    with pytest.raises(ValidationError, match="sample_rate"):
        bench(lambda tree: tree.update(gyro))


def test_nothing_moves_without_limits() -> None:
    with pytest.raises(IncompleteBenchError, match="limits"):
        margins(without("limits"), RATE)


def test_a_limit_that_nobody_can_predict_is_left_out_and_named() -> None:
    whole = {each.limit: each for each in margins(bench(), RATE)}
    light = without("axis.inertia")
    assert unpredicted(light, RATE) == {"torque": ("axis.inertia",), "current": ("axis.inertia",)}
    assert {each.limit: each for each in margins(light, RATE)} == {
        limit: each for limit, each in whole.items() if limit not in ("torque", "current")
    }
    assert unpredicted(light, TORQUE) == {}  # the torque is commanded
    assert margins(light, TORQUE) == margins(bench(), TORQUE)
    undriven = without("motor")
    assert unpredicted(undriven, TORQUE) == {"current": ("motor.torque_constant",)}
    assert "current" not in {each.limit for each in margins(undriven, TORQUE)}
    assert unpredicted(undriven, RATE.model_copy(update={"mode": "prescribed"})) == {}
    assert unpredicted(bench(), RATE) == {}
    assert resolution_margins(without("controller"), RATE) == ()


def test_loops_and_facts_are_told_as_far_as_they_are_known() -> None:
    light = without("motor.resistance")
    found = dict(loops_of(light, "none", "rate"))
    assert all(isinstance(each, NoLoopError) for each in found.values())
    assert all("motor.resistance" in str(each) for each in found.values())
    assert loops_used([(1, RATE, light)]) == ()
    assert loops_used([(1, RATE, bench())]) != ()
    told = {fact.subject for fact in facts_of(bench())}
    fewer = {fact.subject for fact in facts_of(light)}
    assert fewer < told
    assert told - fewer == {"crossover of the rate loop against the bandwidth of the current loop"}
    assert facts_of(Bench.model_validate(BARE)) == ()


def test_who_needs_one_fact_asks_for_one() -> None:
    require(without("motor"), ("axis.inertia",), "an analysis")
    with pytest.raises(IncompleteBenchError) as caught:
        require(Bench.model_validate(BARE), ("axis.inertia", "gear.ratio"), "an analysis")
    assert caught.value.paths == ("axis.inertia", "gear.ratio")
