"""Key numbers of a test: the findings that answer its question."""

from __future__ import annotations

from collections.abc import Sequence

from campaign.experiments.interface import KeyQuantity
from campaign.published.draws import by_draw, together
from campaign.result import Finding, Value

MOST = 8
"""Most key numbers that are shown for all points of a sweep."""
FIRST = 24
"""Most findings that replace missing key numbers."""
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
"""Conditions in which numbers of one point of a sweep differ."""


def key_numbers(
    findings: Sequence[Finding], wanted: Sequence[KeyQuantity], draws: Sequence[Value] = ()
) -> tuple[Finding, ...]:
    """Wanted findings in that order; the first `FIRST` findings without any of them.

    Several `draws` (seeds) of a random bench have one number: their median, with the interval of
    one further draw. Of more than `MOST`, those of the first and the last point of the sweep are
    chosen: by point and not by size, so that their intervals remain valid.
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
    conditions = finding.conditions
    return finding.quantity == wanted.quantity and all(
        name in conditions and conditions[name] == value for name, value in wanted.where.items()
    )


def _place(finding: Finding) -> str:
    return str({n: v for n, v in finding.conditions.items() if n not in WITHIN_A_PLACE})
