"""Matching findings of two runs by quantity and conditions.

Only tests of the same kind match: first those of the same name, then those with the most findings
in common. Tests and findings without a partner are kept and reported.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from campaign.api.analysis import AnalysedTest
from campaign.result import Finding, Value, meets
from campaign.units import same_dimension


@dataclass(frozen=True)
class PairedTest:
    """A test of the reference and the matching test of another run.

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
    """All tests of two runs, with and without a partner."""

    tests: tuple[PairedTest, ...]
    only_reference: tuple[AnalysedTest, ...]
    only_other: tuple[AnalysedTest, ...]


def pair_tests(reference: Sequence[AnalysedTest], other: Sequence[AnalysedTest]) -> Pairing:
    """Match tests, each at most once, in the reference's order."""
    partners: dict[int, int] = {}
    for same_name in (True, False):
        for _, i, j in sorted(_candidates(reference, other, same_name=same_name)):
            if i not in partners and j not in partners.values():
                partners[i] = j
    pairs = [_paired(reference[i], other[j]) for i, j in sorted(partners.items())]
    taken = set(partners.values())
    return Pairing(
        tuple(pairs),
        tuple(test for i, test in enumerate(reference) if i not in partners),
        tuple(test for j, test in enumerate(other) if j not in taken),
    )


def pair_findings(
    reference: Iterable[Finding], other: Iterable[Finding]
) -> tuple[list[tuple[Finding, Finding]], list[Finding], list[Finding]]:
    """Match findings, each once, in order: pairs, and findings of either side without a partner."""
    pairs: list[tuple[Finding, Finding]] = []
    alone: list[Finding] = []
    others = list(other)
    free: dict[Hashable, list[int]] = {}
    for place, finding in enumerate(others):
        free.setdefault(_words(finding), []).append(place)
    for finding in reference:
        places = free.get(_words(finding), [])
        partner = next((n for n in places if same_finding(finding, others[n])), None)
        if partner is None:
            alone.append(finding)
        else:
            places.remove(partner)
            pairs.append((finding, others[partner]))
    return pairs, alone, [others[n] for n in sorted(n for places in free.values() for n in places)]


def same_finding(one: Finding, other: Finding) -> bool:
    """Whether two findings have the same quantity and conditions, in units of one dimension."""
    if one.quantity != other.quantity or not same_dimension(one.unit, other.unit):
        return False
    wanted, stated = _stated(one.conditions), _stated(other.conditions)
    return len(wanted) == len(stated) and meets(stated, wanted)


def _candidates(
    reference: Sequence[AnalysedTest], other: Sequence[AnalysedTest], *, same_name: bool
) -> Iterator[tuple[int, int, int]]:
    """Tests that may match: (cost, index in the reference, index in the other)."""
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
    """Findings from recordings; those recomputed from published values are excluded."""
    return (finding for finding in test.result.findings if not finding.recomputed)


def _words(finding: Finding) -> Hashable:
    """Quantity, names of conditions, and text values; they are equal for matching findings."""
    stated = _stated(finding.conditions)
    words = frozenset((name, value) for name, value in stated.items() if isinstance(value, str))
    return finding.quantity, frozenset(stated), words


def _stated(conditions: Mapping[str, Value]) -> dict[str, Value]:
    return {name: value for name, value in conditions.items() if value is not None}
