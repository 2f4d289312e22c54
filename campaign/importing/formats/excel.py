"""Excel workbooks (`.xlsx`): each sheet as a text table; needs openpyxl.

Values are those that Excel last computed and stored: a formula that was never computed has none.
Only the first of merged cells holds their text. Dates and times of day become seconds.
"""

from __future__ import annotations

import datetime as dt
import zipfile
from collections.abc import Container, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import replace
from functools import partial
from itertools import islice, zip_longest
from pathlib import Path
from typing import Any

from campaign.importing.cells import is_number, is_unit, plain, value_of
from campaign.importing.dialect import Dialect, read_as
from campaign.importing.interface import (
    LARGEST_PART,
    MOST_UNPACKED,
    Array,
    RecordingError,
    RecordingFormat,
    Table,
    read_by,
)
from campaign.importing.rows import blocks_of, columns_of
from campaign.importing.subprocess_reader import tables_streamed

SAMPLE = 200
"""Number of rows in which the table is located."""
DAY = 86400.0
_OLD = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"
_MOMENTS = (dt.datetime, dt.date, dt.time, dt.timedelta)
_ERRORS = frozenset({"#NULL!", "#DIV/0!", "#VALUE!", "#REF!", "#NAME?", "#NUM!", "#N/A"})
Cells = Sequence[Any]


def tables(path: Path) -> Sequence[Table]:
    """The tables of a workbook, read in this process."""
    with path.open("rb") as file:
        if file.read(len(_OLD)) == _OLD:
            message = "a workbook of Excel 97 to 2003, or its kin: save it as .xlsx"
            raise RecordingError.of(path, message)
    _check_size(path)
    with _opened(path) as book, _opened(path, values=False) as formulas:
        result = [
            t for sheet in book.worksheets for t in _table(path, sheet, formulas[sheet.title])
        ]
    if not result:
        raise RecordingError.of(path, "no sheet of it has a table of numbers")
    return result


def _table(path: Path, sheet: Any, formulas: Any) -> Iterator[Table]:
    """The table of a sheet, if any; `formulas`: the sheet with formulas in place of values."""
    sample = list(islice(_rows(sheet), SAMPLE))
    texts = [[_text(cell) for cell in cells] for cells in sample]
    width = max((k + 1 for cells in texts for k, cell in enumerate(cells) if cell), default=0)
    texts = [[*cells, *[""] * width][:width] for cells in texts]
    start = next((k for k, cells in enumerate(texts) if _is_row(cells)), None)
    match = None if start is None else read_as(list(_lines(_heading(texts, start))), "\t", ".")
    if match is None:
        return
    dialect = replace(match[1], sheet=sheet.title)
    body = [both for cells in sample[dialect.first - 1 :] for both in enumerate(cells)]
    moments = {k for k, cell in body if isinstance(cell, _MOMENTS)}
    commas = sorted({k for k, cell in body if _has_comma(cell)})
    columns = [
        replace(column, unit=column.unit or "s") if k in moments else column
        for k, column in enumerate(columns_of(dialect))
    ]
    doubts: tuple[str, ...] = ()
    if commas:
        names = ", ".join(columns[k].name for k in commas)
        doubts = (f"numbers of {names} are text with a decimal comma",)
    if moments:
        doubts += ("dates and times are kept as days, to some 10 us: steps of it are rounding",)
    _check_formulas(path, dialect, sample, formulas)
    yield Table(sheet.title, tuple(columns), partial(_read, path, dialect, moments), doubts=doubts)


def _read(
    path: Path, dialect: Dialect, moments: Container[int], places: Sequence[int]
) -> Iterator[Array]:
    """Blocks of the columns `places`; `moments`: columns of dates and times."""
    with _opened(path) as book:
        rows = islice(_rows(book[dialect.sheet]), dialect.first - 1, None)
        texts = ([_value(cell, k in moments) for k, cell in enumerate(cells)] for cells in rows)
        padded = ([*cells, *[""] * (dialect.width - len(cells))] for cells in texts)
        lines = (f"{line}\n" for line in _lines(padded, dialect.width))
        yield from blocks_of(lines, path, dialect, places)


def _lines(rows: Iterable[list[str]], width: int = 0) -> Iterator[str]:
    """Rows as tab-separated lines, without blank cells after the last column of the table."""
    for cells in rows:
        while width and len(cells) > width and not cells[-1]:
            cells.pop()
        yield "\t".join(cells) if any(cells) else ""


def _text(cell: Any) -> str:
    """Text of a cell, with a decimal point in numbers."""
    if cell is None or cell in _ERRORS:
        return ""
    if isinstance(cell, _MOMENTS):
        from openpyxl.utils.datetime import to_excel

        return repr(float(to_excel(cell)) * DAY)
    if isinstance(cell, (int, float)):
        return repr(float(cell))
    text = " ".join(plain(str(cell)).split())
    return repr(value_of(text, ",")) if _has_comma(cell) else text


def _value(cell: Any, moment: bool) -> str:
    """Text of a cell in a column of dates (`moment`) or numbers; the other kind is no number."""
    if isinstance(cell, (int, float) if moment else _MOMENTS):
        return f"{cell}, {'no' if moment else 'a'} time"
    return _text(cell)


def _has_comma(cell: Any) -> bool:
    text = plain(cell) if isinstance(cell, str) else ""
    return is_number(text, ",") and not is_number(text, ".")


def _is_row(cells: Sequence[str]) -> bool:
    """Whether at least half of the nonempty cells of a row are numbers."""
    figures = [is_number(cell, ".") for cell in cells if cell]
    return any(figures) and 2 * sum(figures) >= len(figures)


def _heading(rows: list[list[str]], start: int) -> list[list[str]]:
    """The rows, with those above row `start` as a heading: rows of merged cells are combined;
    rows that an empty row separates from the table are removed.
    """
    heading: list[list[str]] = []
    for cells in rows[:start]:
        given = [cell for cell in cells if cell]
        goes_on = 2 * len(given) >= len(cells) > len(given) and not all(map(is_unit, given))
        if not given and start < len(rows):
            heading = [[] for _ in heading]
        elif heading and goes_on and not all(heading[-1]):
            cells = [own or upper for own, upper in zip(cells, heading[-1] or cells, strict=True)]
            heading[-1] = []
        heading.append(cells)
    return [*heading, *rows[start:]]


def _check_size(path: Path) -> None:
    """Raises RecordingError for a file that unpacks to more than the permitted size."""
    with read_by("zipfile", path, "workbook"), zipfile.ZipFile(path) as packed:
        sizes = {each.filename: each.file_size for each in packed.infolist()}
    shared = max((size for name, size in sizes.items() if "sharedStrings" in name), default=0)
    if shared > LARGEST_PART or sum(sizes.values()) > MOST_UNPACKED:
        raise RecordingError.of(
            path, f"it unpacks to {sum(sizes.values()) / 1e9:.3g} GB, which is too much"
        )


@contextmanager
def _opened(path: Path, values: bool = True) -> Iterator[Any]:
    """An open workbook; with formulas in place of their values if `values` is false."""
    with read_by("openpyxl", path, "workbook", "excel"):
        import openpyxl

        book = openpyxl.load_workbook(path, read_only=True, data_only=values, keep_links=False)
        with closing(book):
            yield book


def _rows(sheet: Any) -> Iterator[Cells]:
    sheet.reset_dimensions()  # a file may state any
    rows: Iterator[Cells] = sheet.iter_rows(values_only=True)
    return rows


def _check_formulas(path: Path, dialect: Dialect, sample: Sequence[Cells], formulas: Any) -> None:
    """Raises RecordingError for a formula among the first rows whose value is not in the file."""
    written = islice(_rows(formulas), dialect.first - 1, None)
    both = zip(sample[dialect.first - 1 :], written, strict=False)
    for row, cells in enumerate(both, dialect.first):
        for place, (value, text) in enumerate(zip_longest(*cells)):
            if value is None and isinstance(text, str) and text.startswith("="):
                message = "a formula whose value is not in the file; open and save it in Excel"
                raise RecordingError([dialect.problem(path, row, message, place=place)])


def _recognises(head: bytes) -> bool:
    parts = b"[Content_Types].xml" in head or b"xl/" in head
    return head.startswith(_OLD) or (head.startswith(b"PK\x03\x04") and parts)


FORMAT = RecordingFormat(
    "excel",
    "Excel workbook, by openpyxl",
    (".xlsx", ".xlsm", ".xls"),
    _recognises,
    partial(tables_streamed, __name__),
)
