"""Every number of every kind of experiment has an interval, or says why it has none."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest

from campaign.estimate import Estimate
from campaign.experiments import experiments
from campaign.experiments.interface import Experiment, TestData
from campaign.options import Options
from campaign.result import NO_INTERVAL, NOT_FOUND, Cell, Column, Finding, Result, Table
from tests.experiments.laboratory import MADE_UP, analyse
from tests.experiments.test_channels import CASES, Case, done


def lacking(result: Result) -> list[str]:
    """What has neither interval nor reason: findings by quantity, cells by table and column."""
    return list(dict.fromkeys((*_findings(result), *_cells(result))))


def _findings(result: Result) -> Iterator[str]:
    for finding in result.findings:
        if finding.estimate is None or not finding.estimate.says_enough:
            yield finding.quantity
        elif not _same(finding.estimate, finding):
            yield f"{finding.quantity}: its estimate says another number"


def _same(estimate: Estimate, finding: Finding) -> bool:
    same = estimate.value == finding.value or estimate.value != estimate.value
    return same and estimate.unit == finding.unit


def _cells(result: Result) -> Iterator[str]:
    for table in result.tables:
        for column in table.columns:
            cells = [row.get(column.name) for row in table.rows]
            if not all(_says_enough(cell, column) for cell in cells):
                yield f"{table.key}/{column.name}"
            for row, cell in zip(table.rows, cells, strict=True):
                own = column.unit or column.display  # or else a column of units has it
                unit = column.unit if own else row.get("unit", "")
                if isinstance(cell, Estimate) and cell.unit != unit:
                    yield f"{table.key}/{column.name}: {cell.unit!r} under {unit!r}"


def _says_enough(cell: Cell, column: Column) -> bool:
    if isinstance(cell, Estimate):
        return cell.says_enough
    is_number = isinstance(cell, int | float) and not isinstance(cell, bool)
    return not is_number or column.exact or bool(column.reason)


SWEPT = {"bench.axis.inertia": 35.0, "noisy": True, "day": 3}
"""Of a matrix: numbers that were set stand in tables, too."""


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_every_number_has_an_interval_or_says_why_not(case: Case) -> None:
    swept = [
        replace(item, trial=item.trial.model_copy(update={"point": {**SWEPT, **item.trial.point}}))
        for item in done(case)
    ]
    assert not lacking(analyse(case.kind, swept))


def test_every_kind_is_looked_at() -> None:
    # Nothing executes a motion: `test_motion` and the tests of models look at its numbers.
    recorded = {"motion", "inverse_dynamics", "whole_model"}
    assert {case.kind for case in CASES} | recorded == set(experiments())


BARE = Finding("gain", 2.0, "dB", {})


@pytest.mark.parametrize(
    ("result", "said"),
    [
        (Result(findings=(BARE,)), ["gain"]),
        (Result(findings=(Finding.of(Estimate("gain", 2.0, "dB"), {}),)), ["gain"]),
        (Result(findings=(Finding.of(Estimate("gain", 2.0, "dB", reason=MADE_UP()), {}),)), []),
        (Result(findings=(Finding.of(Estimate("gain", 2.0, "dB", 1.0, 3.0), {}),)), []),
    ],
)
def test_the_walker_sees_what_findings_lack(result: Result, said: list[str]) -> None:
    assert lacking(result) == said


@pytest.mark.parametrize(
    ("column", "cell", "seen"),
    [
        (Column("x", "X"), 1.0, True),
        (Column("x", "X"), 1, True),
        (Column("x", "X", exact=True), 1, False),
        (Column("x", "X", reason=MADE_UP()), 1.0, False),
        (Column("x", "X"), "text", False),
        (Column("x", "X"), None, False),
        (Column("x", "X"), True, False),
        (Column("x", "X"), Estimate("x", 1.0, ""), True),
        (Column("x", "X"), Estimate("x", 1.0, "", reason=MADE_UP()), False),
        (Column("x", "X", "rad"), Estimate("x", 1.0, "deg", reason=MADE_UP()), True),
    ],
)
def test_the_walker_sees_what_cells_lack(column: Column, cell: Cell, seen: bool) -> None:
    result = Result((Table("t", "T", (column,), ({"x": cell},)),))
    assert bool(lacking(result)) is seen


def test_a_finding_of_a_plug_in_may_say_no_more_than_its_value() -> None:
    """Neither an estimate nor `measure`: what a kind of an older plug-in gives."""

    def analyse_plainly(data: TestData) -> Result:
        table = Table("t", "T", (Column("gain", "Gain", "dB"),), ({"gain": 2.0},))
        return Result((table,), findings=(BARE, Finding("lag", float("nan"), "s", {})))

    old = Experiment("old", "of before", Options, lambda options, bench: (), analyse_plainly)
    with experiments().including(old):
        result = analyse("old", ())
    gain, lag = (finding.known for finding in result.findings)
    assert (gain.value, gain.unit, gain.reason) == (2.0, "dB", NO_INTERVAL())
    assert (lag.origin, lag.reason) == ("not determined", NOT_FOUND())
    assert lacking(result) == ["gain", "lag", "t/gain"]
