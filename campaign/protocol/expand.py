"""From a test to its trials: points, repetitions, order, seeds."""

from __future__ import annotations

import hashlib
import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from campaign.axis_kind import axis_terms, each_in_axis_terms, in_axis_terms, sides_in
from campaign.errors import Problem
from campaign.physics.bench import Bench
from campaign.physics.truth import digest, is_setting, settings, simulated, value_at, with_settings
from campaign.protocol import memory
from campaign.protocol.load import unknown_compensation
from campaign.protocol.matrix import LARGEST_PLAN
from campaign.protocol.operator import PlaceholderError, set_by_operator, setup_at
from campaign.protocol.points import Point, PointError, points_of, refused
from campaign.protocol.schema import ExperimentKind, Test
from campaign.protocol.stages import PlannedStage, most_of, planned_stages
from campaign.protocol.swept_value_text import point_text
from campaign.trial import Role, Task, Tree, Trial, TrialRequest, canonical_json

CHANNELS = 11
"""Recorded channels besides the time, to estimate the archive size."""
LARGEST_RECORDING = 200_000_000
"""Maximum number of samples of one trial; more is an error of units. Recording needs constant
memory, but an analysis holds the channels that it reads."""

_ALL_GIVEN = set(Trial.model_fields)
"""Shared by all trials: a set for each trial would take 2 kB."""


@dataclass(frozen=True)
class ExpandedTest:
    """The trials of one test in order of execution, each with its bench as an object.

    `first_measurement`: index of the first as written, whatever the order; None without one.
    `stages`: stages that may follow, by point in the order of the matrix. `memory`: total (bytes),
    with the trials that follow. `truths`: plants of its trials by digest. `warnings`: warnings of
    its experiment about the plan, each once.
    """

    trials: tuple[Trial, ...]
    benches: tuple[Bench, ...]
    first_measurement: int | None
    stages: tuple[PlannedStage, ...] = ()
    memory: int = 0
    truths: Mapping[str, Tree] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class _Place:
    """One trial without its number."""

    point: Point
    request: TrialRequest
    index: int  # among the requests of its point
    repeat: int
    bench: Bench
    bench_tree: Tree
    truth: str = ""


def expand(
    test: Test, seed: int, before: int, allow_large: bool, left: int = memory.MOST
) -> ExpandedTest:
    """The trials of `test`, numbered from `before` + 1, in `left` bytes. Raises PointError."""
    places: list[_Place] = []
    if memory.least(test) > left:
        raise PointError([memory_problem(test, memory.least(test))])
    points = list(points_of(test))
    stages = [stage for point in points for stage in _stages(test, point, seed)]
    later = memory.TRIAL * most_of(stages).trials
    left -= later
    if left < 0:
        raise PointError([memory_problem(test, later)])
    own_benches: dict[str, tuple[Bench, Tree]] = {}
    truths = _Truths(test)
    benches = memory.BENCH * len({id(point.bench) for point in points})
    repeats = test.entry.repeat
    whole, needed = len(points) * repeats, 0
    for done, point in enumerate(points, start=1):
        requests = _requests(test, point, own_benches, truths)
        for index, (request, bench, tree, truth) in enumerate(requests):
            places.append(_Place(point, request, index, 1, bench, tree, truth))
            needed += memory.of_task(request.task)
            if len(places) + before > LARGEST_PLAN and not allow_large:
                raise PointError([size_problem(test, "the plan has")])
            if needed + benches + (len(own_benches) + len(truths.plants)) * memory.BENCH > left:
                raise PointError([memory_problem(test, needed * whole // done + benches)])
        if needed * whole // done > memory.SURELY * left:
            raise PointError([memory_problem(test, needed * whole // done + benches)])
    if len(places) * repeats + before > LARGEST_PLAN and not allow_large:
        raise PointError([size_problem(test, "the plan has")])
    spent = needed * repeats + benches + (len(own_benches) + len(truths.plants)) * memory.BENCH
    if spent > left:
        raise PointError([memory_problem(test, spent)])
    # The requests of a point are the same in each repetition and are shared.
    places = [replace(place, repeat=n) for n in range(1, repeats + 1) for place in places]
    if stages and (reason := _no_stages(places)):
        message = f"a test whose trials {reason} can have no stages"
        raise PointError([test.origin.problem((), "value", message)])
    ordered = _shuffled(places, seed) if test.entry.order == "shuffled" else places
    numbers = itertools.count(before + 1)
    set_by_hand = set_by_operator(test)
    setups = {id(point): _setup(test, point) for point in points}
    known: dict[tuple[int, int], Mapping[str, Any]] = {}
    trials = tuple(
        _trial(test, place, next(numbers), seed, setups[id(place.point)], set_by_hand, known)
        for place in ordered
    )
    measured = (place for place in places if place.request.role is Role.MEASUREMENT)
    first = next(measured, None)
    at = next((i for i, place in enumerate(ordered) if place is first), None)
    of_places = tuple(place.bench for place in ordered)
    notes = tuple(dict.fromkeys(line for point in points for line in _warnings(test, point)))
    return ExpandedTest(trials, of_places, at, tuple(stages), spent + later, truths.plants, notes)


def _setup(test: Test, point: Point) -> tuple[str, ...]:
    """Operator steps for a point; PointError if it has no value for a placeholder."""
    try:
        return setup_at(test, point)
    except PlaceholderError as error:
        message = f"test '{test.entry.name}' at {point.label}: {error}"
        raise PointError([test.origin.problem(("operator",), "key", message)]) from None


def _no_stages(places: Sequence[_Place]) -> str:
    """Reason for which the point or the bench of a trial would be ambiguous; "" if none."""
    for place in places:
        if place.request.bench is not None:
            return "have benches of their own"
        if swept := place.request.point.keys() & place.point.values.keys():
            return f"choose {', '.join(sorted(swept))}, which is swept, themselves"
    return ""


def _stages(test: Test, point: Point, seed: int) -> list[PlannedStage]:
    """The stages that may follow at a point. Raises PointError."""
    try:
        with axis_terms(point.bench.sides):
            return list(planned_stages(test, point, seed))
    except (ValueError, ArithmeticError) as error:
        raise refused(test, point.bench, error, _at(point)) from None


def _warnings(test: Test, point: Point) -> list[str]:
    """Warnings of the experiment at a point. Raises PointError."""
    if test.experiment.warnings is None:
        return []
    try:
        with axis_terms(point.bench.sides):
            return list(map(in_axis_terms, test.experiment.warnings(point.options, point.bench)))
    except (ValueError, ArithmeticError) as error:
        raise refused(test, point.bench, error, _at(point)) from None


def _at(point: Point) -> str:
    return f" at {point.label}" if point.values else ""


def _requests(
    test: Test, point: Point, own_benches: dict[str, tuple[Bench, Tree]], truths: _Truths
) -> Iterator[tuple[TrialRequest, Bench, Tree, str]]:
    """The experiment's requests at a point with bench and truth, after the checks of a plan."""
    try:
        requests = test.experiment.trials(point.options, point.bench)
        for request in each_in_axis_terms(point.bench.sides, requests):
            bench, tree = _bench_for(request, point, own_benches)
            name, names = request.task.compensation, ["none", *bench.compensation]
            if name not in names:
                raise ValueError(unknown_compensation(name, names, test))
            check_recording(request.task)
            yield request, bench, tree, truths.of(point, bench, tree)
    except (ValueError, ArithmeticError) as error:
        raise refused(test, point.bench, error, _at(point)) from None


def _bench_for(
    request: TrialRequest, point: Point, own_benches: dict[str, tuple[Bench, Tree]]
) -> tuple[Bench, Tree]:
    """The point's bench, or the request's own; each different bench is validated once."""
    if request.bench is None:
        return point.bench, point.bench_tree
    key = canonical_json(request.bench)
    if key not in own_benches:
        valid = Bench.model_validate(request.bench, context={"si": True})
        own_benches[key] = valid, valid.model_dump(mode="json")
    return own_benches[key]


@dataclass
class _Truths:
    """The plants that simulate a test's trials, by their digest; unknown to the experiment.

    A setting of the bench that a matrix or an experiment changes is changed at the rig, and thus
    in the truth, to the same value.
    """

    test: Test
    plants: dict[str, Tree] = field(default_factory=dict)
    known: dict[tuple[int, int], str] = field(default_factory=dict)

    def of(self, point: Point, bench: Bench, tree: Tree) -> str:
        """Digest of the truth of a trial on `bench`; empty if the bench itself is simulated."""
        if self.test.truth is None:
            return ""
        key = (id(point.bench_tree), id(tree))  # both are kept with the points and requests
        if key not in self.known:
            axes = (axis.keys for axis in self.test.axes if axis.of_bench)
            turned = {keys: value_at(tree, keys) for keys in axes if is_setting(keys)}
            turned |= settings(point.bench_tree, tree)
            plant = with_settings(self.test.truth, turned)
            simulated(plant, bench)  # raises if it cannot be simulated
            self.known[key] = name = digest(plant)
            self.plants.setdefault(name, plant)
        return self.known[key]


def _shuffled(places: Sequence[_Place], seed: int) -> list[_Place]:
    """Each repetition is a block: its warm-ups first, then its measurements in random order.

    The order is that of hashes, which does not depend on versions of libraries.
    """

    def hashed(place: _Place) -> int:
        return place_hash("order", seed, place.point.values, place.index, place.repeat)

    ordered: list[_Place] = []
    for _, group in itertools.groupby(places, key=lambda place: place.repeat):
        block = list(group)
        ordered += [p for p in block if p.request.role is Role.WARM_UP]
        measured = [p for p in block if p.request.role is not Role.WARM_UP]
        ordered += sorted(measured, key=hashed)
    return ordered


def _trial(
    test: Test,
    place: _Place,
    number: int,
    seed: int,
    setup: tuple[str, ...],
    set_by_hand: tuple[str, ...],
    known: dict[tuple[int, int], Mapping[str, Any]],
) -> Trial:
    # All parts are validated. Construction without validation shares one bench tree among the
    # trials of a point; validation would copy it for each of up to 100 000. `known` holds the
    # shared fields of the repetitions of a place.
    request, key = place.request, (id(place.point), place.index)
    if key not in known:
        options = place.point.options_tree if request.planned else place.point.written
        fields = fields_of(test.experiment, request, place.bench_tree, test.options)
        known[key] = {
            **fields,
            "point": {**place.point.values, **request.point},
            "told": {**place.point.told, **fields["told"]},
            "options": {**options, **request.options} if request.options else options,
        }
    return Trial.model_construct(
        _ALL_GIVEN,
        number=number,
        test=test.entry.name,
        kind=test.entry.kind,
        repeat=place.repeat,
        seed=place_hash(seed, place.point.values, place.index, place.repeat),
        bench=place.bench_tree,
        setup=setup,
        set_by_operator=set_by_hand,
        truth=place.truth,
        recording=request.recording,
        **known[key],
    )


def fields_of(
    experiment: ExperimentKind, request: TrialRequest, bench: Tree, written: Mapping[str, Any]
) -> dict[str, Any]:
    """Fields of a trial from its request; `written`: the test's options as in the protocol.

    The names of required and of usable channels are sorted.
    """
    declared = request.role is Role.MEASUREMENT
    requires, can_use = request.requires, request.can_use
    if requires is None:
        requires = experiment.requires if declared else ()
    if can_use is None:
        can_use = experiment.can_use if declared else ()
    with axis_terms(sides_in(bench)):
        return {
            "role": request.role,
            "task": request.task,
            "windows": request.windows,
            "note": in_axis_terms(request.note),
            "told": point_text(experiment.options, written, request.point),
            "requires": tuple(sorted(requires)),
            "can_use": tuple(sorted(can_use)),
        }


def memory_problem(test: Test, needed: int) -> Problem:
    """The problem of a plan that needs `needed` bytes, at the matrix or the repeats of `test`."""
    return _at_the_multiplier(test, memory.refusal(test, needed))


def size_problem(test: Test, what: str) -> Problem:
    """The problem of a plan with too many trials, at the matrix or the repeats of `test`."""
    message = f"{what} over {LARGEST_PLAN} trials; sweep less, or allow large plans explicitly"
    return _at_the_multiplier(test, message)


def _at_the_multiplier(test: Test, message: str) -> Problem:
    keys = ("matrix",) if test.axes else ("repeat",)
    return test.origin.problem(keys, "key", message)


def seed_of(test: Test, master: int) -> int:
    """The test's own seed, or one from the plan's seed that is independent of other tests."""
    given = test.entry.seed
    return given if given is not None else place_hash(master, test.entry.name)


def place_hash(*place: Any) -> int:
    """63 bits that depend only on `place`, such as a trial's place in its test."""
    digest = hashlib.sha256(canonical_json(place).encode()).digest()
    return int.from_bytes(digest[:8], "big") >> 1


def check_recording(task: Task) -> None:
    """Raise ValueError for a recording so long that it must be an error of units."""
    if task.samples > LARGEST_RECORDING:
        raise ValueError(
            f"a trial of {task.samples:.3g} samples; at most {LARGEST_RECORDING:.3g} are "
            "allowed: lower sample_rate or the duration"
        )
