"""Analyzed runs of one rig in order of time, and their differences."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import cached_property
from itertools import pairwise
from pathlib import Path

from campaign.api.analysis import AnalysedTest, analyse_run, damage_of, source_of
from campaign.archive.reading.damage import Damage
from campaign.archive.reading.run_reader import RunReader
from campaign.axis_kind import BOTH_ROTARY, Sides, in_axis_terms
from campaign.comparison.circumstances import Change, changes
from campaign.comparison.draws import SIMULATION
from campaign.comparison.run_comparison import refuse_twice
from campaign.comparison.same_quantity import pair_tests
from campaign.comparison.shared_systematics import constants, source_called
from campaign.errors import UsageError
from campaign.experiments.interface import Experiment

LEAST = 3
"""Fewest runs; two runs can only be compared."""
LISTED = 6
"""Largest number of runs in a message."""
OWN_OF_EACH = ("operator", "machine", "status", "title", "seed")
"""Differences between runs that cannot explain a change of a number."""


@dataclass(frozen=True)
class Member:
    """One of the runs.

    Attributes:
        number: position in order of time, from 1.
        tests: without figures, to save memory.
        constants: constants of the bench by the name of their systematic part; runs with the same
            text have the same constant.
        exchanged: systematic parts of the pieces that were exchanged before this run.
    """

    number: int
    run: RunReader
    created: datetime
    tests: tuple[AnalysedTest, ...]
    constants: Mapping[str, str] = field(default_factory=dict)
    exchanged: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        return self.run.name

    @property
    def sides(self) -> Sides:
        """Kinds of motion of the rig, which determine its terms."""
        return next((test.sides for test in self.tests if test.bench), BOTH_ROTARY)

    @property
    def damaged(self) -> tuple[Damage, ...]:
        """Detected damage of the run."""
        return damage_of(self.run, self.tests)

    @property
    def problems(self) -> tuple[str, ...]:
        """Reasons for tests without a result."""
        return tuple(f"{self.name}: {t.name}: {t.problem}" for t in self.tests if t.problem)

    @cached_property
    def identical(self) -> Mapping[str, tuple[str, ...]]:
        """Fingerprints of simulated trials by test; equal fingerprints mean equal samples."""
        return {test.name: prints for test in self.tests if (prints := _fingerprints(test))}


def members_of(
    runs: Sequence[RunReader], experiments: Mapping[str, Experiment]
) -> tuple[Member, ...]:
    """Analyze the runs, in order of their start.

    Raises UsageError for fewer than three runs, a repeated run, and several rigs.
    """
    _check(runs)
    begun = sorted(runs, key=lambda run: (_begun(run), run.name))
    _of_one_rig(begun)
    return tuple(_member(n, run, experiments) for n, run in enumerate(begun, start=1))


def with_exchanged(
    members: Sequence[Member], exchanged: Sequence[tuple[str, Path]]
) -> tuple[Member, ...]:
    """Mark the constants of exchanged pieces, which no bench file states.

    exchanged: systematic parts, each with the path of the first run with the new piece. Earlier
        and later runs do not share the error of the piece.

    Raises UsageError for an unknown constant, an unknown run, and the first of all runs.
    """
    for name, path in exchanged:
        text = f"--exchanged {name}@{path.stem}"
        known = dict.fromkeys(source for member in members for source in member.constants)
        source = source_called(name, known, members[0].sides)
        if source is None:
            names = ", ".join(in_axis_terms(each, members[0].sides) for each in known) or "nothing"
            raise UsageError(f"{text}: {name!r} is none of {names}")
        first = next((each.number for each in members if each.run.path == path), None)
        if first is None:
            raise UsageError(f"{text}: none of the runs that are followed")
        if first == 1:
            raise UsageError(f"{text}: the first run; name the first one with the new piece")
        members = [
            each if each.number < first else _with_another(each, source, first) for each in members
        ]
    return tuple(members)


def _with_another(member: Member, source: str, first: int) -> Member:
    if source not in member.constants:
        return member
    constant = f"{member.constants[source]}, exchanged before run {first}"
    new = (source,) if member.number == first else ()
    return replace(
        member,
        constants={**member.constants, source: constant},
        exchanged=(*member.exchanged, *new),
    )


def changes_before(members: Sequence[Member]) -> tuple[tuple[Change, ...], ...]:
    """Differences, other than results, of each run from the previous run."""
    return tuple(
        tuple(
            change
            for change in changes(one.run, other.run, pair_tests(one.tests, other.tests))
            if change.path not in OWN_OF_EACH
        )
        + tuple(_exchanges(other))
        for one, other in pairwise(members)
    )


def _exchanges(member: Member) -> Iterator[Change]:
    for source in member.exchanged:
        yield Change("rig", in_axis_terms(source, member.sides), "one piece", "another")


def _check(runs: Sequence[RunReader]) -> None:
    refuse_twice(runs)
    if len(runs) == 2:
        raise UsageError(
            "two runs show no trend; name three or more, or hold them against each other with "
            f"`campaign compare {runs[0].name} {runs[1].name}`"
        )
    if len(runs) < LEAST:
        raise UsageError("name three runs of one rig or more; one shows no trend")


def _of_one_rig(runs: Sequence[RunReader]) -> None:
    """Raise UsageError for different benches or different sources of samples."""
    for what, of in (("different rigs", _benches), ("different kinds", _kinds)):
        groups: dict[str, list[str]] = {}
        for run in runs:
            groups.setdefault(of(run), []).append(run.name)
        if len(groups) > 1:
            listing = "; ".join(f"{key}: {_listed(names)}" for key, names in groups.items())
            raise UsageError(f"the runs are of {what}, which no trend leads through ({listing})")


def _benches(run: RunReader) -> str:
    names = {str(t.trial.bench.get("name", "")) for t in run.trials}
    return "bench " + " and ".join(sorted(names)) if names else "no bench"


def _kinds(run: RunReader) -> str:
    return source_of(run) or "origin of the samples not stated"


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - LISTED} more" if len(names) > LISTED else ""
    return ", ".join(names[:LISTED]) + more


def _begun(run: RunReader) -> datetime:
    return datetime.fromisoformat(run.header.created).astimezone(UTC)


def _member(number: int, run: RunReader, experiments: Mapping[str, Experiment]) -> Member:
    tests = tuple(
        replace(test, result=replace(test.result, figures=()))
        for test in analyse_run(run, experiments)
    )
    known: dict[str, str] = {}
    for test in tests:
        known |= constants(test, run.header.truth.plants)
    return Member(number, run, _begun(run), tests, known)


def _fingerprints(test: AnalysedTest) -> tuple[str, ...]:
    if test.source != SIMULATION:
        return ()
    return tuple(each.trial.fingerprint for each in test.trials if each.is_completed_measurement)
