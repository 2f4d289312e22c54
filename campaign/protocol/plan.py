"""From a protocol to a plan: trials resolved, numbered, seeded, checked."""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from campaign.errors import Problem, ProtocolError, UsageError
from campaign.physics.complete import IncompleteBenchError
from campaign.physics.limits import Margin, margins
from campaign.physics.plan_loops import LoopUse, loops_used
from campaign.physics.resolution import CLOSE, resolution_margins
from campaign.physics.truth import digest
from campaign.protocol import memory
from campaign.protocol.axes import is_large, value_problems
from campaign.protocol.check_trials import nothing_to_check, with_checks
from campaign.protocol.expand import (
    CHANNELS,
    ExpandedTest,
    expand,
    memory_problem,
    seed_of,
    size_problem,
)
from campaign.protocol.matrix import LARGEST_PLAN, count_points
from campaign.protocol.missing_values import not_predicted
from campaign.protocol.points import PointError, first_point, incomplete
from campaign.protocol.problems import allowed, shown
from campaign.protocol.schema import Protocol, Test
from campaign.protocol.stages import PlannedStage, most_of
from campaign.text import nearest
from campaign.trial import Most, Task, Tree, Trial, canonical_json

STRUCTURE = 32_000
"""Maximum bytes of a trial's archive without its samples, preview and description."""

BYTES = 8 * (CHANNELS + 1)
"""Bytes of one sample of every channel and its time."""

PREVIEW = 20_000
"""Number of samples above which a recording has a preview; maximum points of a preview."""


@dataclass(frozen=True)
class LimitUse:
    """A trial and its margin to one limit."""

    trial: int
    margin: Margin


@dataclass(frozen=True)
class PlannedTest:
    """One test of a plan.

    Attributes:
        bench: name of the bench's source.
        options: normalized (SI), with the first value of each swept option; without options that
            no trial has, such as defaults beside unplanned recordings.
        matrix: swept path to its values, normalized (SI).
        numbers: of its trials, in the order of execution.
        closest: for each limit the trial that uses most of it.
        loops: for each compensation, mode and regime the loop with the least margin, the worst
            first; empty without closed loops.
        seeks_instability: whether its experiment seeks the instability of a loop.
        coarse: for each limit of which one count of a sensor is a large part, such a trial.
        duration: bench time (s).
        chosen: reason for each unwritten option that the experiment chose for the bench, at the
            first point of the matrix.
        stages: stages that depend on these trials, by point; their trials are not in `numbers`.
        warnings: warnings about the plan, with remedies.
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
    loops: tuple[LoopUse, ...]
    seeks_instability: bool
    duration: float
    coarse: tuple[LimitUse, ...] = ()
    chosen: Mapping[str, str] = field(default_factory=dict)
    stages: tuple[PlannedStage, ...] = ()
    warnings: tuple[str, ...] = ()
    group: str = ""
    leading_figure: str = ""


@dataclass(frozen=True)
class Plan:
    """The ordered trials of a protocol, with all data to make the same plan again.

    Its trials are those of the first stage; later ones are in `stages`.

    Attributes:
        protocol: as loaded; its policy is not part of `normalised`.
        only: names of the planned tests; empty for all.
        normalised: data that determine the trials of all tests (SI); compared at a resume.
        fingerprint: SHA-256 of `normalised`.
        seed: source of the seeds of tests without their own.
        breaches: every limit that a trial would break.
        truths: plants that `sim` simulates in place of the benches, by the digest in the trials.
            Only `sim` and the archive use them.
    """

    protocol: Protocol
    tests: tuple[PlannedTest, ...]
    trials: tuple[Trial, ...]
    normalised: Tree
    fingerprint: str
    only: tuple[str, ...]
    seed: int
    breaches: tuple[LimitUse, ...]
    truths: Mapping[str, Tree] = field(default_factory=dict)

    @property
    def duration(self) -> float:
        """Bench time of all trials (s), without those of later stages."""
        return sum(test.duration for test in self.tests)

    @property
    def stages(self) -> tuple[PlannedStage, ...]:
        """The later stages of all tests."""
        return tuple(stage for test in self.tests for stage in test.stages)

    @property
    def following(self) -> Most:
        """Upper bounds for the trials of later stages."""
        return most_of(self.stages)

    @property
    def samples(self) -> int:
        """Samples of all trials, per channel."""
        return sum(trial.task.samples for trial in self.trials)

    @property
    def size(self) -> int:
        """Bytes of all recordings before compression, with those of later stages: an upper
        estimate of the archive size.
        """
        texts = sum(len(text) for text in self.protocol.sources.values())
        planned = sum(map(_size, self.trials)) + texts
        return planned + _size_of_stages(self)


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
        allow_large: permit more than 100 000 trials.
        seed: for tests without their own; drawn if None, and recorded in any case.

    Raises UsageError for unknown names in `only`, and ProtocolError if options and bench contradict
    each other at a point of a matrix, or if the plan is too large. Margins to limits are computed,
    not enforced: see `check_limits`.
    """
    chosen = _chosen(protocol, only)
    problems = [problem for test in chosen for problem in _too_large(test, allow_large)]
    if problems:
        raise ProtocolError(problems)
    master = secrets.randbits(63) if seed is None else seed
    planned: list[PlannedTest] = []
    uses: list[LimitUse] = []
    expansions = _expanded(protocol, chosen, master, allow_large)
    if problems := _too_many(chosen, expansions, allow_large):
        raise ProtocolError(problems)
    for test, expanded in zip(chosen, expansions, strict=True):
        try:
            own = list(_limit_uses(expanded))
        except IncompleteBenchError as error:
            problems += incomplete(test, error).problems
            continue
        planned.append(_planned(test, expanded, own, master))
        uses += own
    if problems:
        raise ProtocolError(list(dict.fromkeys(problems)))
    trials = [trial for expanded in expansions for trial in expanded.trials]
    trials.sort(key=lambda trial: trial.number)  # checks are between trials of other tests
    normalised: Tree = {"tests": [_normalised(t, master) for t in protocol.tests]}
    if protocol.check is not None:
        normalised["check"] = {"test": protocol.check.test, "every": protocol.check.every}
    return Plan(
        protocol=protocol,
        tests=tuple(planned),
        trials=tuple(trials),
        normalised=normalised,
        fingerprint=hashlib.sha256(canonical_json(normalised).encode()).hexdigest(),
        only=tuple(only),
        seed=master,
        breaches=tuple(use for use in uses if use.margin.broken),
        truths={name: tree for expanded in expansions for name, tree in expanded.truths.items()},
    )


def _expanded(
    protocol: Protocol, chosen: Sequence[Test], master: int, allow_large: bool
) -> list[ExpandedTest]:
    """Every chosen test's trials, the checks among them. Raises ProtocolError."""
    expansions: list[ExpandedTest] = []
    problems: list[Problem] = []
    before, left = 0, memory.MOST
    for test in chosen:
        try:
            seed = seed_of(test, master)
            expansions.append(expand(test, seed, before, allow_large, left))
        except PointError as error:
            problems += error.problems
            continue
        before += len(expansions[-1].trials)
        left -= expansions[-1].memory
    if problems:
        raise ProtocolError(list(dict.fromkeys(problems)))
    check, names = protocol.check, [test.entry.name for test in chosen]
    if check is None or check.test not in names:
        return expansions  # --only excludes the test to repeat
    named = names.index(check.test)
    if expansions[named].first_measurement is None:
        raise ProtocolError([nothing_to_check(protocol, check.test)])
    return with_checks(expansions, named, check, seed_of(chosen[named], master))


def _too_many(
    tests: Sequence[Test], expansions: Sequence[ExpandedTest], allow: bool
) -> list[Problem]:
    """Problems of a plan that its later stages make too large."""
    following = [most_of(expanded.stages).trials for expanded in expansions]
    total = sum(following) + sum(len(expanded.trials) for expanded in expansions)
    if allow or total <= LARGEST_PLAN or not any(following):
        return []
    largest = max(range(len(tests)), key=following.__getitem__)
    return [size_problem(tests[largest], "with the trials that may follow, the plan has")]


def _size(trial: Trial) -> int:
    samples = trial.task.samples
    preview = 2 * 8 * PREVIEW if samples > PREVIEW else 0
    return samples * BYTES + preview + STRUCTURE + len(trial.model_dump_json())


def _size_of_stages(plan: Plan) -> int:
    """Bytes of the trials that may follow, each with the longest description of a planned one."""
    most = plan.following
    if not most.trials:
        return 0
    described = max(len(trial.model_dump_json()) for trial in plan.trials)
    each = 2 * 8 * PREVIEW + STRUCTURE + described
    return most.samples * BYTES + most.trials * each


def _limit_uses(expanded: ExpandedTest) -> Iterator[LimitUse]:
    """Margins of the first trial with each bench and task, and each broken limit of all trials."""
    known: dict[tuple[int, Task], tuple[Margin, ...]] = {}
    for trial, bench in zip(expanded.trials, expanded.benches, strict=True):
        if trial.recording:  # it was executed already
            continue
        key = (id(bench), trial.task)
        first = key not in known
        if first:
            known[key] = (*margins(bench, trial.task), *resolution_margins(bench, trial.task))
        for margin in known[key]:
            if first or margin.broken:
                yield LimitUse(trial.number, margin)


def _planned(
    test: Test, expanded: ExpandedTest, uses: Sequence[LimitUse], master: int
) -> PlannedTest:
    closest = _worst(use for use in uses if not use.margin.sensor)
    coarse = _worst(use for use in uses if use.margin.sensor and use.margin.fraction > CLOSE)
    first = first_point(test)
    matrix: dict[str, dict[str, Any]] = {axis.path: {} for axis in test.axes}
    for trial in expanded.trials:
        for path, values in matrix.items():
            values.setdefault(canonical_json(trial.point[path]), trial.point[path])
    entry = test.entry
    return PlannedTest(
        name=entry.name,
        kind=entry.kind,
        title=entry.title,
        description=entry.description,
        group=entry.group,
        leading_figure=entry.leading_figure,
        reproduces=entry.reproduces,
        bench=test.bench_name,
        options={
            name: value
            for name, value in first.options_tree.items()
            if any(name in each.options and each.options[name] == value for each in expanded.trials)
        },
        matrix={path: tuple(values.values()) for path, values in matrix.items()},
        order=entry.order,
        seed=seed_of(test, master),
        repeat=entry.repeat,
        numbers=tuple(trial.number for trial in expanded.trials),
        closest=closest,
        loops=loops_used(
            (trial.number, trial.task, bench)
            for trial, bench in zip(expanded.trials, expanded.benches, strict=True)
            if not trial.recording
        ),
        seeks_instability=test.experiment.seeks_instability,
        duration=sum(trial.task.duration for trial in expanded.trials),
        coarse=coarse,
        chosen=first.chosen,
        stages=expanded.stages,
        warnings=(*expanded.warnings, *not_predicted(expanded)),
    )


def _worst(uses: Iterable[LimitUse]) -> tuple[LimitUse, ...]:
    """For each limit the trial that uses most of it."""
    worst: dict[str, LimitUse] = {}
    for use in uses:
        best = worst.get(use.margin.limit)
        if best is None or use.margin.fraction > best.margin.fraction:
            worst[use.margin.limit] = use
    return tuple(worst.values())


def _normalised(test: Test, master: int) -> Tree:
    """Data that determine the trials of a test; prose is excluded and may be corrected."""
    first = first_point(test)
    swept: dict[str, Any] = {axis.path: axis.describe() for axis in test.axes}
    by_hand: list[Any] = [entry.model_dump(mode="json") for entry in test.entry.operator]
    more: Tree = {"operator": by_hand} if by_hand else {}
    if test.truth is not None:
        more["truth"] = digest(test.truth)
    return {
        **more,
        "name": test.entry.name,
        "kind": test.entry.kind,
        "options": first.options_tree,
        "bench": first.bench_tree,
        "matrix": [[path, values] for path, values in swept.items()],
        "repeat": test.entry.repeat,
        "order": test.entry.order,
        "seed": seed_of(test, master),
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
        return [size_problem(test, f"test '{test.entry.name}' alone has {trials}, the plan")]
    if memory.least(test) > memory.MOST:
        return [memory_problem(test, memory.least(test))]
    return list(value_problems(test))  # loading did not check them
