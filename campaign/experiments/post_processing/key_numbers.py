"""Key numbers of a test: the findings that answer what it asks."""

from __future__ import annotations

from collections.abc import Sequence

from campaign.experiments.interface import KeyQuantity
from campaign.published.draws import by_draw, together
from campaign.result import Finding, Value

MOST = 8
"""Key numbers of a test that are shown of all of its places."""
FIRST = 24
"""Findings that stand for those of an experiment that declares none."""
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


def key_numbers(
    findings: Sequence[Finding], wanted: Sequence[KeyQuantity], draws: Sequence[Value] = ()
) -> tuple[Finding, ...]:
    """The findings that are wanted, in that order; the first where there are none of these.

    Several `draws` of a random bench, by their seeds, have one number: their median, and where one
    more lies. Of a sweep with more than `MOST` the numbers of its first and of its last place are
    chosen: by place and not by size, so that their intervals still hold.
    """
    every = list(findings)
    if len(draws) > 1:
        every = [together(group, draws) for group in by_draw(findings)]
    chosen = [each for one in wanted for each in every if _is(one, each)] or every[:FIRST]
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
    return str({n: v for n, v in finding.conditions.items() if n not in WITHIN_A_PLACE})
