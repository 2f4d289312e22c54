"""Matching findings of two runs by quantity and conditions.

Tests go together that are of the same kind: those of the same name first, then, of those left over,
those that have most findings in common. Whatever has no partner is kept and told.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from campaign.api.analysis import AnalysedTest
from campaign.result import Finding, Value, same_value
from campaign.units import same_dimension


@dataclass(frozen=True)
class PairedTest:
    """A test of the reference and the one of another run that it goes with.

    Attributes:
        findings: (reference, other), in the reference's order.
        only_reference, only_other: findings without a partner.
    """

    reference: AnalysedTest
    other: AnalysedTest
    findings: tuple[tuple[Finding, Finding], ...]
    only_reference: tuple[Finding, ...]
    only_other: tuple[Finding, ...]


@dataclass(frozen=True)
class Pairing:
    """All tests of two runs; those without a partner apart."""

    tests: tuple[PairedTest, ...]
    only_reference: tuple[AnalysedTest, ...]
    only_other: tuple[AnalysedTest, ...]


def pair_tests(reference: Sequence[AnalysedTest], other: Sequence[AnalysedTest]) -> Pairing:
    """Each test at most once, in the reference's order."""
    partners: dict[int, int] = {}
    for same_name in (True, False):
        for _, i, j in sorted(_candidates(reference, other, same_name=same_name)):
            if i not in partners and j not in partners.values():
                partners[i] = j
    found = [_paired(reference[i], other[j]) for i, j in sorted(partners.items())]
    taken = set(partners.values())
    return Pairing(
        tuple(found),
        tuple(test for i, test in enumerate(reference) if i not in partners),
        tuple(test for j, test in enumerate(other) if j not in taken),
    )


def pair_findings(
    reference: Iterable[Finding], other: Iterable[Finding]
) -> tuple[list[tuple[Finding, Finding]], list[Finding], list[Finding]]:
    """Pairs, and what is left over on either side; each finding takes part once, in order."""
    pairs: list[tuple[Finding, Finding]] = []
    alone: list[Finding] = []
    theirs = list(other)
    free: dict[Hashable, list[int]] = {}
    for place, finding in enumerate(theirs):
        free.setdefault(_words(finding), []).append(place)
    for finding in reference:
        places = free.get(_words(finding), [])
        partner = next((n for n in places if same_finding(finding, theirs[n])), None)
        if partner is None:
            alone.append(finding)
        else:
            places.remove(partner)
            pairs.append((finding, theirs[partner]))
    return pairs, alone, [theirs[n] for n in sorted(n for places in free.values() for n in places)]


def same_finding(one: Finding, other: Finding) -> bool:
    """Whether both are one quantity under one set of conditions, in units that go together."""
    if one.quantity != other.quantity or not same_dimension(one.unit, other.unit):
        return False
    stated = [_stated(one.conditions), _stated(other.conditions)]
    return stated[0].keys() == stated[1].keys() and all(
        same_value(value, stated[1][name]) for name, value in stated[0].items()
    )


def _candidates(
    reference: Sequence[AnalysedTest], other: Sequence[AnalysedTest], *, same_name: bool
) -> Iterator[tuple[int, int, int]]:
    """(less is better, place in the reference, place in the other) of what may go together."""
    for i, one in enumerate(reference):
        for j, another in enumerate(other):
            if one.kind != another.kind or (one.name == another.name) != same_name:
                continue
            common = len(_paired(one, another).findings)
            if common or same_name:
                yield -common, i, j


def _paired(reference: AnalysedTest, other: AnalysedTest) -> PairedTest:
    pairs, one, another = pair_findings(_measured(reference), _measured(other))
    return PairedTest(reference, other, tuple(pairs), tuple(one), tuple(another))


def _measured(test: AnalysedTest) -> Iterator[Finding]:
    """What a recording says; what follows from published values says nothing of a run."""
    return (finding for finding in test.result.findings if not finding.recomputed)


def _words(finding: Finding) -> Hashable:
    """What two findings must have in common to the letter: the rest are numbers."""
    stated = _stated(finding.conditions)
    words = frozenset((name, value) for name, value in stated.items() if isinstance(value, str))
    return finding.quantity, frozenset(stated), words


def _stated(conditions: Mapping[str, Value]) -> dict[str, Value]:
    return {name: value for name, value in conditions.items() if value is not None}
