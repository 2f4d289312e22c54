"""Tables in a reader's units: few digits on the page, all of them in the CSV file."""

from __future__ import annotations

import base64
import csv
import io
import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from campaign.estimate import Estimate, Origin
from campaign.published.headline import Headline, headline
from campaign.published.scoreboard import Line, Scoreboard, place_columns
from campaign.report.text import interval, minus, number, pretty_unit
from campaign.result import Cell, Column, Table, Value, bare
from campaign.units import convert

ROWS = 300
"""Most rows on the page; the CSV file has them all."""
REASONS = 6
"""Most reasons for a missing interval that stand below a table."""
ROUNDING = 1e-12
"""Share of a column's largest number below which one is a rounding error, shown as 0."""


@dataclass(frozen=True)
class ShownCell:
    """A cell on the page: its text and whether it is a number (those stand right-aligned)."""

    text: str
    number: bool


@dataclass(frozen=True)
class ShownTable:
    """A table as the page shows it; `left_out` rows are in the CSV file only.

    `notes` are sentences: which of its numbers have no interval or are not determined, and why.
    """

    headers: tuple[str, ...]
    rows: tuple[tuple[ShownCell, ...], ...]
    left_out: int = 0
    notes: tuple[str, ...] = ()


def show(table: Table) -> ShownTable:
    """The first `ROWS` rows, rounded to four significant digits, in display units."""
    shown = [_shown_column(column, table.rows[:ROWS]) for column in table.columns]
    rows = tuple(zip(*shown, strict=True))
    headers = tuple(
        f"{column.label} ({pretty_unit(_unit(column))})" if _unit(column) else column.label
        for column in table.columns
    )
    return ShownTable(headers, rows, max(0, len(table.rows) - ROWS), tuple(remarks(table)))


def table_csv(table: Table) -> str:
    """All rows, unrounded, in display units that the header names (`error_mrad`).

    Behind them the ends of each interval, systematic parts included: `error_mrad_low`, `_high`.
    """
    ends = [
        c for c in table.columns if any(isinstance(r.get(c.name), Estimate) for r in table.rows)
    ]
    headers = [_csv_name(column) for column in table.columns]
    headers += [f"{_csv_name(column)}_{end}" for column in ends for end in ("low", "high")]
    rows = (
        [
            *(_exact(_displayed(bare(row.get(c.name)), c)) for c in table.columns),
            *(_exact(_displayed(end, c)) for c in ends for end in _ends(row.get(c.name))),
        ]
        for row in table.rows
    )
    return _csv(headers, rows)


def _ends(cell: Cell) -> tuple[float | None, float | None]:
    return cell.combined if isinstance(cell, Estimate) else (None, None)


def remarks(table: Table) -> Iterator[str]:
    """Sentences: which numbers have no interval, which are not determined, and what is in none.

    Each reason stands there once, with the columns, and in how many of their rows, it is true of.
    """
    for head, reasons in (
        ("Without an interval", _without_interval),
        ("Not determined", _not_determined),
    ):
        pieces = _by_reason(table, reasons)
        if len(pieces) > REASONS:
            more = len(pieces) - REASONS + 1
            pieces = [*pieces[: REASONS - 1], f"and others, for {more} more reasons"]
        if pieces:
            yield f"{head}: {'; '.join(pieces)}."
    sources = dict.fromkeys(
        source for column in table.columns for source in _of_unknown_size(table, column)
    )
    if sources:
        yield f"Of unknown size, and in no interval: {', '.join(sources)}."


def _by_reason(
    table: Table, reasons: Callable[[Estimate | float | int, Column], Sequence[str]]
) -> list[str]:
    """`columns (reason)` for each reason, in the order of the columns."""
    found: dict[str, dict[str, str]] = {}
    uncertain = [c for c in table.columns if _numbers(table, c) and not c.exact]
    for column in uncertain:
        cells = _numbers(table, column)
        told = Counter(reason for cell in cells for reason in reasons(cell, column))
        for reason, count in told.items():
            share = "" if count == len(cells) else f"{count} of {len(cells)} rows: "
            found.setdefault(f"{share}{reason}", {})[column.name] = column.label
    every = {column.name for column in uncertain}
    return [
        f"{'all numbers' if 1 < len(every) == len(of) else ', '.join(of.values())} ({reason})"
        for reason, of in found.items()
    ]


def _numbers(table: Table, column: Column) -> list[Estimate | float | int]:
    """The cells of a column that hold a number, or say why they have none."""
    cells = (row.get(column.name) for row in table.rows)
    return [c for c in cells if isinstance(c, Estimate | float | int) and not isinstance(c, bool)]


def _open(cell: Estimate | float | int) -> bool:
    return isinstance(cell, Estimate) and cell.origin is Origin.NOT_DETERMINED


def _without_interval(cell: Estimate | float | int, column: Column) -> Sequence[str]:
    if isinstance(cell, Estimate) and (cell.has_interval or _open(cell)):
        return ()
    reason = (cell.reason if isinstance(cell, Estimate) else "") or column.reason
    return (reason,) if reason else ()


def _not_determined(cell: Estimate | float | int, column: Column) -> Sequence[str]:
    if not isinstance(cell, Estimate) or not _open(cell):
        return ()
    reason = cell.reason or column.reason
    return (reason,) if reason else ()


def _of_unknown_size(table: Table, column: Column) -> Iterator[str]:
    """The systematic parts that intervals of a column do not have in them."""
    for cell in _numbers(table, column):
        if isinstance(cell, Estimate) and cell.has_interval:
            yield from (p.source for p in cell.systematic if p.standard_uncertainty is None)


def published_csv(lines: Sequence[Line]) -> str:
    """One published table: every cell with what was reproduced, unrounded, and the reason."""
    headers = ("row", "column", "unit", "published", "reproduced", "deviation_percent", "status")
    more = ("reason", "test", "low", "high", "verdict", "source")
    draws = ("place", "place_low", "place_high", "draws")
    rows = (
        (
            line.cell.row,
            line.cell.column,
            line.cell.unit,
            _exact(line.cell.value),
            _exact(line.reproduced),
            _exact(line.deviation),
            "" if line.status is None else str(line.status),
            line.cell.reason,
            line.test,
            _exact(None if line.found is None else line.found.low),
            _exact(None if line.found is None else line.found.high),
            str(line.verdict),
            line.source,
            *place_columns(line),
        )
        for line in lines
    )
    return _csv((*headers, *more, *draws), rows)


def data_link(text: str) -> str:
    """A CSV text as a `data:` address, for a download that needs no second file."""
    return "data:text/csv;charset=utf-8;base64," + base64.b64encode(text.encode()).decode("ascii")


def agreement(scoreboard: Scoreboard) -> str:
    """What the whole scoreboard comes to, in a few sentences; each published value counts once."""
    found = headline(scoreboard)
    if not found.compared:
        return "No published number was measured in this run."
    return " ".join(_sentences(found))


def _sentences(found: Headline) -> Iterator[str]:
    shares = ", ".join(f"{c.status} {c.good} of {c.compared}" for c in found.counts)
    values = "published value" if found.compared == 1 else "published values"
    yield f"{found.compared} {values} compared, each counted once, however often it is printed."
    yield f"Reproduced (they agree, are compatible or meet their claim): {shares}."
    middle, worst = found.median_deviation, found.worst_deviation
    if middle is None or worst is None:
        yield "No deviation among them is of a value that nobody fitted."
    else:
        yield (
            f"Of the {len(found.deviations)} with a deviation that nobody fitted the median is"
            f" {number(middle, 2)} %, the worst {number(worst, 2)} %."
        )
    missed = ", ".join(dict.fromkeys(line.cell.path for line in found.missed))
    if missed:
        yield f"Claims missed: {missed}."
    rest = (
        (len(found.not_reached), "not reached"),
        (len(found.not_found), "not found"),
        (len(found.not_run), "not run"),
    )
    if any(count for count, _ in rest):
        counts = ", ".join(f"{count} {what}" for count, what in rest if count)
        yield f"Besides: {counts}."


def _unit(column: Column) -> str:
    return column.display or column.unit


def _displayed(value: Value, column: Column) -> Value:
    if isinstance(value, int | float) and not isinstance(value, bool) and column.display:
        return float(convert(float(value), column.unit, column.display))
    return value


def _shown_column(column: Column, rows: Sequence[Mapping[str, Cell]]) -> list[ShownCell]:
    """Numbers stand to the right, and so does what is missing among them."""
    cells = [row.get(column.name) for row in rows]
    values = [_displayed(bare(cell), column) for cell in cells]
    given = [value for value in values if value is not None]
    numbers = [float(v) for v in given if isinstance(v, int | float) and not isinstance(v, bool)]
    right = bool(numbers) and len(numbers) == len(given)
    largest = max((abs(v) for v in numbers if math.isfinite(v)), default=0.0)
    return [
        ShownCell(
            _with_interval(cell, column)
            if isinstance(cell, Estimate) and value is not None
            else _text(value, ROUNDING * largest),
            right,
        )
        for cell, value in zip(cells, values, strict=True)
    ]


def _with_interval(cell: Estimate, column: Column) -> str:
    """A number with its 95 % interval, or marked as a bound or as not determined."""
    value, low, high = (
        None if end is None else float(str(_displayed(end, column)))
        for end in (cell.value, *cell.combined)
    )
    sign = {"at least": "≥ ", "at most": "≤ "}.get(cell.kind, "")
    if sign:
        value, low, high = (low if high is None else high), None, None
    mark = "" if cell.origin is Origin.MEASURED else f" ({cell.origin})"
    return f"{sign}{interval(value, low, high)}{mark}"


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
