"""Key numbers of each test as text."""

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
    """A key number of a test, as text.

    Attributes:
        quantity: in words.
        where: its conditions, without those that all key numbers of the test share.
        value: with its interval and unit.
        published: the published value with its unit; "" without one.
        agrees: whether the published value is reproduced.
        true: true value of the simulated bench with its unit, and whether it is outside the
            interval; "" if unknown.
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
    """Shared conditions of a test's key numbers, and the numbers.

    lines: lines of the scoreboard. truth: the test's table of true values.
    """
    findings = test.result.key_numbers
    draws = len(draws_of(each.trial for each in test.trials))
    every = [finding.conditions for finding in findings]
    shared: dict[str, Value] = {}
    if len(findings) > 1:
        shared = {n: v for n, v in every[0].items() if all(n in c and c[n] == v for c in every)}
    wanted = test.experiment.key_numbers if test.experiment else ()
    plain = {pair for each in wanted for pair in each.where.items()}  # not shown: always the same
    own = [line for line in lines if line.test == test.name]
    with axis_terms(test.sides):
        numbers = tuple(
            _shown(test, finding, _where(rest, units), _published(finding, own, test), truth)
            for finding, each in zip(findings, every, strict=True)
            for rest in [{name: v for name, v in each.items() if name not in shared}]
        )
        rest = {name: v for name, v in shared.items() if (name, v) not in plain}
        where = _where(rest, units)
    drawn = f"median of {draws} draws, interval of one further draw" if draws > 1 else ""
    return ", ".join(filter(None, (drawn, where))), numbers


def _shown(
    test: AnalysedTest, finding: Finding, where: str, line: Line | None, truth: Table | None
) -> KeyNumber:
    """Text as in the scoreboard if compared with a published value, else as in the test's tables.

    Thus a verdict stands beside the interval that it is based on.
    """
    quantity = quantity_words(finding.quantity)
    # With several draws, the tables have each number, not the median.
    same = (
        f for f in test.result.findings if (f.quantity, f.unit) == (finding.quantity, finding.unit)
    )
    unit = line.cell.unit if line else display_unit(test, next(same, finding))
    true = _true(finding, unit, truth)
    if line is None:
        return KeyNumber(quantity, where, estimate_text(finding.known, unit), true=true)
    shown = shown_line(line)
    value, published = (
        f"{text} {shown.unit}".rstrip() for text in (shown.reproduced, shown.published)
    )
    return KeyNumber(quantity, where, value, published, shown.good, true)


def _where(conditions: Mapping[str, Value], units: TestUnits) -> str:
    pairs = sorted(conditions.items(), key=lambda pair: pair[0] not in WITHOUT_NAME)
    pairs = [(n, v) for n, v in pairs if SAID_BY.get(n) not in conditions]
    texts = (
        WITHOUT_NAME[name](str(value))
        if name in WITHOUT_NAME
        else conditions_text({name: value}, units)
        for name, value in pairs
    )
    return ", ".join(filter(None, texts)).replace("_", " ")


def _compensation(name: str) -> str:
    return "without compensation" if name == "none" else short_label(name)


WITHOUT_NAME: dict[str, Callable[[str], str]] = {
    **dict.fromkeys(("component", "direction", "statistic"), str),
    "parameter": quantity_words,
    "compensation": _compensation,
    "model": model_label,
}
"""Conditions whose value is clear without their name, with the function for its text."""
SAID_BY = {"bench.gear.preload.torque": "average_friction"}
"""Conditions that repeat the number of another condition."""


def _published(finding: Finding, lines: Sequence[Line], test: AnalysedTest) -> Line | None:
    """Line of the published value of a finding, without inconsistent cells; None without one."""
    known = test.evidence().known if lines else {}
    sound = (line for line in lines if line.status is not Status.INCONSISTENT)
    return next((line for line in sound if concerns(finding, line.cell, known)), None)


def _true(finding: Finding, display: str, truth: Table | None) -> str:
    """True value as text from the row of the finding in `truth`; "" without one."""
    rows = () if truth is None else truth.rows
    for row in rows:
        if row["found"] == finding.known and isinstance(value := row["true"], float):
            text = number(convert(value, finding.unit, display), SHORT)
            outside = " (outside)" if row["inside"] == "no" else ""
            return f"{text} {pretty_unit(display)}".rstrip() + outside
    return ""
