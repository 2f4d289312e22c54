"""Key numbers of each test for the first screen."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from campaign.api.analysis import AnalysedTest
from campaign.api.estimate_text import estimate_text
from campaign.api.quantity_words import display_unit
from campaign.axis_kind import axis_terms
from campaign.experiments.post_processing.draws import draws_of
from campaign.experiments.shared.common import short_label
from campaign.experiments.shared.friction_models import model_label
from campaign.published.draws import without_seed
from campaign.published.evidence import concerns
from campaign.published.scoreboard import Line
from campaign.published.status import Status
from campaign.report.content.lines import shown_line
from campaign.report.content.truth import conditions_text
from campaign.report.content.written_units import TestUnits
from campaign.result import Finding, Table, Value
from campaign.text import SHORT, number, pretty_unit, quantity_words
from campaign.units import convert


@dataclass(frozen=True)
class KeyNumber:
    """A key number of a test, as a reader is shown it.

    Attributes:
        quantity: in words.
        where: its conditions, but for those that it shares with the others of its test.
        value: with its interval and unit.
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


def shown_key_numbers(
    test: AnalysedTest, units: TestUnits, lines: Sequence[Line], truth: Table | None
) -> tuple[str, tuple[KeyNumber, ...]]:
    """The conditions that all key numbers of a test share, and the numbers.

    lines: of the scoreboard. truth: the test's table of true values.
    """
    found = test.result.key_numbers
    drawn = len(draws_of(each.trial for each in test.trials)) > 1  # a median is of no seed
    every = [without_seed(f.conditions) if drawn else f.conditions for f in found]
    shared: dict[str, Value] = {}
    if len(found) > 1:
        shared = {n: v for n, v in every[0].items() if all(n in c and c[n] == v for c in every)}
    own = [line for line in lines if line.test == test.name]
    with axis_terms(test.sides):
        numbers = tuple(
            _shown(test, finding, {n: v for n, v in each.items() if n not in shared}, units, truth,
                   *_published(finding, own, test))
            for finding, each in zip(found, every, strict=True)
        )  # fmt: skip
        return _where(shared, units), numbers


def _shown(
    test: AnalysedTest,
    finding: Finding,
    conditions: Mapping[str, Value],
    units: TestUnits,
    truth: Table | None,
    published: str,
    agrees: bool,
) -> KeyNumber:
    display = display_unit(test, finding)
    return KeyNumber(
        quantity_words(finding.quantity),
        _where(conditions, units),
        estimate_text(finding.known, display),
        published,
        agrees,
        _true(finding, display, truth),
    )


def _where(conditions: Mapping[str, Value], units: TestUnits) -> str:
    told = sorted(conditions.items(), key=lambda pair: pair[0] not in WITHOUT_NAME)
    texts = (
        WITHOUT_NAME[name](str(value))
        if name in WITHOUT_NAME
        else conditions_text({name: value}, units)
        for name, value in told
    )
    return ", ".join(filter(None, texts)).replace("_", " ")


def _compensation(name: str) -> str:
    return "without compensation" if name == "none" else short_label(name)


WITHOUT_NAME: dict[str, Callable[[str], str]] = {
    **dict.fromkeys(("component", "direction", "parameter", "statistic"), str),
    "compensation": _compensation,
    "model": model_label,
}
"""Conditions whose value is clear without their name, and what it is called."""


def _published(finding: Finding, lines: Sequence[Line], test: AnalysedTest) -> tuple[str, bool]:
    """What is printed of it, and whether it is reproduced; of doubtful cells nothing."""
    known = test.evidence().known if lines else {}
    for line in lines:
        if line.status is not Status.INCONSISTENT and concerns(finding, line.cell, known):
            shown = shown_line(line)
            return f"{shown.published} {shown.unit}".rstrip(), shown.good
    return "", False


def _true(finding: Finding, display: str, truth: Table | None) -> str:
    """The value beside which the test's own table holds it."""
    rows = () if truth is None else truth.rows
    same = (row["true"] for row in rows if row["found"] == finding.known)
    value = next((each for each in same if isinstance(each, float)), None)
    if value is None:
        return ""
    return f"{number(convert(value, finding.unit, display), SHORT)} {pretty_unit(display)}".rstrip()
