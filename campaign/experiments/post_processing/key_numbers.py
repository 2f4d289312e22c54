"""Key numbers of a test: the findings that answer what it asks."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from campaign.published.draws import SEED, together, without_seed
from campaign.result import Finding, Value
from campaign.trial import canonical_json

MOST = 8
"""Key numbers of a test that are shown of all of its places."""
WITHIN_A_PLACE = (
    "compensation",
    "component",
    "direction",
    "model",
    "parameter",
    "property",
    "set",
    "statistic",
)
"""Conditions in which numbers of one place of a sweep differ."""


@dataclass(frozen=True)
class KeyQuantity:
    """A quantity of which findings are key numbers: those with all of these conditions."""

    quantity: str
    where: Mapping[str, Value]


def key(quantity: str, **where: Value) -> KeyQuantity:
    """`key("breakaway_torque", statistic="mean")`."""
    return KeyQuantity(quantity, where)


def key_numbers(findings: Sequence[Finding], wanted: Sequence[KeyQuantity]) -> tuple[Finding, ...]:
    """The findings that are wanted, in that order; all where there are none of these.

    Several draws of a random bench have one number: their median, and where one more lies. Of a
    sweep with more than `MOST` the numbers of its first and of its last place are chosen: by place
    and not by size, so that their intervals still hold.
    """
    every = _together(findings)
    chosen = [each for one in wanted for each in every if _is(one, each)] or every
    if len(chosen) <= MOST:
        return tuple(chosen)
    places: dict[str, list[str]] = {}
    for each in chosen:
        places.setdefault(each.quantity, []).append(_place(each))
    return tuple(e for e in chosen if _place(e) in (places[e.quantity][0], places[e.quantity][-1]))


def _is(wanted: KeyQuantity, finding: Finding) -> bool:
    told = finding.conditions
    return finding.quantity == wanted.quantity and all(
        name in told and told[name] == value for name, value in wanted.where.items()
    )


def _place(finding: Finding) -> str:
    rest = {name: v for name, v in finding.conditions.items() if name not in WITHIN_A_PLACE}
    return canonical_json(rest)


def by_draw(findings: Iterable[Finding]) -> list[list[Finding]]:
    """Findings that differ in nothing but the seed of their draw, together."""
    groups: dict[str, list[Finding]] = {}
    for each in findings:
        key = canonical_json([each.quantity, each.unit, without_seed(each.conditions)])
        groups.setdefault(key, []).append(each)
    return list(groups.values())


def _together(findings: Sequence[Finding]) -> list[Finding]:
    seeds = {each.conditions[SEED] for each in findings if SEED in each.conditions}
    if not seeds:
        return list(findings)
    return [together(group, seeds) for group in by_draw(findings)]
