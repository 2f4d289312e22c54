"""Tables in a reader's units: few digits on the page, all of them in the CSV file."""

from __future__ import annotations

import base64
import csv
import io
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from campaign.published.scoreboard import Line, Scoreboard, Status
from campaign.report.text import minus, number, pretty_unit
from campaign.result import Column, Table, Value
from campaign.units import convert

ROWS = 300
"""Most rows on the page; the CSV file has them all."""
ROUNDING = 1e-12
"""Share of a column's largest number below which one is a rounding error, shown as 0."""


@dataclass(frozen=True)
class ShownCell:
    """A cell on the page: its text and whether it is a number (those stand right-aligned)."""

    text: str
    number: bool


@dataclass(frozen=True)
class ShownTable:
    """A table as the page shows it; `left_out` rows are in the CSV file only."""

    headers: tuple[str, ...]
    rows: tuple[tuple[ShownCell, ...], ...]
    left_out: int = 0


def show(table: Table) -> ShownTable:
    """The first `ROWS` rows, rounded to four significant digits, in display units."""
    shown = [_shown_column(column, table.rows[:ROWS]) for column in table.columns]
    rows = tuple(zip(*shown, strict=True))
    headers = tuple(
        f"{column.label} ({pretty_unit(_unit(column))})" if _unit(column) else column.label
        for column in table.columns
    )
    return ShownTable(headers, rows, max(0, len(table.rows) - ROWS))


def table_csv(table: Table) -> str:
    """All rows, unrounded, in display units that the header names (`error_mrad`)."""
    headers = [_csv_name(column) for column in table.columns]
    rows = ([_exact(_displayed(row.get(c.name), c)) for c in table.columns] for row in table.rows)
    return _csv(headers, rows)


def published_csv(lines: Sequence[Line]) -> str:
    """One published table: every cell with what was reproduced, unrounded, and the reason."""
    headers = ("row", "column", "unit", "published", "reproduced", "deviation_percent", "status")
    rows = (
        (
            line.cell.row,
            line.cell.column,
            line.cell.unit,
            _exact(line.cell.value),
            _exact(line.reproduced),
            _exact(line.deviation),
            str(line.status),
            line.cell.reason,
            line.test,
        )
        for line in lines
    )
    return _csv((*headers, "reason", "test"), rows)


def data_link(text: str) -> str:
    """A CSV text as a `data:` address, for a download that needs no second file."""
    return "data:text/csv;charset=utf-8;base64," + base64.b64encode(text.encode()).decode("ascii")


def agreement(scoreboard: Scoreboard) -> str:
    """One sentence on the whole scoreboard."""
    lines = [line for line in scoreboard.lines if line.status is not Status.INCONSISTENT]
    compared = sorted(abs(line.deviation) for line in lines if line.deviation is not None)
    if not compared:
        return "No published number was measured in this run."
    agreeing = sum(line.agrees is True for line in lines)
    return (
        f"{len(compared)} published numbers compared: the median deviation is"
        f" {number(compared[len(compared) // 2], 2)} %, the worst {number(compared[-1], 2)} %;"
        f" {agreeing} agree to the printed digit or meet the claim."
    )


def _unit(column: Column) -> str:
    return column.display or column.unit


def _displayed(value: Value, column: Column) -> Value:
    if isinstance(value, int | float) and not isinstance(value, bool) and column.display:
        return float(convert(float(value), column.unit, column.display))
    return value


def _shown_column(column: Column, rows: Sequence[Mapping[str, Value]]) -> list[ShownCell]:
    """Numbers stand to the right, and so does what is missing among them."""
    values = [_displayed(row.get(column.name), column) for row in rows]
    given = [value for value in values if value is not None]
    numbers = [float(v) for v in given if isinstance(v, int | float) and not isinstance(v, bool)]
    right = bool(numbers) and len(numbers) == len(given)
    largest = max((abs(v) for v in numbers if math.isfinite(v)), default=0.0)
    return [ShownCell(_text(value, ROUNDING * largest), right) for value in values]


def _text(value: Value, negligible: float) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int):
        return minus(str(value))
    if isinstance(value, float):
        return "0" if abs(value) < negligible else number(value)
    return "–" if value is None else str(value)


def _csv_name(column: Column) -> str:
    unit = _unit(column).replace("%", "percent").replace("^", "").replace("/", " per ")
    words = re.findall(r"\w+", f"{column.name} {unit}")
    return "_".join(words)


def _exact(value: Value) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(float(value)) if isinstance(value, float) else str(value)


def _csv(headers: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(headers)
    writer.writerows(rows)
    return text.getvalue()
