"""Tables in a reader's units: rounded on the page, exact in CSV."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from urllib.parse import quote

from campaign.axis_kind import in_axis_terms
from campaign.estimate import Estimate, Origin
from campaign.reason import NONE
from campaign.result import Cell, Column, Table, Value, bare
from campaign.text import NARROW, SHORT, interval, minus, number, pretty_unit
from campaign.units import convert

ROWS = 300
"""Most rows on the page; the CSV file has them all."""
FIRST, LISTED = 12, 30
"""Rows of a longer table that are cells on the page, and the rows from which on it is longer."""
DAGGER = "†"
MARKS = {Origin.MEASURED: "", Origin.CONTRADICTED: f" {DAGGER}"}
"""Behind a number, by its origin; of others the origin itself."""
REASONS = 6
"""Most reasons for a missing interval that stand below a table."""
UNIT = "unit"
"""Name of a column that says the unit of its row."""
CONDITIONS = "conditions"
"""Name of a column that lists the conditions of its row."""
FEWEST = 3
"""Rows from which on what all of them say is said once."""
PUBLISHED = "published"
"""Name of a column that the report puts beside those of an analysis: the last of the file."""
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

    @property
    def in_cells(self) -> tuple[tuple[ShownCell, ...], ...]:
        """The rows that a page shows as a table; the others of a long one are `as_text`."""
        return self.rows if len(self.rows) <= LISTED else self.rows[:FIRST]

    @property
    def as_text(self) -> str:
        """The other rows as aligned lines with tabs between the cells; "" where there are none."""
        rows = [[cell.text for cell in row] for row in self.rows[len(self.in_cells) :]]
        wide = [max(map(len, column)) for column in zip(*rows, strict=True)]
        right = [cell.number for cell in self.rows[0]] if rows else []
        lines = (
            "\t".join(
                cell.rjust(width) if number else cell.ljust(width)
                for cell, width, number in zip(row, wide, right, strict=True)
            )
            for row in rows
        )
        return "\n".join((" | ".join(self.headers), *lines)) if rows else ""


def show(table: Table, *, once: bool = True) -> ShownTable:
    """The first `ROWS` rows, rounded, in display units; `once`: what all rows say, said once."""
    rows: Sequence[Mapping[str, Cell]] = table.rows[:ROWS]
    columns = [column for column in table.columns if not column.file_only]
    told: list[str] = []
    if once and len(rows) >= FEWEST:
        told, columns, rows = _said_once(columns, rows)
    shown = [_shown_column(column, rows) for column in columns]
    headers = tuple(
        f"{column.label} ({pretty_unit(_unit(column))})" if _unit(column) else column.label
        for column in columns
    )
    notes = ([f"In all rows: {'; '.join(told)}."] if told else []) + list(remarks(table))
    left_out = len(table.rows) - len(rows)
    return ShownTable(headers, tuple(zip(*shown, strict=True)), left_out, tuple(notes))


def _said_once(
    columns: Sequence[Column], rows: Sequence[Mapping[str, Cell]]
) -> tuple[list[str], list[Column], Sequence[Mapping[str, Cell]]]:
    """What all rows have in common, and the columns and rows without it.

    These are words and what was set, never what was found. A common unit goes to the heads of the
    numbers.
    """
    told: list[str] = []
    unit, kept = "", list(columns[:1])
    for column in columns[1:]:
        cells = [row.get(column.name) for row in rows]
        words = [cell for cell in cells if isinstance(cell, str)]
        if column.name == CONDITIONS and len(words) == len(cells):
            common = set.intersection(*(set(text.split(", ")) for text in words)) - {""}
            told += [part for part in words[0].split(", ") if part in common]
            rest = [", ".join(p for p in text.split(", ") if p not in common) for text in words]
            rows = [{**row, CONDITIONS: text} for row, text in zip(rows, rest, strict=True)]
            kept += [column] if any(rest) else []
        elif column.name == PUBLISHED or cells[0] in (None, "") or len(set(map(str, cells))) > 1:
            kept.append(column)
        elif column.name == UNIT:
            unit = str(cells[0])
        elif len(words) == len(cells) or (column.exact and not _takes_unit(column, rows)):
            text = _shown_column(column, rows)[0].text
            told.append(" ".join(filter(None, (column.label, text, pretty_unit(_unit(column))))))
        else:
            kept.append(column)
    if unit:
        kept = [replace(c, unit=unit) if _takes_unit(c, rows) else c for c in kept]
    return told, kept, rows


def _takes_unit(column: Column, rows: Sequence[Mapping[str, Cell]]) -> bool:
    """Whether the unit of its row is that of a column's numbers: these are no counts."""
    cells = [row.get(column.name) for row in rows]
    return not _unit(column) and any(isinstance(cell, float | Estimate) for cell in cells)


def table_csv(table: Table) -> str:
    """All rows, unrounded, in display units that the header names (`error_mrad`).

    Behind them the ends of each interval, systematic parts included: `error_mrad_low`, `_high`;
    then what is published beside them; last `NAME_origin` of columns with numbers of a model that
    the data contradict.
    """
    ends = [
        c for c in table.columns if any(isinstance(r.get(c.name), Estimate) for r in table.rows)
    ]
    first, last = (
        [c for c in table.columns if (c.name == PUBLISHED) is own] for own in (False, True)
    )
    headers = [_csv_name(column) for column in first]
    headers += [f"{_csv_name(column)}_{end}" for column in ends for end in ("low", "high")]
    headers += [_csv_name(column) for column in last]
    flagged = [c for c in ends if any(_contradicted(cell, c) for cell in _numbers(table, c))]
    headers += [f"{_csv_name(column)}_origin" for column in flagged]
    rows = (
        [
            *(_exact(_displayed(bare(row.get(c.name)), c)) for c in first),
            *(_exact(_displayed(end, c)) for c in ends for end in _ends(row.get(c.name))),
            *(_exact(_displayed(bare(row.get(c.name)), c)) for c in last),
            *(_origin(row.get(c.name)) for c in flagged),
        ]
        for row in table.rows
    )
    return _csv(headers, rows)


def _origin(cell: Cell) -> str:
    return cell.origin.value if isinstance(cell, Estimate) else ""


def _ends(cell: Cell) -> tuple[float | None, float | None]:
    return cell.combined if isinstance(cell, Estimate) else (None, None)


def remarks(table: Table) -> Iterator[str]:
    """Sentences: which numbers have no interval, which are not determined, and what is in none.

    Each reason stands there once, with what it is true of: columns, a row, or how many rows.
    """
    for head, reasons in (
        ("Without an interval", _without_interval),
        ("Not determined", _not_determined),
        (f"{DAGGER} Of a model that the data contradict", _contradicted),
    ):
        pieces = _by_reason(table, reasons)
        if len(pieces) > REASONS:
            more = len(pieces) - REASONS + 1
            pieces = [*pieces[: REASONS - 1], f"and others, for {more} more reasons"]
        if pieces:
            yield f"{head}: {'; '.join(pieces)}."
    if any(_is_narrow(row.get(c.name)) for c in table.columns for row in table.rows[:ROWS]):
        yield (
            "Numbers with five digits and no interval: it is narrower than the last digit; the CSV "
            "file has it."
        )
    sources = dict.fromkeys(
        source for column in table.columns for source in _of_unknown_size(table, column)
    )
    if sources:
        yield f"Not included in the intervals (size unknown): {', '.join(sources)}."


def _by_reason(
    table: Table, reasons: Callable[[Estimate | float | int, Column], Sequence[str]]
) -> list[str]:
    """`columns (reason)` for each reason, in the order of the columns; of some rows, which."""
    found: dict[str, dict[str, set[int]]] = {}
    uncertain = [c for c in table.columns if _numbers(table, c) and not c.exact and not c.file_only]
    for column in uncertain:
        for place, cell in _placed(table, column):
            for reason in reasons(cell, column):
                found.setdefault(reason, {}).setdefault(column.label, set()).add(place)
    every: dict[str, set[int]] = {}
    for column in uncertain:
        every.setdefault(column.label, set()).update(n for n, _ in _placed(table, column))
    return [f"{', '.join(_where(table, of, every))} ({reason})" for reason, of in found.items()]


def _where(
    table: Table, of: Mapping[str, set[int]], every: Mapping[str, set[int]]
) -> Iterator[str]:
    """Where a reason is true: whole columns, a row by its name, or a number of rows."""
    whole = [label for label, rows in of.items() if rows == every[label]]
    if 1 < len(every) == len(whole):
        yield "all numbers"
        return
    yield from whole
    parts: dict[frozenset[int], list[str]] = {}
    for label, rows in of.items():
        if label not in whole:
            parts.setdefault(frozenset(rows), []).append(label)
    for places, labels in parts.items():
        name = _row_name(table, min(places)) if len(places) == 1 else ""
        if name:
            yield name if len(labels) > 1 else f"{labels[0]} of {name}"
        else:
            count = max(len(every[label]) for label in labels)
            yield f"{', '.join(labels)} in {len(places)} of {count} rows"


def _row_name(table: Table, place: int) -> str:
    """What the first cell of a row calls it; "" where that is a number, or other rows have it."""
    names = [row.get(table.columns[0].name) for row in table.rows]
    name = names[place]
    return name if isinstance(name, str) and names.count(name) == 1 else ""


def _placed(table: Table, column: Column) -> Iterator[tuple[int, Estimate | float | int]]:
    """The cells of a column that hold a number, or say why they have none, each with its row."""
    for place, row in enumerate(table.rows):
        cell = row.get(column.name)
        if isinstance(cell, Estimate | float | int) and not isinstance(cell, bool):
            yield place, cell


def _numbers(table: Table, column: Column) -> list[Estimate | float | int]:
    """The cells of a column that hold a number, or say why they have none."""
    return [cell for _, cell in _placed(table, column)]


def _open(cell: Estimate | float | int) -> bool:
    return isinstance(cell, Estimate) and cell.origin is Origin.NOT_DETERMINED


def _given(cell: Estimate) -> bool:
    """Whether it was set, as its cell says: it has no interval because it is not uncertain."""
    return cell.origin is Origin.GIVEN


def _without_interval(cell: Estimate | float | int, column: Column) -> Sequence[str]:
    if isinstance(cell, Estimate) and (cell.has_interval or _open(cell) or _given(cell)):
        return ()
    reason = (cell.reason if isinstance(cell, Estimate) else NONE) or column.reason
    return (str(reason),) if reason else ()


def _not_determined(cell: Estimate | float | int, column: Column) -> Sequence[str]:
    if not isinstance(cell, Estimate) or not _open(cell):
        return ()
    reason = cell.reason or column.reason
    return (str(reason),) if reason else ()


def _contradicted(cell: Estimate | float | int, column: Column) -> Sequence[str]:
    if isinstance(cell, Estimate) and cell.origin is Origin.CONTRADICTED:
        return (str(cell.reason),)
    return ()


def _of_unknown_size(table: Table, column: Column) -> Iterator[str]:
    """The systematic parts that intervals of a column do not have in them."""
    for cell in _numbers(table, column):
        if isinstance(cell, Estimate) and cell.has_interval:
            yield from (
                in_axis_terms(p.source) for p in cell.systematic if p.standard_uncertainty is None
            )


def data_link(text: str) -> str:
    """A CSV text as a `data:` address, for a download that needs no second file.

    As text, not as base64: served compressed, that is two thirds as long.
    """
    return "data:text/csv;charset=utf-8," + quote(text, safe="!$()*+,-./:;=?@_~")


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

    def text(cell: Cell, value: Value) -> str:
        if isinstance(cell, Estimate) and value is not None:
            least = ROUNDING * largest
            if not cell.has_interval and isinstance(value, float) and 0 < abs(value) < least:
                return "0"
            return _with_interval(cell, column)
        if column.name == UNIT and isinstance(value, str):
            return pretty_unit(value)
        return _text(value, ROUNDING * largest, column.decimals)

    return [ShownCell(text(cell, value), right) for cell, value in zip(cells, values, strict=True)]


def _with_interval(cell: Estimate, column: Column) -> str:
    """A number with its 95 % interval, or marked as a bound or as not determined."""
    value, low, high = (
        None if end is None else float(str(_displayed(end, column)))
        for end in (cell.value, *cell.combined)
    )
    sign = {"at least": "≥ ", "at most": "≤ "}.get(cell.kind, "")
    if sign:
        value, low, high = (low if high is None else high), None, None
    mark = MARKS.get(cell.origin, f" ({cell.origin})")
    told = number(value, SHORT) if _is_narrow(cell) else interval(value, low, high)
    return f"{sign}{told}{mark}"


def _is_narrow(cell: Cell) -> bool:
    """Whether an interval is too narrow to be read; one of no width at all is told as such."""
    if not isinstance(cell, Estimate) or not cell.has_interval:
        return False
    return ROUNDING * abs(cell.value) < cell.half_width < NARROW * abs(cell.value)


def _text(value: Value, negligible: float, decimals: int = 0) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int):
        return minus(str(value))
    if isinstance(value, float):
        return "0" if abs(value) < negligible else number(value, decimals=decimals)
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
