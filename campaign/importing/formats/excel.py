"""Excel workbooks (`.xlsx`): each sheet with a table of numbers; needs openpyxl.

What is read is what Excel last computed and stored: a formula that it never computed has no value.
Of merged cells only the first holds their text. Dates and times of day become seconds.
"""

from __future__ import annotations

import datetime as dt
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from campaign.errors import Problem
from campaign.importing.cells import is_lost, is_number, is_unit, plain, value_of
from campaign.importing.heading import heading
from campaign.importing.interface import (
    LARGEST_PART,
    MOST_UNPACKED,
    ROWS,
    Array,
    Column,
    RecordingError,
    RecordingFormat,
    Table,
)
from campaign.importing.streaming import tables_streamed

SAMPLE = 200
"""Rows by which a table is found."""
DAY = 86400.0
_OLD = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"
_MOMENTS = (dt.datetime, dt.date, dt.time, dt.timedelta)
Cells = Sequence[Any]


@dataclass(frozen=True)
class _Sheet:
    """Where the table of a sheet is, and how its columns are written.

    Attributes:
        first: row of its first numbers, from 1.
        kinds: of each column: `number`, `moment` or `text`.
        decimals: the decimal sign of numbers that are text.
    """

    name: str
    first: int
    names: tuple[str, ...]
    units: tuple[str, ...]
    kinds: tuple[str, ...]
    decimals: tuple[str, ...]


def tables(path: Path) -> Sequence[Table]:
    """The tables of a workbook, in the process that asks."""
    _check_size(path)
    with _opened(path) as book:
        found = [sheet for each in book.worksheets if (sheet := _sheet(path, each)) is not None]
    if not found:
        raise _error(path, "no sheet of it has a table of numbers")
    for sheet in found:
        _check_formulas(path, sheet)
    return [
        Table(
            sheet.name,
            tuple(
                Column(name, unit or ("s" if kind == "moment" else ""), place, kind != "text")
                for name, unit, kind, place in zip(
                    sheet.names,
                    sheet.units,
                    sheet.kinds,
                    (f"column {_letters(k)}" for k in range(len(sheet.names))),
                    strict=True,
                )
            ),
            partial(_read, path, sheet),
            doubts=_doubts(sheet),
        )
        for sheet in found
    ]


def _check_size(path: Path) -> None:
    """A small file may unpack to more than a machine holds."""
    try:
        with zipfile.ZipFile(path) as packed:
            sizes = {each.filename: each.file_size for each in packed.infolist()}
    except (OSError, ValueError, NotImplementedError, zipfile.BadZipFile) as error:
        raise _error(path, f"this workbook cannot be unpacked: {error}") from None
    shared = max((size for name, size in sizes.items() if "sharedStrings" in name), default=0)
    if shared > LARGEST_PART or sum(sizes.values()) > MOST_UNPACKED:
        raise _error(path, f"it unpacks to {sum(sizes.values()) / 1e9:.3g} GB, which is too much")


@contextmanager
def _opened(path: Path, values: bool = True) -> Iterator[Any]:
    """A workbook; with its formulas in place of their values if `values` is false."""
    try:
        import openpyxl
    except ImportError:
        raise _error(path, "Excel files need openpyxl: pip install 'campaign[excel]'") from None
    try:
        book = openpyxl.load_workbook(path, read_only=True, data_only=values, keep_links=False)
        try:
            yield book
        finally:
            book.close()
    except RecordingError:
        raise
    except Exception as error:  # noqa: BLE001 - whatever a broken file leads the library to
        why = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
        raise _error(path, f"this workbook cannot be read ({why[:300]})") from None


def _rows(sheet: Any) -> Iterator[Cells]:
    sheet.reset_dimensions()  # a file may state any
    rows: Iterator[Cells] = sheet.iter_rows(values_only=True)
    return rows


def _sheet(path: Path, sheet: Any) -> _Sheet | None:
    """The table of a sheet; None where it has none."""
    sample = list(islice(_rows(sheet), SAMPLE))
    fits = [_is_row(cells) for cells in sample]
    begins = (k for k, fit in enumerate(fits) if fit and 2 * sum(fits[k:]) > len(fits) - k)
    start = next(begins, None)
    if start is None:
        return None
    body = [cells for cells in sample[start:] if any(cell is not None for cell in cells)]
    width = max(len(cells) for cells in body)
    body = [[*cells, *[None] * (width - len(cells))] for cells in body]
    used = [any(cells[k] is not None for cells in body) for k in range(width)]
    while used and not used[-1]:
        used.pop()
    width = len(used)
    above = [
        [_text(cell) for cell in [*cells, *[None] * width][:width]] for cells in sample[:start]
    ]
    names, units, _ = heading(_filled(above), width)
    columns = [[cells[k] for cells in body] for k in range(width)]
    kinds = tuple(map(_kind, columns))
    names = names or tuple(f"column {_letters(k)}" for k in range(width))
    if all(kind == "text" for kind in kinds):
        return None
    decimals = tuple(map(_decimal, columns))
    return _Sheet(sheet.title, start + 1, names, units, kinds, decimals)


def _filled(above: list[list[str]]) -> list[list[str]]:
    """The heading's rows; one with blanks goes on in the next, where cells are merged."""
    empty = [k for k, cells in enumerate(above) if not any(cells)]
    after = above[empty[-1] + 1 :] if empty else above
    rows = after or [cells for cells in above if any(cells)]  # what is apart is no heading
    found: list[list[str]] = []
    for cells in rows:
        given = [cell for cell in cells if cell]
        goes_on = 2 * len(given) >= len(cells) > len(given) and not all(map(is_unit, given))
        if found and goes_on and not all(found[-1]):
            found[-1] = [own or upper for own, upper in zip(cells, found[-1], strict=True)]
        else:
            found.append(cells)
    return found


def _text(cell: Any) -> str:
    return "" if cell is None else plain(str(cell))


def _is_figure(cell: Any) -> bool:
    return isinstance(cell, (int, float, *_MOMENTS)) or (isinstance(cell, str) and _fits(cell))


def _fits(text: str) -> bool:
    return is_number(plain(text), ".") or is_number(plain(text), ",")


def _is_row(cells: Cells) -> bool:
    given = [cell for cell in cells if cell is not None]
    figures = sum(map(_is_figure, given))
    return figures > 0 and 2 * figures >= len(given)


def _kind(column: Cells) -> str:
    given = [cell for cell in column if cell is not None and not _is_lost(cell)]
    if given and sum(isinstance(cell, _MOMENTS) for cell in given) * 2 > len(given):
        return "moment"
    return "number" if not given or 2 * sum(map(_is_figure, given)) > len(given) else "text"


def _decimal(column: Cells) -> str:
    texts = [plain(cell) for cell in column if isinstance(cell, str) and _fits(cell)]
    return "," if any(not is_number(text, ".") for text in texts) else "."


def _is_lost(cell: Any) -> bool:
    return isinstance(cell, str) and (is_lost(plain(cell)) or cell.startswith("#"))


def _doubts(sheet: _Sheet) -> tuple[str, ...]:
    comma = [name for name, sign in zip(sheet.names, sheet.decimals, strict=True) if sign == ","]
    told = [f"numbers of {', '.join(comma)} are text with a decimal comma"] if comma else []
    if "moment" in sheet.kinds:
        told.append("dates and times are kept as days, to some 10 us: steps of it are rounding")
    return tuple(told)


def _read(path: Path, sheet: _Sheet, places: Sequence[int]) -> Iterator[Array]:
    with _opened(path) as book:
        rows = islice(_rows(book[sheet.name]), sheet.first - 1, None)
        number = sheet.first
        while chunk := list(islice(rows, ROWS)):
            values = [
                [_value(path, sheet, number + k, place, cells) for place in places]
                for k, cells in enumerate(chunk)
                if any(cell is not None for cell in cells)
            ]
            if values:
                yield np.array(values, dtype=np.float64).reshape(-1, len(places))
            number += len(chunk)


def _value(path: Path, sheet: _Sheet, row: int, place: int, cells: Cells) -> float:
    cell = cells[place] if place < len(cells) else None
    moment = isinstance(cell, _MOMENTS)
    if cell is None or _is_lost(cell):
        return float("nan")
    if moment == (sheet.kinds[place] == "moment"):
        if moment:
            from openpyxl.utils.datetime import to_excel

            return float(to_excel(cell)) * DAY
        if isinstance(cell, (int, float)):
            return float(cell)
        if isinstance(cell, str) and is_number(plain(cell), sheet.decimals[place]):
            return value_of(plain(cell), sheet.decimals[place])
    where = f"{sheet.name}!{_letters(place)}{row}"
    kind = "time" if sheet.kinds[place] == "moment" else "number"
    raise _error(path, f"{where}: {str(cell)[:100]!r} is no {kind}, as the rest of its column is")


def _check_formulas(path: Path, sheet: _Sheet) -> None:
    """Raises RecordingError for a formula among the first rows whose value is not in the file."""
    with _opened(path) as book, _opened(path, values=False) as asked:
        told, written = (
            islice(_rows(each[sheet.name]), sheet.first - 1, sheet.first - 1 + SAMPLE)
            for each in (book, asked)
        )
        for row, (values, texts) in enumerate(zip(told, written, strict=False), start=sheet.first):
            for place, text in enumerate(texts):
                value = values[place] if place < len(values) else None
                if value is None and isinstance(text, str) and text.startswith("="):
                    where = f"{sheet.name}!{_letters(place)}{row}"
                    message = f"{where}: a formula whose value is not in the file; open and save it"
                    raise _error(path, f"{message} in Excel")


def _letters(place: int) -> str:
    """A column as Excel names it: 0 is A, 26 is AA."""
    return (_letters(place // 26 - 1) if place >= 26 else "") + chr(ord("A") + place % 26)


def _error(path: Path, message: str) -> RecordingError:
    return RecordingError([Problem(path, 0, 0, message)])


def _tables(path: Path) -> Sequence[Table]:
    with path.open("rb") as file:
        if file.read(len(_OLD)) == _OLD:
            raise _error(path, "a workbook of Excel 97 to 2003, or its kin: save it as .xlsx")
    return tables_streamed(__name__, path)


def _recognises(head: bytes) -> bool:
    parts = b"[Content_Types].xml" in head or b"xl/" in head
    return head.startswith(_OLD) or (head.startswith(b"PK\x03\x04") and parts)


FORMAT = RecordingFormat(
    "excel", "Excel workbook, by openpyxl", (".xlsx", ".xlsm", ".xls"), _recognises, _tables
)
