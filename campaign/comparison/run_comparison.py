"""Comparison of runs with the first one, as data for page, table and terminal."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from campaign.api.analysis import AnalysedTest, analyse_run, damage_of, run_title
from campaign.archive.reading.damage import Damage
from campaign.archive.reading.run_reader import RunReader
from campaign.axis_kind import BOTH_ROTARY, in_axis_terms
from campaign.comparison.circumstances import Change, changes
from campaign.comparison.finding_pairs import Pair, pairs_of
from campaign.comparison.same_quantity import Pairing, pair_tests
from campaign.comparison.shared_systematics import shared_sources, source_called
from campaign.errors import UsageError
from campaign.estimate import Estimate
from campaign.experiments.interface import Experiment
from campaign.experiments.shared.captions import listed
from campaign.experiments.shared.systematic import SOURCES
from campaign.references.verdict import Verdict, with_verdicts

LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"


@dataclass(frozen=True)
class Side:
    """A run with its analyzed tests; A is the reference."""

    letter: str
    run: RunReader
    tests: tuple[AnalysedTest, ...]

    @property
    def title(self) -> str:
        return run_title(self.run)

    @property
    def damaged(self) -> tuple[Damage, ...]:
        """Damage of the run that its reader or its analyses detected."""
        return damage_of(self.run, self.tests)

    @property
    def problems(self) -> tuple[str, ...]:
        """Reasons for tests without a result."""
        return tuple(f"{self.letter}: {t.name}: {t.problem}" for t in self.tests if t.problem)


@dataclass(frozen=True)
class Against:
    """Another run against the reference.

    Attributes:
        pairs: with verdicts, in the order of the reference's tests and findings.
        shared: sources of systematic parts that cancel, by the reference's test.
        changes: differences besides the results.
    """

    reference: Side
    other: Side
    pairing: Pairing
    pairs: tuple[Pair, ...]
    shared: Mapping[str, frozenset[str]]
    changes: tuple[Change, ...]

    def of(self, verdict: Verdict) -> tuple[Pair, ...]:
        """Pairs with this verdict; for `DIFFERENT`, the largest change first."""
        pairs = [pair for pair in self.pairs if pair.verdict is verdict]
        if verdict is Verdict.DIFFERENT:
            pairs.sort(key=size_of, reverse=True)
        return tuple(pairs)

    @property
    def equal(self) -> bool:
        """Whether both runs have the same findings with exactly equal numbers and intervals."""
        alone = any(tested.only_reference or tested.only_other for tested in self.pairing.tests)
        alone = alone or bool(self.pairing.only_reference or self.pairing.only_other)
        numbers = ((pair.reference, pair.other) for pair in self.pairs)
        return bool(self.pairs) and not alone and all(_same(*each) for each in numbers)

    @property
    def without_interval(self) -> tuple[Pair, ...]:
        """Pairs of simulated numbers without intervals, as from noise-free simulations."""
        return tuple(pair for pair in self.pairs if pair.simulated_bare)

    @property
    def tested(self) -> int:
        """Count of pairs in the family."""
        return sum(pair.testable for pair in self.pairs)


@dataclass(frozen=True)
class Comparison:
    """Comparison of runs with the first one."""

    sides: tuple[Side, ...]
    against: tuple[Against, ...]

    @property
    def title(self) -> str:
        """Title with the runs' titles if they are unique, else with their names."""
        titles = [side.title for side in self.sides]
        names = [side.run.header.name for side in self.sides]
        reference, *others = titles if len(set(titles)) == len(titles) else names
        return f"{listed(others)} compared with {reference}"

    @property
    def tested(self) -> int:
        """Size of the family: pairs of all runs that have a p value."""
        return sum(each.tested for each in self.against)


def _same(one: Estimate, other: Estimate) -> bool:
    same = one.value == other.value or (math.isnan(one.value) and math.isnan(other.value))
    return same and (one.low, one.high) == (other.low, other.high)


def size_of(pair: Pair) -> float:
    """Sort key: size of the relative change; infinite if undefined."""
    share = abs(pair.found.change.value)
    return math.inf if math.isnan(share) else share


def compare_runs(
    runs: Sequence[RunReader],
    experiments: Mapping[str, Experiment],
    exchanged: Sequence[str] = (),
) -> Comparison:
    """Analyze the runs and compare each with the first.

    exchanged: sources of systematic parts that differ between runs although all benches state the
        same value, e.g. after the exchange of a motor.

    Raises UsageError for fewer than two runs, a repeated run, and runs without common findings.
    """
    _check(runs)
    sides = tuple(
        Side(letter, run, analyse_run(run, experiments))
        for letter, run in zip(LETTERS, runs, strict=False)
    )
    others = [_exchanged(sides[0], name) for name in exchanged]
    unjudged = [_against(sides[0], other, others) for other in sides[1:]]
    verdicts = iter(with_verdicts([pair for each in unjudged for pair in each.pairs]))
    against = (replace(each, pairs=tuple(next(verdicts) for _ in each.pairs)) for each in unjudged)
    return Comparison(sides, tuple(against))


def _exchanged(reference: Side, name: str) -> str:
    """Source of this name; raises UsageError if unknown."""
    axis = next((test.sides for test in reference.tests if test.bench), BOTH_ROTARY)
    source = source_called(name, SOURCES.values(), axis)
    if source is None:
        known = ", ".join(in_axis_terms(each, axis) for each in SOURCES.values())
        raise UsageError(f"--exchanged {name!r}: is none of {known}")
    return source


def _check(runs: Sequence[RunReader]) -> None:
    if len(runs) < 2:
        raise UsageError("name two runs or more: the first is what the others are compared with")
    if len(runs) > len(LETTERS):
        raise UsageError(f"{len(runs)} runs are too many: at most {len(LETTERS)} can be compared")
    refuse_twice(runs)


def refuse_twice(runs: Iterable[RunReader]) -> None:
    """Raise UsageError for two runs with the same path or content."""
    seen: dict[str, RunReader] = {}
    for run in runs:
        for key in filter(None, (str(run.path.resolve()), run.root)):
            if key in seen:
                raise UsageError(f"{seen[key].path} and {run.path} are the same run")
            seen[key] = run


def _against(reference: Side, other: Side, exchanged: Sequence[str]) -> Against:
    pairing = pair_tests(reference.tests, other.tests)
    plants = reference.run.header.truth.plants, other.run.header.truth.plants
    shared = {
        tested.reference.name: shared_sources(tested.reference, tested.other, *plants)
        - set(exchanged)
        for tested in pairing.tests
    }
    pairs = [
        pair for tested in pairing.tests for pair in pairs_of(tested, shared[tested.reference.name])
    ]
    if not pairs:
        raise UsageError("\n".join(_nothing_common(reference, other)))
    return Against(
        reference,
        other,
        pairing,
        tuple(pairs),
        shared,
        changes(reference.run, other.run, pairing),
    )


def _nothing_common(reference: Side, other: Side) -> Iterator[str]:
    """Lines with the reason for no comparison, and with tests and quantities of each run."""
    yield (
        f"{reference.run.name} and {other.run.name} have no finding in common: none is of the same "
        "quantity under the same conditions"
    )
    for side in (reference, other):
        kinds = dict.fromkeys(test.kind for test in side.tests)
        quantities = dict.fromkeys(f.quantity for t in side.tests for f in t.result.findings)
        listing = ", ".join(list(quantities)[:8]) + (" ..." if len(quantities) > 8 else "")
        yield f"  {side.run.name} has {', '.join(kinds) or 'no test'}: {listing or 'nothing found'}"
        yield from (f"    {problem}" for problem in side.problems)
