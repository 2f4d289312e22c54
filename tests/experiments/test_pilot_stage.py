"""The pilot of a velocity map: what follows from it, within what it announced; and warnings."""

from __future__ import annotations

import math
import random
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np
import pytest
from scipy.stats import binomtest

from campaign.estimate import Estimate
from campaign.experiments.analysis import measured
from campaign.experiments.friction_map.pilot import (
    FEWEST,
    SPEEDS,
    PilotedMapOptions,
    choose,
    pilot_speeds,
)
from campaign.experiments.friction_map.runs import (
    MEMORIES,
    map_speeds,
    plan_run,
    run_requests,
    settled_angle,
)
from campaign.experiments.interface import TestData
from campaign.experiments.shared.rig import Rig
from campaign.experiments.velocity_map import EXPERIMENT
from campaign.physics.bench import Bench
from campaign.physics.limits import margins
from campaign.physics.true_values import stribeck_parameters
from campaign.physics.truth import digest, plant_of
from campaign.protocol.stage_trials import ROUNDING
from campaign.recording import Recording
from campaign.result import Result
from campaign.trial import Role, Trial, TrialRequest
from tests.coverage import laboratory
from tests.coverage.benches import BENCHES, Case, Scale, make_case
from tests.coverage.judging import CLAIMED, Pooled, entries, pooled
from tests.experiments.laboratory import Done, analyse, failed, finding, table
from tests.experiments.test_fitting import fitted, limited

(STAGE,) = EXPERIMENT.stages
DEG = math.pi / 180.0
SOFT = 29
"""A bench of the coverage tests with a long memory: Ts / sigma0 of 0.277 deg."""


@dataclass(frozen=True)
class Piloted:
    """A map with a pilot on a bench that is stated without friction, as the program runs it."""

    options: PilotedMapOptions
    pilot: tuple[Done, ...]
    following: tuple[Done, ...]

    @property
    def done(self) -> tuple[Done, ...]:
        return (*self.pilot, *self.following)

    @cached_property
    def result(self) -> Result:
        return analyse("velocity_map", self.done)


def numbered(
    case: Case, options: PilotedMapOptions, requests: Iterable[TrialRequest], first: int, draw: int
) -> list[Trial]:
    bench, truth = case.stated.model_dump(mode="json"), digest(plant_of(case.truth))
    return [
        Trial(
            number=number, test="map", kind="velocity_map", role=request.role,
            point=dict(request.point), options=options.model_dump(mode="json"),
            seed=1000 * draw + number, bench=bench, task=request.task, note=request.note,
            windows=request.windows, truth=truth,
        )
        for number, request in enumerate(requests, start=first)
    ]  # fmt: skip


def measured_once(done: Iterable[Done]) -> tuple[Done, ...]:
    """With what each recording says by itself, as a run has it when a trial has ended."""
    return tuple(replace(item, estimates=_of(item)) for item in done)


def _of(item: Done) -> tuple[Estimate, ...]:
    try:
        return tuple(measured(EXPERIMENT, item))
    except ValueError:  # it says nothing
        return ()


def asked(case: Case, options: PilotedMapOptions, done: tuple[Done, ...]) -> list[TrialRequest]:
    return list(STAGE.trials(options, case.stated, TestData("map", "velocity_map", {}, done)))


def run(case: Case, draw: int = 0, **written: object) -> Piloted:
    options, _ = fitted("velocity_map", case.stated, **written)
    first = numbered(case, options, EXPERIMENT.trials(options, case.stated), 1, draw)
    pilot = measured_once(laboratory.execute(case, first))
    if not options.pilot:
        return Piloted(options, pilot, ())
    then = numbered(case, options, asked(case, options, pilot), len(pilot) + 1, draw)
    return Piloted(options, pilot, measured_once(laboratory.execute(case, then)))


@cache
def piloted_by(number: int) -> Piloted:
    """A bench of the coverage tests with a pilot; it is executed once, and read only."""
    return run(make_case(number), pilot=True, warm_up_cycles=0)


def speeds(done: Iterable[Done]) -> list[float]:
    measured = (item.trial for item in done if item.trial.role is Role.MEASUREMENT)
    return [float(str(trial.point["speed"])) for trial in measured]


@pytest.fixture(scope="module")
def soft() -> Piloted:
    return piloted_by(SOFT)


# --- what follows ------------------------------------------------------------------------------


@pytest.mark.slow
def test_what_follows_keeps_to_the_protocol(soft: Piloted) -> None:
    options, chosen = soft.options, speeds(soft.following)
    assert speeds(soft.pilot) == list(pilot_speeds(options))
    assert len(speeds(soft.done)) <= options.points
    assert len(set(speeds(soft.done))) == len(soft.done), "a repeat would be averaged"
    assert options.slowest <= min(chosen)
    assert max(chosen) <= options.fastest * (1 + 1e-9)
    bench = make_case(SOFT).stated
    for item in soft.following:
        assert not [each for each in margins(bench, item.trial.task) if each.broken]


def test_runs_settle_for_as_long_as_the_reversals_of_the_pilot_ask(soft: Piloted) -> None:
    """7 Ts / sigma0 and 2 Ts / (N Kt Ki), of which the stated bench tells neither."""
    case = make_case(SOFT)
    true = Rig(case.truth)
    static = true.static_torque or 0.0
    turned = Rig(case.stated).unwinding(soft.options.slowest, static / case.torque_ratio)
    needed = MEMORIES * (true.presliding or 0.0) + turned
    settled = min(settled_angle(item.trial) for item in soft.following)
    assert needed == pytest.approx(3.18 * DEG, rel=0.01)
    assert settled == pytest.approx(needed, rel=0.15)
    assert soft.options.settle_angle == pytest.approx(0.75 * DEG)


def test_a_run_of_the_pilot_that_settled_for_less_is_no_point(soft: Piloted) -> None:
    told = "\n".join(soft.result.notes)
    rows = soft_rows(soft)
    assert "1 of 10 runs of the pilot are no points of the map" in told
    assert len(rows) == 2 * (len(soft.done) - 1)
    assert min(abs(float(str(row["speed"]))) for row in rows) > soft.options.slowest


def test_the_archive_and_the_page_say_why(soft: Piloted) -> None:
    reasons = {item.trial.note.partition("; window")[0] for item in soft.following}
    (reason,) = reasons
    assert reason.startswith("where a pilot shows that it determines most: Ts 0.02")
    assert "settled for" in reason
    assert reason in soft.result.notes
    assert all(item.trial.note.startswith("pilot; ") for item in soft.pilot)


def test_windows_that_the_pilot_set_are_told(soft: Piloted) -> None:
    """Slow runs measure for less, since they settle for longer; 5 deg at 2 deg/s are 2.5 s."""
    rules = {abs(float(str(row["speed"]))) / DEG: row["rule"] for row in soft_rows(soft)}
    assert rules[min(rules)] == "the pilot"
    assert {rule for speed, rule in rules.items() if 1.0 < speed < 2.0} == {"window_angle"}


def soft_rows(soft: Piloted) -> tuple[dict[str, object], ...]:
    return table(soft.result, "map").rows


def test_what_is_found_holds_the_truth(soft: Piloted) -> None:
    """With 0.75 deg to settle, Ts of the way back was 1 % low: two half-widths of its interval."""
    case = make_case(SOFT)
    for direction, sign in (("positive", 1.0), ("negative", -1.0)):
        true = stribeck_parameters(case.truth, sign)["static_torque"] / case.torque_ratio
        told = finding(soft.result, "static_torque", direction=direction, exponent="free").estimate
        assert told.low is not None
        assert told.high is not None
        assert abs(told.value - true) < 1.2 * 0.5 * (told.high - told.low), direction


def test_a_bias_of_the_gyro_is_not_taken_for_motion(soft: Piloted) -> None:
    """0.01 deg/s adds up to 0.3 deg in half a minute, as much as the memory itself."""
    biased = measured_once(
        replace(item, samples=shifted(item.samples, 0.01 * DEG)) for item in soft.pilot
    )
    plain, other = (
        choose(soft.options, make_case(SOFT).stated, each).options for each in (soft.pilot, biased)
    )
    assert other.settle_angle == pytest.approx(plain.settle_angle, rel=0.03)


def shifted(recording: Recording, bias: float) -> Recording:
    gyro = recording.channels["gyro_rate"]
    moved = gyro.info.with_samples(gyro.samples + bias)
    return replace(recording, channels={**recording.channels, "gyro_rate": moved})


@pytest.mark.slow
def test_a_long_ripple_makes_windows_longer() -> None:
    """60 periods per revolution are 6 deg, and the usual window 5 deg."""
    case = rippled(make_case(8), 60)
    found = run(case, pilot=True, points=FEWEST, warm_up_cycles=0)
    notes = {item.trial.note.partition("; window")[0] for item in found.following}
    assert len(notes) == 1
    assert notes.pop().endswith("averaged over 6.3 deg, for the ripple's period")


def rippled(case: Case, periods: float) -> Case:
    tree = case.truth.model_dump(mode="json")
    for interface in tree["friction"].values():
        interface["ripple"] = {"amplitude": 0.02, "periods": periods, "phase": 0.3}
    return replace(case, truth=Bench.model_validate(tree, context={"si": True}))


# --- a pilot that says nothing -----------------------------------------------------------------


def rest_of(options: PilotedMapOptions) -> list[float]:
    return [speed for speed in map_speeds(options) if speed not in pilot_speeds(options)]


def test_a_pilot_that_failed_leaves_the_plain_map(soft: Piloted) -> None:
    requests = asked(make_case(SOFT), soft.options, tuple(failed(item) for item in soft.pilot))
    assert [request.point["speed"] for request in requests] == rest_of(soft.options)
    assert "shows too little of friction: it has no steady point" in requests[0].note


@pytest.mark.slow
def test_a_pilot_without_a_stribeck_effect_leaves_the_plain_map() -> None:
    case = without_effect(make_case(4))
    flat = run(case, pilot=True, points=FEWEST, warm_up_cycles=0)
    assert speeds(flat.following) == rest_of(flat.options)
    assert "it shows no Stribeck effect" in flat.following[0].trial.note
    assert any("it shows no Stribeck effect" in note for note in flat.result.notes)


def without_effect(case: Case) -> Case:
    """Ts = Tc in both directions; all else as it was."""
    tree = case.truth.model_dump(mode="json")
    for interface in tree["friction"].values():
        interface["static_torque"] = interface["coulomb_torque"]
        interface["negative"]["static_torque"] = interface["negative"]["coulomb_torque"]
    truth = Bench.model_validate(tree, context={"si": True})
    return Case(case.number, truth, case.stated, Scale(1.0, 1.0, 1.0, 1.0))


@pytest.mark.slow
def test_a_pilot_without_friction_leaves_the_plain_map() -> None:
    case = make_case(4)
    free = replace(case, truth=case.truth.with_friction({}))
    found = run(free, pilot=True, points=FEWEST, warm_up_cycles=0)
    assert speeds(found.following) == rest_of(found.options)
    assert "shows too little of friction" in found.following[0].trial.note
    assert found.result.notes


def test_a_rig_without_room_to_settle_keeps_the_plain_map(soft: Piloted) -> None:
    """With a four-hundredth of the integral gain it turns round in 500 deg: beyond all travel."""
    bench = make_case(SOFT).stated
    gains = bench.controller.rate
    weak = gains.model_copy(update={"integral": gains.integral / 400.0})
    controller = bench.controller.model_copy(update={"rate": weak})
    choice = choose(soft.options, bench.model_copy(update={"controller": controller}), soft.pilot)
    assert "and no run has room for it" in choice.reason
    assert list(choice.speeds) == rest_of(soft.options)


def test_what_follows_stays_where_the_pilot_slid_steadily(soft: Piloted) -> None:
    """Four of its runs are too few for a curve, and say all the same where the load slides."""
    some = soft.pilot[4:8]
    choice = choose(soft.options, make_case(SOFT).stated, some)
    assert "shows too little of friction" in choice.reason
    slowest, *_, fastest = speeds(some)
    assert len(choice.speeds) == soft.options.points - SPEEDS
    assert slowest < min(choice.speeds)
    assert max(choice.speeds) < fastest


def test_a_pilot_alone_is_a_map(soft: Piloted) -> None:
    """A run that ended there: analysed as it is, and told."""
    found = analyse("velocity_map", soft.pilot)
    assert any("the map is that of the pilot alone" in note for note in found.notes)
    assert len(table(found, "map").rows) == 2 * SPEEDS


def test_a_pilot_chooses_speeds_or_is_refused() -> None:
    for written, told in (
        ({"speeds": ["1 deg/s"]}, "write slowest and fastest instead of speeds"),
        ({"points": FEWEST - 1}, f"at least {FEWEST} points"),
    ):
        options = PilotedMapOptions.model_validate({"pilot": True, **written})
        with pytest.raises(ValueError, match=told):
            list(EXPERIMENT.trials(options, make_case(4).stated))


# --- its bound ---------------------------------------------------------------------------------


def test_it_keeps_to_what_it_announced_whichever_speeds_are_chosen() -> None:
    """At the slowest speed of all, with whatever settling, nothing takes longer."""
    chance, bench = random.Random(20261122), make_case(4).stated
    for _ in range(100):
        starts = [chance.uniform(-20, 20) * DEG for _ in range(chance.randint(0, 3))]
        options = PilotedMapOptions.model_validate(
            {
                "pilot": True,
                "points": chance.randint(FEWEST, 60),
                "max_time": chance.uniform(5.0, 60.0),
                "rest": chance.uniform(0.0, 2.0),
                "sample_rate": chance.uniform(100.0, 1000.0),
                "slowest": chance.uniform(0.3, 3.0) * DEG,
                "start_angles": starts,
            },
            context={"si": True},
        )
        most, count = STAGE.most(options, bench), options.points - SPEEDS
        run = plan_run(options.slowest, options)
        tasks = [each.task for each in run_requests(run, options, Rig(bench), 0)] * count
        assert len(tasks) == most.trials
        assert sum(task.duration for task in tasks) <= most.duration * (1.0 + ROUNDING)
        assert sum(task.samples for task in tasks) <= most.samples


def test_nothing_follows_a_plain_map() -> None:
    assert STAGE.most(PilotedMapOptions(), make_case(4).stated).trials == 0


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_a_pilot_breaks_no_limit_of_a_narrow_rig(seed: int) -> None:
    bench = limited(seed).with_friction({})
    options, _ = fitted("velocity_map", bench, pilot=True)
    requests = list(EXPERIMENT.trials(options, bench))
    assert sum(request.role is Role.MEASUREMENT for request in requests) == SPEEDS
    for request in requests:
        assert not [each for each in margins(bench, request.task) if each.broken]


# --- against the plain map ---------------------------------------------------------------------

NARROWED = ("static_torque", "stribeck_velocity")


def half_widths(piloted: Piloted) -> np.ndarray:
    """Relative, of Ts and vs in both directions."""
    found = []
    for name in NARROWED:
        for direction in ("positive", "negative"):
            told = finding(piloted.result, name, direction=direction, exponent="free").estimate
            assert told is not None
            assert told.low is not None
            assert told.high is not None
            found.append(0.5 * (told.high - told.low) / told.value)
    return np.array(found)


def narrowing(number: int, draws: int) -> float:
    """Geometric mean of piloted over plain half-widths, as many trials in both."""
    ratios = []
    for draw in range(draws):
        piloted, plain = (
            run(make_case(number), draw, pilot=pilot, warm_up_cycles=0) for pilot in (True, False)
        )
        assert len(piloted.done) <= len(plain.done)
        ratios.append(half_widths(piloted) / half_widths(plain))
    return float(np.exp(np.mean(np.log(ratios))))


@pytest.mark.statistics
def test_intervals_of_a_bench_are_narrower_than_those_of_the_plain_map() -> None:
    """Of the one with the least to gain: by 4 %."""
    assert narrowing(3, 1) < 1.0


@pytest.mark.statistics
@pytest.mark.parametrize("number", [0, 1, 3, 5, 8, 14, 20])
def test_intervals_are_narrower_than_those_of_the_plain_map(number: int) -> None:
    assert narrowing(number, 3) < 1.0


# --- its intervals -----------------------------------------------------------------------------


def held(numbers: Iterable[int]) -> list[Pooled]:
    """How many intervals of piloted maps hold, by parameter and direction."""
    found = []
    for number in numbers:
        piloted = piloted_by(number)
        whole = laboratory.Run(make_case(number), "velocity_map", piloted.done, piloted.result)
        found += entries(whole, 0)
    return pooled(found)


@pytest.mark.statistics
def test_intervals_of_a_sample_hold() -> None:
    groups = held((4, 8, 20))
    assert len(groups) >= 10
    assert not [group.parameter for group in groups if group.short]
    hits, of = sum(group.held for group in groups), sum(group.of for group in groups)
    assert binomtest(hits, of, CLAIMED, "less").pvalue > 0.01


@pytest.mark.statistics
def test_intervals_of_all_benches_hold() -> None:
    assert not [group.parameter for group in held(range(BENCHES)) if group.short]
