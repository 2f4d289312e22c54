"""From a test to its trials: every point, every repetition, in order, each with its own seed."""

from __future__ import annotations

import hashlib
import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from campaign.errors import Problem
from campaign.physics.bench import Bench
from campaign.protocol import memory
from campaign.protocol.load import unknown_compensation
from campaign.protocol.matrix import LARGEST_PLAN
from campaign.protocol.operator import PlaceholderError, set_by_operator, setup_at
from campaign.protocol.points import Point, PointError, points_of
from campaign.protocol.schema import ExperimentKind, Test
from campaign.trial import Role, Task, Tree, Trial, TrialRequest, canonical_json

Names = tuple[str, ...]

CHANNELS = 11
"""A backend records, besides the time; for the estimate of what would be written."""
LARGEST_RECORDING = 200_000_000
"""samples of one trial; more is a slip of units. They are recorded in flat memory, and an analysis
holds the channels that it reads."""


@dataclass(frozen=True)
class Expanded:
    """The trials of one test in order of execution, each with its bench as an object.

    `first_measurement` is the index of the first as written, whatever the order; None without one.
    `memory` is what all of it takes (bytes).
    """

    trials: tuple[Trial, ...]
    benches: tuple[Bench, ...]
    first_measurement: int | None
    memory: int = 0


@dataclass(frozen=True)
class _Place:
    """One trial before it is numbered."""

    point: Point
    request: TrialRequest
    index: int  # among the requests of its point
    repeat: int
    bench: Bench
    bench_tree: Tree


def expand(
    test: Test, seed: int, before: int, allow_large: bool, left: int = memory.MOST
) -> Expanded:
    """The trials of `test`, numbered from `before` + 1, in `left` bytes. Raises PointError."""
    places: list[_Place] = []
    if memory.least(test) > left:
        raise PointError([memory_problem(test, memory.least(test))])
    points = list(points_of(test))
    own_benches: dict[str, tuple[Bench, Tree]] = {}
    benches = memory.BENCH * len({id(point.bench) for point in points})
    whole = len(points) * test.entry.repeat
    asked = 0
    for done, (repeat, point) in enumerate(
        itertools.product(range(1, test.entry.repeat + 1), points), start=1
    ):
        for index, (request, bench, tree) in enumerate(_requests(test, point, own_benches)):
            places.append(_Place(point, request, index, repeat, bench, tree))
            asked += memory.of_task(request.task)
            if len(places) + before > LARGEST_PLAN and not allow_large:
                raise PointError([size_problem(test, "the plan has")])
            if asked + benches + len(own_benches) * memory.BENCH > left:
                raise PointError([memory_problem(test, asked * whole // done + benches)])
        if asked * whole // done > memory.SURELY * left:
            raise PointError([memory_problem(test, asked * whole // done + benches)])
    spent = asked + benches + len(own_benches) * memory.BENCH
    ordered = _shuffled(places, seed) if test.entry.order == "shuffled" else places
    numbers = itertools.count(before + 1)
    set_by_hand = set_by_operator(test)
    setups = {id(point): _setup(test, point) for point in points}
    trials = tuple(
        _trial(test, place, next(numbers), seed, setups[id(place.point)], set_by_hand)
        for place in ordered
    )
    measured = (place for place in places if place.request.role is Role.MEASUREMENT)
    first = next(measured, None)
    at = next((i for i, place in enumerate(ordered) if place is first), None)
    return Expanded(trials, tuple(place.bench for place in ordered), at, spent)


def _setup(test: Test, point: Point) -> tuple[str, ...]:
    """What a person does for a point, which may lack what a placeholder of the first one names."""
    try:
        return setup_at(test, point)
    except PlaceholderError as error:
        message = f"test '{test.entry.name}' at {point.label}: {error}"
        raise PointError([test.origin.problem(("operator",), "key", message)]) from None


def _requests(
    test: Test, point: Point, own_benches: dict[str, tuple[Bench, Tree]]
) -> Iterator[tuple[TrialRequest, Bench, Tree]]:
    """What the experiment asks for at a point and on which bench, checked as only a plan can."""
    where = f" at {point.label}" if point.values else ""
    try:
        for request in test.experiment.trials(point.options, point.bench):
            bench, tree = _bench_for(request, point, own_benches)
            name, names = request.task.compensation, ["none", *bench.compensation]
            if name not in names:
                raise ValueError(unknown_compensation(name, names, test))
            if samples_of(request.task) > LARGEST_RECORDING:
                raise ValueError(
                    f"a trial of {samples_of(request.task):.3g} samples; at most "
                    f"{LARGEST_RECORDING:.3g} are allowed: lower sample_rate or the duration"
                )
            yield request, bench, tree
    except (ValueError, ArithmeticError) as error:
        message = f"test '{test.entry.name}'{where}: {_first_line(error)}"
        raise PointError([test.origin.problem((), "value", message)]) from None


def _bench_for(
    request: TrialRequest, point: Point, own_benches: dict[str, tuple[Bench, Tree]]
) -> tuple[Bench, Tree]:
    """The point's bench, or the request's own, validated once for each that is different."""
    if request.bench is None:
        return point.bench, point.bench_tree
    key = canonical_json(request.bench)
    if key not in own_benches:
        valid = Bench.model_validate(request.bench, context={"si": True})
        own_benches[key] = valid, valid.model_dump(mode="json")
    return own_benches[key]


def _shuffled(places: Sequence[_Place], seed: int) -> list[_Place]:
    """Each repetition is a block: its warm-ups first, then its measurements in random order.

    The order is that of hashes, which no version of a library can change.
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
) -> Trial:
    # All parts are validated; constructing without validation shares one bench tree among the
    # trials of a point, where validation would copy it for each of up to 100 000.
    request = place.request
    requires, can_use = channels_of(test.experiment, request)
    swept = {**place.point.values, **request.point}
    return Trial.model_construct(
        number=number,
        test=test.entry.name,
        kind=test.entry.kind,
        role=request.role,
        point=swept,
        options=place.point.options_tree,
        repeat=place.repeat,
        seed=place_hash(seed, place.point.values, place.index, place.repeat),
        bench=place.bench_tree,
        task=request.task,
        note=request.note,
        setup=setup,
        set_by_operator=set_by_hand,
        requires=requires,
        can_use=can_use,
    )


def channels_of(experiment: ExperimentKind, request: TrialRequest) -> tuple[Names, Names]:
    """Names of the channels that a trial requires and of those that it can use, sorted."""
    declared = request.role is Role.MEASUREMENT
    requires, can_use = request.requires, request.can_use
    if requires is None:
        requires = experiment.requires if declared else ()
    if can_use is None:
        can_use = experiment.can_use if declared else ()
    return tuple(sorted(requires)), tuple(sorted(can_use))


def memory_problem(test: Test, needed: int) -> Problem:
    """The problem of a plan that takes `needed` bytes, at what multiplies its trials in `test`."""
    return _at_the_multiplier(test, memory.refusal(test, needed))


def size_problem(test: Test, what: str) -> Problem:
    """The problem of a plan with too many trials, at what multiplies them in `test`."""
    message = f"{what} over {LARGEST_PLAN} trials; sweep less, or allow large plans explicitly"
    return _at_the_multiplier(test, message)


def _at_the_multiplier(test: Test, message: str) -> Problem:
    keys = ("matrix",) if test.axes else ("repeat",)
    return test.origin.problem(keys, "key", message)


def seed_of(test: Test, master: int) -> int:
    """The test's own seed, or one drawn from the plan's that no other test changes."""
    given = test.entry.seed
    return given if given is not None else place_hash(master, test.entry.name)


def place_hash(*place: Any) -> int:
    """63 bits that depend on nothing but `place`, e.g. a trial's place in its test."""
    digest = hashlib.sha256(canonical_json(place).encode()).digest()
    return int.from_bytes(digest[:8], "big") >> 1


def samples_of(task: Task) -> int:
    """Samples per channel."""
    return max(1, int(task.duration * task.sample_rate))


def _first_line(error: Exception) -> str:
    lines = str(error).strip().splitlines() or [type(error).__name__]
    # pydantic's messages have a headline, a field and a sentence; all three are needed.
    return " ".join(line.strip() for line in lines[:3])
