"""Tables in a reader's units: rounded on the page, exact in CSV."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from urllib.parse import quote

from campaign.api.estimate_text import of_unknown_size
from campaign.estimate import Estimate, Origin
from campaign.reason import NONE
from campaign.result import Cell, Column, Table, Value, bare, is_number
from campaign.text import NARROW, SHORT, csv_text, interval, minus, number, pretty_unit
from campaign.units import convert

ROWS = 300
"""Maximum number of rows on the page; the CSV file has all rows."""
FIRST, LISTED = 12, 30
"""A table with more than `LISTED` rows has only the `FIRST` as cells on the page."""
DAGGER = "†"
MARKS = {Origin.MEASURED: "", Origin.CONTRADICTED: f" {DAGGER}"}
"""Suffix of a number by its origin; for other origins the origin itself."""
REASONS = 6
"""Maximum number of reasons for a missing interval below a table."""
UNIT = "unit"
"""Name of a column with the unit of its row."""
CONDITIONS = "conditions"
"""Name of a column with the conditions of its row."""
FEWEST = 3
"""Minimum number of rows for a note on their common content."""
PUBLISHED = "published"
"""Name of the column of published values that the report adds; the last of the CSV file."""
ROUNDING = 1e-12
"""Share of a column's largest number below which a number is a rounding error, shown as 0."""


@dataclass(frozen=True)
class ShownCell:
    """A cell on the page: its text and whether it is a number (right-aligned)."""

    text: str
    number: bool


@dataclass(frozen=True)
class ShownTable:
    """A table as the page shows it.

    `left_out` rows are in the CSV file only. `notes` are sentences on numbers without interval, on
    numbers that are not determined, and on the reasons.
    """

    headers: tuple[str, ...]
    rows: tuple[tuple[ShownCell, ...], ...]
    left_out: int = 0
    notes: tuple[str, ...] = ()

    @property
    def in_cells(self) -> tuple[tuple[ShownCell, ...], ...]:
        """Rows that the page shows as a table; the other rows are in `as_text`."""
        return self.rows if len(self.rows) <= LISTED else self.rows[:FIRST]

    @property
    def as_text(self) -> str:
        """The other rows as aligned lines with tabs between the cells; "" without any."""
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
    """Round the first `ROWS` rows, in display units; `once`: common content moves to a note."""
    rows: Sequence[Mapping[str, Cell]] = table.rows[:ROWS]
    columns = [column for column in table.columns if not column.file_only]
    common: list[str] = []
    if once and len(rows) >= FEWEST:
        common, columns, rows = _said_once(columns, rows)
    shown = [_shown_column(column, rows) for column in columns]
    headers = tuple(
        f"{column.label} ({pretty_unit(column.shown_unit)})" if column.shown_unit else column.label
        for column in columns
    )
    notes = ([f"In all rows: {'; '.join(common)}."] if common else []) + list(remarks(table))
    left_out = len(table.rows) - len(rows)
    return ShownTable(headers, tuple(zip(*shown, strict=True)), left_out, tuple(notes))


def _said_once(
    columns: Sequence[Column], rows: Sequence[Mapping[str, Cell]]
) -> tuple[list[str], list[Column], Sequence[Mapping[str, Cell]]]:
    """Common content of all rows as texts, and the columns and rows without it.

    Common content is words and settings, never results. A common unit moves to the headings of the
    numbers.
    """
    texts: list[str] = []
    unit, kept = "", list(columns[:1])
    for column in columns[1:]:
        cells = [row.get(column.name) for row in rows]
        words = [cell for cell in cells if isinstance(cell, str)]
        if column.name == CONDITIONS and len(words) == len(cells):
            common = set.intersection(*(set(text.split(", ")) for text in words)) - {""}
            texts += [part for part in words[0].split(", ") if part in common]
            rest = [", ".join(p for p in text.split(", ") if p not in common) for text in words]
            rows = [{**row, CONDITIONS: text} for row, text in zip(rows, rest, strict=True)]
            kept += [column] if any(rest) else []
        elif column.name == PUBLISHED or cells[0] in (None, "") or len(set(map(str, cells))) > 1:
            kept.append(column)
        elif column.name == UNIT:
            unit = str(cells[0])
        elif len(words) == len(cells) or (column.exact and not _takes_unit(column, rows)):
            text = _shown_column(column, rows)[0].text
            texts.append(
                " ".join(filter(None, (column.label, text, pretty_unit(column.shown_unit))))
            )
        else:
            kept.append(column)
    if unit:
        kept = [replace(c, unit=unit) if _takes_unit(c, rows) else c for c in kept]
    return texts, kept, rows


def _takes_unit(column: Column, rows: Sequence[Mapping[str, Cell]]) -> bool:
    """Whether the unit of the row applies to a column: its numbers are no counts."""
    cells = [row.get(column.name) for row in rows]
    return not column.shown_unit and any(isinstance(cell, float | Estimate) for cell in cells)


def table_csv(table: Table) -> str:
    """CSV text of all rows, unrounded, in display units that the header names (`error_mrad`).

    Further columns: the ends of each interval with systematic parts (`error_mrad_low`, `_high`),
    the published values, and `NAME_origin` of columns with numbers of a contradicted model.
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
            *(_displayed(bare(row.get(c.name)), c) for c in first),
            *(_displayed(end, c) for c in ends for end in _ends(row.get(c.name))),
            *(_displayed(bare(row.get(c.name)), c) for c in last),
            *(_origin(row.get(c.name)) for c in flagged),
        ]
        for row in table.rows
    )
    return csv_text(headers, rows)


def _origin(cell: Cell) -> str:
    return cell.origin.value if isinstance(cell, Estimate) else ""


def _ends(cell: Cell) -> tuple[float | None, float | None]:
    return cell.combined if isinstance(cell, Estimate) else (None, None)


def remarks(table: Table) -> Iterator[str]:
    """Sentences on numbers without interval, undetermined numbers, and parts in no interval.

    Each reason occurs once, with the columns, the row or the number of rows that it applies to.
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
    cells = (cell for column in table.columns for cell in _numbers(table, column))
    yield from of_unknown_size(cell for cell in cells if isinstance(cell, Estimate))


def _by_reason(
    table: Table, reasons: Callable[[Estimate | float | int, Column], Sequence[str]]
) -> list[str]:
    """`columns (reason)` for each reason, in column order, with its rows if it is not for all."""
    groups: dict[str, dict[str, set[int]]] = {}
    uncertain = [c for c in table.columns if _numbers(table, c) and not c.exact and not c.file_only]
    for column in uncertain:
        for place, cell in _placed(table, column):
            for reason in reasons(cell, column):
                groups.setdefault(reason, {}).setdefault(column.label, set()).add(place)
    every: dict[str, set[int]] = {}
    for column in uncertain:
        every.setdefault(column.label, set()).update(n for n, _ in _placed(table, column))
    return [f"{', '.join(_where(table, of, every))} ({reason})" for reason, of in groups.items()]


def _where(
    table: Table, of: Mapping[str, set[int]], every: Mapping[str, set[int]]
) -> Iterator[str]:
    """Scope of a reason: whole columns, a row by its name, or a number of rows."""
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
    """First cell of a row; "" if it is a number or not unique."""
    names = [row.get(table.columns[0].name) for row in table.rows]
    name = names[place]
    return name if isinstance(name, str) and names.count(name) == 1 else ""


def _placed(table: Table, column: Column) -> Iterator[tuple[int, Estimate | float | int]]:
    """Numeric cells of a column, also undetermined ones, each with the index of its row."""
    for place, row in enumerate(table.rows):
        cell = row.get(column.name)
        if isinstance(cell, Estimate) or is_number(cell):
            yield place, cell


def _numbers(table: Table, column: Column) -> list[Estimate | float | int]:
    """Numeric cells of a column, also undetermined ones."""
    return [cell for _, cell in _placed(table, column)]


def _without_interval(cell: Estimate | float | int, column: Column) -> Sequence[str]:
    # A given number is exact and needs no interval.
    without = (Origin.NOT_DETERMINED, Origin.GIVEN)
    if isinstance(cell, Estimate) and (cell.has_interval or cell.origin in without):
        return ()
    reason = (cell.reason if isinstance(cell, Estimate) else NONE) or column.reason
    return (str(reason),) if reason else ()


def _not_determined(cell: Estimate | float | int, column: Column) -> Sequence[str]:
    if not isinstance(cell, Estimate) or cell.origin is not Origin.NOT_DETERMINED:
        return ()
    reason = cell.reason or column.reason
    return (str(reason),) if reason else ()


def _contradicted(cell: Estimate | float | int, column: Column) -> Sequence[str]:
    if isinstance(cell, Estimate) and cell.origin is Origin.CONTRADICTED:
        return (str(cell.reason),)
    return ()


def data_link(text: str) -> str:
    """A CSV text as a `data:` address, for a download without a second file.

    The text is not in base64: compressed, its length is two thirds.
    """
    return "data:text/csv;charset=utf-8," + quote(text, safe="!$()*+,-./:;=?@_~")


def _displayed(value: Value, column: Column) -> Value:
    if is_number(value) and column.display:
        return float(convert(float(value), column.unit, column.display))
    return value


def _shown_column(column: Column, rows: Sequence[Mapping[str, Cell]]) -> list[ShownCell]:
    """Cells of a column as text; numbers and their missing values are right-aligned."""
    cells = [row.get(column.name) for row in rows]
    values = [_displayed(bare(cell), column) for cell in cells]
    given = [value for value in values if value is not None]
    numbers = [float(value) for value in given if is_number(value)]
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
    """A number with its 95 % interval, or with a mark as bound or not determined."""
    value, low, high = (
        None if end is None else float(str(_displayed(end, column)))
        for end in (cell.value, *cell.combined)
    )
    sign = {"at least": "≥ ", "at most": "≤ "}.get(cell.kind, "")
    if sign:
        value, low, high = (low if high is None else high), None, None
    mark = MARKS.get(cell.origin, f" ({cell.origin})")
    text = number(value, SHORT) if _is_narrow(cell) else interval(value, low, high)
    return f"{sign}{text}{mark}"


def _is_narrow(cell: Cell) -> bool:
    """Whether an interval is too narrow for the shown digits; one of zero width is shown."""
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
    unit = column.shown_unit.replace("%", "percent").replace("^", "").replace("/", " per ")
    words = re.findall(r"\w+", f"{column.name} {unit}")
    return "_".join(words)
