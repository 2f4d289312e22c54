"""Key numbers of each test for the first screen."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from campaign.api.analysis import AnalysedTest
from campaign.api.conclusion_sentences import alone
from campaign.axis_kind import axis_terms
from campaign.experiments.post_processing.draws import draws_of
from campaign.experiments.shared.common import short_label
from campaign.published.draws import without_seed
from campaign.published.evidence import concerns
from campaign.published.scoreboard import Line, Scoreboard
from campaign.published.status import Status
from campaign.report.content.lines import shown_line
from campaign.report.content.truth import conditions_text
from campaign.report.content.written_units import TestUnits
from campaign.result import Amount, Factor, Finding, Table, Value
from campaign.text import SHORT, number, pretty_unit, quantity_words
from campaign.units import convert

MOST = 18
"""Rows that the first screen has room for."""
FEWEST = 2
"""of each test, however many there are."""
COMPENSATION = "compensation"
SAYS_ITSELF = ("component", COMPENSATION, "direction", "model", "parameter", "statistic")
"""Conditions whose value is clear without their name."""


@dataclass(frozen=True)
class KeyNumber:
    """A finding that a sentence of its test says.

    Attributes:
        quantity: in words.
        where: its conditions, but for those that it shares with the others of its test.
        value: with its interval and unit, as the sentence has it.
        published: what is printed of it, with its unit; "" where nothing is.
        agrees: whether that is reproduced.
        true: what is true of the simulated bench, with its unit; "" unknown.
    """

    quantity: str
    where: str
    value: str
    published: str = ""
    agrees: bool = False
    true: str = ""


@dataclass(frozen=True)
class KeyNumbers:
    """Those of one test; `where` holds for all of them."""

    test: str
    title: str
    where: str
    numbers: tuple[KeyNumber, ...]


def key_numbers(
    tests: Sequence[AnalysedTest],
    units: Mapping[str, TestUnits],
    scoreboard: Scoreboard,
    truths: Mapping[str, Table],
) -> tuple[KeyNumbers, ...]:
    """The first numbers that each of these tests says; tests that say none are left out."""
    said = [(test, tuple(_said(test))) for test in tests]
    said = [(test, found) for test, found in said if found]
    each = max(FEWEST, MOST // max(1, len(said)))
    return tuple(
        _of_test(test, found[:each], units[test.name], scoreboard.lines, truths.get(test.name))
        for test, found in said
    )


def _said(test: AnalysedTest) -> Iterator[tuple[Finding, Amount | Factor]]:
    """The findings that its sentences say, in their order, each once."""
    left = list(test.result.findings)
    for conclusion in test.result.conclusions:
        for part in conclusion.parts:
            if not isinstance(part, str) and (found := _finding(part, left)) is not None:
                left.remove(found)
                yield found, part


def _finding(part: Amount | Factor, findings: Sequence[Finding]) -> Finding | None:
    """None where several findings have that value: nobody knows which of them is said."""
    estimate = part.estimate
    same = [f for f in findings if f.value == estimate.value and f.unit == estimate.unit]
    same = [f for f in same if f.quantity == estimate.name] or same
    return same[0] if len(same) == 1 else None


def _of_test(
    test: AnalysedTest,
    said: Sequence[tuple[Finding, Amount | Factor]],
    units: TestUnits,
    lines: Sequence[Line],
    truth: Table | None,
) -> KeyNumbers:
    drawn = len(draws_of(each.trial for each in test.trials)) > 1  # a median is of no seed
    every = [without_seed(f.conditions) if drawn else f.conditions for f, _ in said]
    shared: dict[str, Value] = {}
    if len(said) > 1:
        shared = {n: v for n, v in every[0].items() if all(n in c and c[n] == v for c in every)}
    own = [line for line in lines if line.test == test.name]
    with axis_terms(test.sides):
        numbers = tuple(
            KeyNumber(
                quantity_words(finding.quantity),
                _where({n: v for n, v in conditions.items() if n not in shared}, units),
                alone(part),
                *_published(finding, own, test),
                _true(finding, part, truth),
            )
            for (finding, part), conditions in zip(said, every, strict=True)
        )
        return KeyNumbers(test.name, test.title, _where(shared, units), numbers)


def _where(conditions: Mapping[str, Value], units: TestUnits) -> str:
    alone = [
        _compensation(str(value)) if name == COMPENSATION else str(value)
        for name, value in conditions.items()
        if name in SAYS_ITSELF
    ]
    others = {name: value for name, value in conditions.items() if name not in SAYS_ITSELF}
    return ", ".join([*alone, *filter(None, [conditions_text(others, units)])]).replace("_", " ")


def _compensation(name: str) -> str:
    return "without compensation" if name == "none" else short_label(name)


def _published(finding: Finding, lines: Sequence[Line], test: AnalysedTest) -> tuple[str, bool]:
    """What is printed of it, and whether it is reproduced; of doubtful cells nothing."""
    known = test.evidence().known
    for line in lines:
        if line.status is not Status.INCONSISTENT and concerns(finding, line.cell, known):
            shown = shown_line(line)
            return f"{shown.published} {shown.unit}".rstrip(), shown.good
    return "", False


def _true(finding: Finding, part: Amount | Factor, truth: Table | None) -> str:
    """The value beside which the test's own table holds it."""
    if truth is None or not isinstance(part, Amount):
        return ""
    same = (row["true"] for row in truth.rows if row["found"] == finding.known)
    value = next((each for each in same if isinstance(each, float)), None)
    if value is None:
        return ""
    unit = part.display or finding.unit
    return f"{number(convert(value, finding.unit, unit), SHORT)} {pretty_unit(unit)}".rstrip()
