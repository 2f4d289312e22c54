"""Recordings of a rig of which little is known: what they say all the same, and what is told."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import pytest

from campaign.experiments import experiments
from campaign.experiments.shared.rig import Rig
from campaign.physics.bench import Bench
from campaign.physics.complete import IncompleteBenchError
from tests.experiments.laboratory import Done, analyse, execute, table_of_estimates, trials
from tests.physics.benches import KT, RATIO, bench

BARE = {"name": "rig", "axis": {"name": "azimuth"}}
HEAVY = {**BARE, "axis": {"name": "azimuth", "inertia": "35 kg m^2"}}
DRIVEN = {**HEAVY, "motor": {"torque_constant": f"{KT} N m/A"}, "gear": {"ratio": RATIO}}
SPEEDS = ["1 deg/s", "2 deg/s", "3 deg/s", "5 deg/s", "8 deg/s", "13 deg/s", "20 deg/s"]
GAINS = {"rate": {"form": "ideal", "proportional": "3 A s/deg", "integral": "30 1/s"}}
LIMITS = bench().limits.model_dump(mode="json")


def seen_by(facts: dict[str, Any], done: Sequence[Done]) -> tuple[Done, ...]:
    """The same recordings, of a rig of which no more is known than this."""
    tree = Bench.model_validate(facts).model_dump(mode="json")
    return tuple(replace(d, trial=d.trial.model_copy(update={"bench": tree})) for d in done)


@pytest.fixture(scope="module")
def runs() -> tuple[Done, ...]:
    options = {"speeds": SPEEDS, "settle_time": "1 s", "warm_up_cycles": 0, "max_time": "10 s"}
    return execute(trials("velocity_map", bench(), options))


def points(found: Any) -> list[tuple[float, float]]:
    return [
        (row["rate"].value, row["torque"].value) for row in table_of_estimates(found, "map").rows
    ]


def test_with_the_inertia_the_points_are_those_of_the_whole_bench(runs: tuple[Done, ...]) -> None:
    whole = analyse("velocity_map", runs)
    known = analyse("velocity_map", seen_by(HEAVY, runs))
    assert points(known) == points(whole)
    assert len(points(whole)) == 2 * len(SPEEDS)
    assert [each.value for each in known.findings] == [each.value for each in whole.findings]
    assert not any("axis.inertia" in note for note in known.notes)


def gathering_speed(done: Sequence[Done], acceleration: float) -> tuple[Done, ...]:
    """The same recordings, had the load gathered speed all through them (rad/s^2)."""

    def faster(item: Done) -> Done:
        rate = item.samples.channels["gyro_rate"]
        changed = replace(rate, samples=rate.samples + acceleration * item.samples.time)
        channels = {**item.samples.channels, "gyro_rate": changed}
        return replace(item, samples=replace(item.samples, channels=channels))

    return tuple(map(faster, done))


def test_without_it_what_accelerates_the_load_stays_in_friction_and_is_told(
    runs: tuple[Done, ...],
) -> None:
    """35 kg m^2 at 0.01 rad/s^2 are 0.35 N m."""
    faster = gathering_speed(runs, 0.01)
    known = analyse("velocity_map", seen_by(HEAVY, faster))
    bare = analyse("velocity_map", seen_by(BARE, faster))
    for (rate, torque), (other, more) in zip(points(known), points(bare), strict=True):
        assert other == rate
        assert more - torque == pytest.approx(0.35, rel=1e-6)
    (note,) = [note for note in bare.notes if "axis.inertia" in note]
    assert "by up to 0.57 deg/s² in these windows" in note
    for row in table_of_estimates(bare, "map").rows:
        parts = {part.source: part.standard_uncertainty for part in row["torque"].systematic}
        assert parts["inertia"] is None
        assert "with what the residual acceleration takes" in row["torque"].method


def test_a_breakaway_without_an_inertia_says_once_that_there_is_none() -> None:
    options = {"positions": ["0 deg", "5 deg"], "torque_rate": "10 N m/s", "peak_torque": "60 N m"}
    ramps = execute(trials("breakaway", bench(), options))
    whole = analyse("breakaway", ramps)
    known = analyse("breakaway", seen_by(HEAVY, ramps))
    assert whole.findings
    torques = [f.value for f in whole.findings if f.quantity == "breakaway_torque"]
    assert [f.value for f in known.findings if f.quantity == "breakaway_torque"] == torques
    bare = analyse("breakaway", seen_by(BARE, ramps))
    assert bare.findings == ()
    assert len([note for note in bare.notes if "axis.inertia" in note]) == 1


@pytest.mark.parametrize("kind", ["step_response", "stabilization", "frequency_response", "move"])
def test_other_measurements_need_nothing_of_the_rig(kind: str) -> None:
    own = {
        "step_response": {"step": "1 deg/s"},
        "stabilization": {"cycles": 3, "acceleration": "18 deg/s^2"},
        "frequency_response": {"frequencies": ["1 Hz", "2 Hz", "4 Hz", "8 Hz"]},
        "move": {"angle": "5 deg"},
    }[kind]
    done = execute(trials(kind, bench(), own))
    whole, bare = analyse(kind, done), analyse(kind, seen_by(BARE, done))
    assert [(f.quantity, f.value) for f in bare.findings] == [
        (f.quantity, f.value) for f in whole.findings
    ]
    assert len(bare.tables) == len(whole.tables)


def test_the_theory_of_an_observer_is_told_what_it_lacks() -> None:
    own = {
        "corners": ["5 Hz"],
        "noise_time": "0 s",
        "disturbance_frequencies": [],
        "acceleration": "18 deg/s^2",
        "cycles": 3,
    }
    done = execute(trials("observer_gain", bench(), own))
    bare = analyse("observer_gain", seen_by(BARE, done))
    assert bare.is_empty
    assert len(bare.left_out) == len(done)
    for each in bare.left_out:
        assert re.search(r"theory of an observer.*motor.resistance", each.reason.text)


def test_what_a_plan_is_made_of_is_asked_for_field_by_field() -> None:
    fit = experiments()["velocity_map"].fit
    assert fit is not None
    options = experiments()["velocity_map"].options()
    with pytest.raises(IncompleteBenchError) as caught:
        fit(options, Bench.model_validate(DRIVEN))
    assert caught.value.paths == ("limits",)


def test_a_map_is_planned_from_limits_and_what_its_test_writes() -> None:
    """Nobody says how fast the loop is: it settles for a usual time, or as the test says."""
    fit, kind = experiments()["velocity_map"].fit, experiments()["velocity_map"].options
    assert fit is not None
    limited = Bench.model_validate(BARE).model_copy(update={"limits": bench().limits})
    chosen = fit(kind(), limited)
    assert chosen["settle_time"].value == 1.0
    assert "the rate loop is not described" in chosen["settle_time"].reason
    assert "fastest" in chosen
    stated = {"speeds": SPEEDS, "settle_time": "2 s", "acceleration": "50 deg/s^2", "rest": "1 s"}
    assert not fit(kind.model_validate(stated), limited).keys() & stated.keys()
    (run, *_) = trials("velocity_map", limited, {**stated, "warm_up_cycles": 0})
    (window,) = (each for each in run.windows if each.name == "settled positive")
    ramp = 1.0 / 50.0
    assert window.start == pytest.approx(1.0 + ramp + 2.0)
    driven = Bench.model_validate({**DRIVEN, "controller": GAINS}).model_copy(
        update={"limits": bench().limits}
    )
    assert "time constants of the loop" in fit(kind(), driven)["settle_time"].reason


def test_the_pace_of_a_loop_follows_from_what_is_known_of_it() -> None:
    """Without the motor's winding: J / (N Kt Kpv), which the whole loop has within a tenth."""
    whole = Rig(bench())
    known = Bench.model_validate({**DRIVEN, "controller": GAINS})
    assert Rig(known).loop_time == pytest.approx(whole.loop_time, rel=0.1)
    assert Rig(Bench.model_validate({**BARE, "controller": GAINS})).loop_time is None
    assert Rig(Bench.model_validate(DRIVEN)).loop_time is None


def test_limits_bound_what_no_inertia_does() -> None:
    limits = bench().limits
    known = Rig(bench())
    light = Rig(Bench.model_validate(BARE).model_copy(update={"limits": limits}))
    assert light.torque == limits.torque
    assert light.acceleration(0.1) == pytest.approx(0.9 * limits.acceleration)
    assert known.acceleration(0.1) <= light.acceleration(0.1)
