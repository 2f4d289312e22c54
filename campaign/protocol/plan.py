"""From a protocol to a plan: every trial resolved, numbered, seeded and held against the limits."""

from __future__ import annotations

import hashlib
import itertools
import random
import secrets
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from campaign.errors import Problem, ProtocolError, UsageError
from campaign.physics.bench import Bench
from campaign.physics.limits import Margin, margins
from campaign.protocol.axes import is_large, value_problems
from campaign.protocol.load import unknown_compensation
from campaign.protocol.matrix import LARGEST_PLAN, count_points
from campaign.protocol.points import Point, PointError, points_of
from campaign.protocol.problems import allowed, nearest, shown
from campaign.protocol.schema import Protocol, Test
from campaign.trial import Role, Task, Trial, TrialRequest, Tree, canonical_json

LARGEST_RECORDING = 200_000_000
"""samples of one trial; more fills a disk, and is a slip of units."""
CHANNELS = 8
"""a backend records, besides the time; for the estimate of what would be written."""


@dataclass(frozen=True)
class LimitUse:
    """A trial and how close it comes to one limit."""

    trial: int
    margin: Margin


@dataclass(frozen=True)
class PlannedTest:
    """One test of a plan.

    Attributes:
        bench: name of the bench's source.
        options: normalised (SI), with the first value of whatever is swept.
        matrix: swept path to its values, normalised (SI).
        numbers: of its trials, in the order of execution.
        closest: for each limit the trial that uses most of it.
        duration: bench time (s).
    """

    name: str
    kind: str
    title: str
    description: str
    reproduces: tuple[str, ...]
    bench: str
    options: Tree
    matrix: Mapping[str, tuple[Any, ...]]
    order: str
    seed: int
    repeat: int
    numbers: tuple[int, ...]
    closest: tuple[LimitUse, ...]
    duration: float


@dataclass(frozen=True)
class Plan:
    """The ordered trials of a protocol, and everything needed to make the same plan again.

    Attributes:
        name: of the protocol's file.
        published: "thesis", "none" or the name of a source.
        only: the tests it was restricted to; empty for all.
        sources: verbatim text of every file, by its name as written.
        normalised: what determines the trials, SI, of all tests: compared at a resume.
        fingerprint: SHA-256 of `normalised`.
        seed: from which tests without a seed of their own got theirs.
        breaches: every limit that a trial would break.
    """

    name: str
    title: str
    description: str
    operator: str
    notes: str
    tags: tuple[str, ...]
    published: str
    tests: tuple[PlannedTest, ...]
    trials: tuple[Trial, ...]
    sources: Mapping[str, str]
    normalised: Tree
    fingerprint: str
    overrides: tuple[str, ...]
    only: tuple[str, ...]
    seed: int
    breaches: tuple[LimitUse, ...]

    @property
    def duration(self) -> float:
        """Bench time of all trials (s)."""
        return sum(test.duration for test in self.tests)

    @property
    def samples(self) -> int:
        """Samples of all trials, per channel."""
        return sum(_samples(trial.task) for trial in self.trials)

    @property
    def size(self) -> int:
        """Bytes of all recordings before compression, an upper estimate of what is written."""
        return self.samples * (CHANNELS + 1) * 8


def make_plan(
    protocol: Protocol,
    *,
    only: Sequence[str] = (),
    allow_large: bool = False,
    seed: int | None = None,
) -> Plan:
    """The plan of `protocol`.

    Args:
        only: names of the tests to plan; all when empty. A trial's seed does not depend on it.
        allow_large: plan more than 100 000 trials, too.
        seed: for tests without their own; drawn when None, and recorded either way.

    Raises UsageError for unknown names in `only`, and ProtocolError when options and bench do not
    go together at some point of a matrix, or when the plan is too large. Limits are only measured:
    see `check_limits`.
    """
    chosen = _chosen(protocol, only)
    problems = [problem for test in chosen for problem in _too_large(test, allow_large)]
    if problems:
        raise ProtocolError(problems)
    master = secrets.randbits(63) if seed is None else seed
    trials: list[Trial] = []
    planned: list[PlannedTest] = []
    uses: list[LimitUse] = []
    for test in chosen:
        try:
            draft = _draft_trials(test, _test_seed(test, master), len(trials), allow_large)
        except PointError as error:
            problems += error.problems
            continue
        own = [LimitUse(t.number, margin) for t, margin in _all_margins(draft)]
        planned.append(_planned(test, draft, own, master))
        uses += own
        trials += draft.trials
    if problems:
        raise ProtocolError(list(dict.fromkeys(problems)))
    normalised: Tree = {"tests": [_normalised(t, master) for t in protocol.tests]}
    return Plan(
        name=protocol.path.name,
        title=protocol.title,
        description=protocol.description,
        operator=protocol.operator,
        notes=protocol.notes,
        tags=protocol.tags,
        published=protocol.published,
        tests=tuple(planned),
        trials=tuple(trials),
        sources=protocol.sources,
        normalised=normalised,
        fingerprint=hashlib.sha256(canonical_json(normalised).encode()).hexdigest(),
        overrides=protocol.overrides,
        only=tuple(only),
        seed=master,
        breaches=tuple(use for use in uses if use.margin.broken),
    )


@dataclass(frozen=True)
class _Draft:
    """The trials of one test in order of execution, each with its bench as an object."""

    trials: tuple[Trial, ...]
    benches: tuple[Bench, ...]


@dataclass(frozen=True)
class _Place:
    """One trial before it is numbered."""

    point: Point
    request: TrialRequest
    index: int  # among the requests of its point
    repeat: int


def _draft_trials(test: Test, seed: int, before: int, allow_large: bool) -> _Draft:
    places: list[_Place] = []
    points = list(points_of(test))
    for repeat, point in itertools.product(range(1, test.entry.repeat + 1), points):
        for index, request in enumerate(_requests(test, point)):
            places.append(_Place(point, request, index, repeat))
            if len(places) + before > LARGEST_PLAN and not allow_large:
                raise PointError([_size_problem(test, "the plan has")])
    ordered = _shuffled(places, seed) if test.entry.order == "shuffled" else places
    numbers = itertools.count(before + 1)
    trials = tuple(_trial(test, place, next(numbers), seed) for place in ordered)
    return _Draft(trials, tuple(place.point.bench for place in ordered))


def _requests(test: Test, point: Point) -> Iterator[TrialRequest]:
    """What the experiment asks for at a point, checked for what only a plan can see."""
    names = ["none", *point.bench.compensation]
    where = f" at {point.label}" if point.values else ""
    try:
        for request in test.experiment.trials(point.options, point.bench):
            name = request.task.compensation
            if name not in names:
                raise ValueError(unknown_compensation(name, names, test))
            if _samples(request.task) > LARGEST_RECORDING:
                raise ValueError(
                    f"a trial of {_samples(request.task):.3g} samples; at most "
                    f"{LARGEST_RECORDING:.3g} are allowed: lower sample_rate or the duration"
                )
            yield request
    except (ValueError, ArithmeticError) as error:
        message = f"test '{test.entry.name}'{where}: {_first_line(error)}"
        raise PointError([test.origin.problem((), "value", message)]) from None


def _shuffled(places: Sequence[_Place], seed: int) -> list[_Place]:
    """Each repetition is a block: its warm-ups first, then its measurements in random order."""
    shuffler = random.Random(seed)
    ordered: list[_Place] = []
    for _, group in itertools.groupby(places, key=lambda place: place.repeat):
        block = list(group)
        measured = [p for p in block if p.request.role is not Role.WARM_UP]
        shuffler.shuffle(measured)
        ordered += [p for p in block if p.request.role is Role.WARM_UP] + measured
    return ordered


def _trial(test: Test, place: _Place, number: int, seed: int) -> Trial:
    # All parts are validated; constructing without validation shares one bench tree among the
    # trials of a point, where validation would copy it for each of up to 100 000.
    request = place.request
    swept = {**place.point.values, **request.point}
    return Trial.model_construct(
        number=number,
        test=test.entry.name,
        kind=test.entry.kind,
        role=request.role,
        point=swept,
        options=place.point.options_tree,
        repeat=place.repeat,
        seed=_hash_seed(seed, place.point.values, place.index, place.repeat),
        bench=place.point.bench_tree,
        task=request.task,
        note=request.note,
    )


def _all_margins(draft: _Draft) -> Iterator[tuple[Trial, Margin]]:
    known: dict[tuple[int, Task], tuple[Margin, ...]] = {}
    for trial, bench in zip(draft.trials, draft.benches, strict=True):
        key = (id(bench), trial.task)
        if key not in known:
            known[key] = margins(bench, trial.task)
        yield from ((trial, margin) for margin in known[key])


def _planned(test: Test, draft: _Draft, uses: Sequence[LimitUse], master: int) -> PlannedTest:
    closest: dict[str, LimitUse] = {}
    for use in uses:
        best = closest.get(use.margin.limit)
        if best is None or use.margin.fraction > best.margin.fraction:
            closest[use.margin.limit] = use
    first = next(iter(points_of(test)))
    matrix: dict[str, dict[str, Any]] = {axis.path: {} for axis in test.axes}
    for trial in draft.trials:
        for path, values in matrix.items():
            values.setdefault(canonical_json(trial.point[path]), trial.point[path])
    entry = test.entry
    return PlannedTest(
        name=entry.name,
        kind=entry.kind,
        title=entry.title,
        description=entry.description,
        reproduces=entry.reproduces,
        bench=test.bench_name,
        options=first.options_tree,
        matrix={path: tuple(values.values()) for path, values in matrix.items()},
        order=entry.order,
        seed=_test_seed(test, master),
        repeat=entry.repeat,
        numbers=tuple(trial.number for trial in draft.trials),
        closest=tuple(closest.values()),
        duration=sum(trial.task.duration for trial in draft.trials),
    )


def _normalised(test: Test, master: int) -> Tree:
    """What determines the trials of a test; prose is left out, so that it may be corrected."""
    first = next(iter(points_of(test)))
    swept: dict[str, Any] = {axis.path: axis.describe() for axis in test.axes}
    return {
        "name": test.entry.name,
        "kind": test.entry.kind,
        "options": first.options_tree,
        "bench": first.bench_tree,
        "matrix": [[path, values] for path, values in swept.items()],
        "repeat": test.entry.repeat,
        "order": test.entry.order,
        "seed": _test_seed(test, master),
    }


def _chosen(protocol: Protocol, only: Sequence[str]) -> list[Test]:
    names = [test.entry.name for test in protocol.tests]
    for name in only:
        if name not in names:
            raise UsageError(
                f"no test is called {shown(name)}; {allowed(names)}{nearest(name, names)}"
            )
    return [test for test in protocol.tests if not only or test.entry.name in only]


def _too_large(test: Test, allow_large: bool) -> list[Problem]:
    if not is_large(test.axes, test.entry.repeat):
        return []
    if not allow_large:
        trials = count_points(test.axes) * test.entry.repeat
        return [_size_problem(test, f"test '{test.entry.name}' alone has {trials}, the plan")]
    return list(value_problems(test))  # loading left them out


def _size_problem(test: Test, what: str) -> Problem:
    message = f"{what} over {LARGEST_PLAN} trials; sweep less, or allow large plans explicitly"
    keys = ("matrix",) if test.axes else ("repeat",)
    return test.origin.problem(keys, "key", message)


def _test_seed(test: Test, master: int) -> int:
    given = test.entry.seed
    return given if given is not None else _hash_seed(master, test.entry.name)


def _hash_seed(*place: Any) -> int:
    """63 bits that depend on nothing but a trial's place in its test."""
    digest = hashlib.sha256(canonical_json(place).encode()).digest()
    return int.from_bytes(digest[:8], "big") >> 1


def _samples(task: Task) -> int:
    return max(1, int(task.duration * task.sample_rate))


def _first_line(error: Exception) -> str:
    lines = str(error).strip().splitlines() or [type(error).__name__]
    # pydantic's messages have a headline, a field and a sentence; all three are needed.
    return " ".join(line.strip() for line in lines[:3])
