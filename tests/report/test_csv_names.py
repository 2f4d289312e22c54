"""Names of CSV columns: lower snake case, then the unit, then which end of an interval it is."""

from __future__ import annotations

import ast
import csv
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import campaign
from campaign.cli.model import __file__ as model_command
from campaign.published.scoreboard import COLUMNS
from campaign.report.build import Report
from campaign.report.content.tables import table_csv
from campaign.report.drawing.figure_csv import COLUMNS as OF_FIGURES
from campaign.result import Column, Table

ONE = r"(?:[numkMG]?(?:N|m|rad|s|Hz|A|V|ohm|H|J|W|g|K)|deg|dB|percent|min)[2-4]?"
"""A unit as the SI writes it: its case tells a milli from a mega."""
NAME = re.compile(
    rf"[a-z][a-z0-9]*(?:_[a-z0-9]+)*(?:_(?:1_)?(?:per_)?{ONE}(?:_(?:per_)?{ONE})*)?(?:_(?:low|high|origin))?"
)
ENDS = ("_low", "_high", "_origin")
"""Kept for the ends of intervals."""


def columns() -> Iterator[Column]:
    """Each column that the program's tables may have, as its source states it."""
    for path in sorted(Path(campaign.__file__).parent.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Column":
                texts = [a.value if isinstance(a, ast.Constant) else "" for a in node.args]
                if texts and texts[0] and all(isinstance(text, str) for text in texts[:4]):
                    yield Column(*texts[:4])


@pytest.mark.slow
def test_the_names_of_all_tables_follow_one_rule() -> None:
    found = list(columns())
    assert len(found) > 400
    for column in found:
        (name,) = table_csv(Table("t", "T", (column,), ())).split()
        assert NAME.fullmatch(name), name
        assert not column.name.endswith(ENDS), name


def test_the_files_of_a_report_follow_it_and_repeat_no_name(report: Report) -> None:
    files = [*report.path.parent.glob("tables/*.csv"), *report.path.parent.glob("figures/*.csv")]
    assert len(files) > 5
    for path in files:
        with path.open(encoding="utf-8", newline="") as opened:
            names = next(csv.reader(opened))
        assert len(set(names)) == len(names), path.name
        assert all(NAME.fullmatch(name) for name in names), names


@pytest.mark.parametrize("name", ["Rate", "rate_rad_S", "rate (s)", "_rate", "σ_N_m", "rate__s"])
def test_a_bad_name_would_be_noticed(name: str) -> None:
    assert not NAME.fullmatch(name)


def test_other_files_follow_it() -> None:
    of_models = re.findall(r'"(\w+_(?:s|rad_per_s|rad))"', Path(model_command).read_text())
    assert "rate_rad_per_s" in of_models
    assert all(NAME.fullmatch(name) for name in (*COLUMNS, *OF_FIGURES, *of_models))
