"""Dialect of a text table: encoding, separator, decimal sign, first row.

The first line proves nothing. Each dialect is tried on the end of a sample, where the rows are, and
then upwards; the lines above the rows are the heading. The dialect that makes most of the rows
numbers is selected; a second one that fits as well is a doubt for the user.

Some rows of the heading hold names or units of the columns. Instruments differ: names in the row of
units, channels by number, a key and its value for each column.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice, takewhile
from pathlib import Path

from campaign.errors import Problem
from campaign.importing.cells import (
    is_lost,
    is_number,
    is_unit,
    name_and_unit,
    plain,
    without_brackets,
)

SEPARATORS = {"\t": "tab", ";": "semicolon", ",": "comma", "|": "bar", " ": "blanks"}
ENDS = 20
"""Number of rows at the end of a sample on which a dialect is tried first."""
MOST = 3
"""Maximum number of heading rows about columns: names, units, and one more."""
Heading = tuple[tuple[str, ...], tuple[str, ...]]
"""Names and units."""


@dataclass(frozen=True)
class Dialect:
    """The notation of a text table.

    Attributes:
        first: line of the first row, from 1.
        width: cells of a split row; if the last is empty in all rows, it is no column.
        numeric: for each column, whether its cells are numbers.
        comments: text may follow the cells of a row.
        sheet: sheet of a workbook whose rows are read as lines.
        doubts: other dialects that fit as well, in words.
    """

    separator: str
    decimal: str
    first: int
    width: int
    names: tuple[str, ...]
    units: tuple[str, ...]
    numeric: tuple[bool, ...]
    doubts: tuple[str, ...] = ()
    comments: bool = False
    sheet: str = ""

    @classmethod
    def of_numbers(cls, separator: str, decimal: str, first: int, names: Sequence[str]) -> Dialect:
        """The dialect of a file that states its notation: columns of numbers, then anything."""
        count = len(names)
        some, all_ = ("",) * count, (True,) * count
        return cls(separator, decimal, first, count, tuple(names), some, all_, comments=True)

    def split(self, line: str) -> list[str]:
        return split(line, self.separator)

    def place(self, column: int) -> str:
        """The place of a column, for messages."""
        return f"column {_letters(column) if self.sheet else column + 1}"

    def problem(
        self, path: Path, row: int, message: str, line: str = "", place: int = 0
    ) -> Problem:
        """A problem of a cell, with its place in the file."""
        if self.sheet:
            return Problem(path, 0, 0, f"{self.sheet}!{_letters(place)}{row}: {message}")
        if self.separator == " ":
            word = list(re.finditer(r"\S+", line))[place : place + 1]
            return Problem(path, row, word[0].start() + 1 if word else 1, message)
        before = line.split(self.separator)[:place]  # approximate for quoted cells
        return Problem(path, row, sum(len(cell) + 1 for cell in before) + 1, message)


def _letters(place: int) -> str:
    """A column as Excel names it: 0 is A, 26 is AA."""
    return (_letters(place // 26 - 1) if place >= 26 else "") + chr(ord("A") + place % 26)


def encoding_of(head: bytes, whole: bool) -> str:
    """A codec for a file that begins with `head`; `whole`: `head` is the complete file."""
    marks = {b"\xef\xbb\xbf": "utf-8-sig", b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}
    for mark, codec in marks.items():
        if head.startswith(mark):
            return codec
    if head[1:2] == b"\0" and head[3:4] == b"\0" and head[:1] != b"\0":
        return "utf-16-le"
    try:
        head.decode("utf-8")
    except UnicodeDecodeError as error:
        # A character that the end of the sample cuts is no evidence.
        return "utf-8" if not whole and error.start > len(head) - 4 else "cp1252"
    return "utf-8"


def split(line: str, separator: str) -> list[str]:
    """The cells of a line, without surrounding blanks."""
    if separator == " ":
        return line.split()
    if '"' in line:
        line = line.strip("\r\n")
        try:
            return [plain(cell) for cell in next(csv.reader([line], delimiter=separator), [])]
        except csv.Error:  # an unclosed quote, or a quotation mark as text
            return [plain(cell) for cell in line.split(separator)]
    return [plain(cell) for cell in line.rstrip("\r\n").split(separator)]


def dialect_of(lines: Sequence[str]) -> Dialect | None:
    """The dialect of a table in the first lines of a file; None if they hold no table."""
    fitting = [
        each
        for separator in SEPARATORS
        for decimal in ".,"
        if separator != decimal and (each := read_as(lines, separator, decimal)) is not None
    ]
    if not fitting:
        return None
    fitting.sort(key=lambda each: each[0], reverse=True)
    fit, best = fitting[0]
    doubts = (
        f"{_in_words(other)} would fit as well"
        for its, other in fitting[1:]
        if its[:2] == fit[:2] and _differ(best, other, lines)
    )
    return replace(best, doubts=tuple(islice(doubts, 1)))


def read_as(
    lines: Sequence[str], separator: str, decimal: str
) -> tuple[tuple[float, int, bool, int], Dialect] | None:
    """The quality of one way to read the lines, and its dialect; None if it gives no table.

    The quality is the share of numeric columns, the number of rows, whether there are names, and
    the number of numeric columns; larger is better, compared from first to last.
    """
    rows = [(place, split(line, separator)) for place, line in enumerate(lines) if line.strip()]
    while rows and not _has_number(rows[-1][1], decimal):  # an end mark, such as EOF
        rows.pop()
    if not rows:
        return None
    width = len(rows[-1][1])
    end = rows[-min(ENDS, max(1, len(rows) // 2)) :]
    tail = [cells for _, cells in end if len(cells) == width]
    numeric = [_all_numbers([cells[k] for cells in tail], decimal) for k in range(width)]
    # The last rows may be exceptions, such as sums: rows of their width must be most of the end.
    if not any(numeric) or 2 * len(tail) < len(end):
        return None

    def is_row(cells: Sequence[str]) -> bool:
        return len(cells) == width and all(
            is_number(cell, decimal) or is_lost(cell)
            for cell, number in zip(cells, numeric, strict=True)
            if number
        )

    fits = [is_row(cells) for _, cells in rows]
    # The table begins at the first fitting row after which most rows fit as well: a broken row
    # within the table does not turn the rows above it into a heading.
    begins = (k for k, fit in enumerate(fits) if fit and 2 * sum(fits[k:]) > len(fits) - k)
    start = next(begins, None)
    if start is None:
        return None
    while start and _looks_like_row(rows[start - 1][1], width, decimal):
        start -= 1  # a broken row, no heading
    body, first = rows[start:], rows[start][0]
    columns = width
    if columns > 1 and all(cells[-1] == "" for _, cells in body if len(cells) == width):
        columns -= 1  # every row ends with a separator
    names, units = heading([cells for _, cells in rows[:start]], columns)
    kept = tuple(numeric[:columns])
    dialect = Dialect(separator, decimal, first + 1, width, names, units, kept)
    return (sum(kept) / columns, sum(fits[start:]), bool(names), sum(kept)), dialect


def _looks_like_row(cells: Sequence[str], width: int, decimal: str) -> bool:
    """Whether at least half of the cells of a line are numbers: a row of the table, no heading."""
    numbers = sum(is_number(cell, decimal) for cell in cells)
    return len(cells) > 1 and 2 * numbers >= max(len(cells), width)


def _has_number(cells: Sequence[str], decimal: str) -> bool:
    return any(is_number(cell, decimal) for cell in cells)


def _all_numbers(cells: Sequence[str], decimal: str) -> bool:
    return all(is_number(c, decimal) or is_lost(c) for c in cells) and _has_number(cells, decimal)


def _differ(one: Dialect, other: Dialect, lines: Sequence[str]) -> bool:
    """Whether the first row has another meaning in the other dialect."""
    line = lines[one.first - 1]
    return (one.split(line), one.decimal) != (other.split(line), other.decimal) and (
        one.split(line) != other.split(line) or any("." in c or "," in c for c in one.split(line))
    )


def _in_words(dialect: Dialect) -> str:
    sign = "comma" if dialect.decimal == "," else "point"
    return f"cells separated by {SEPARATORS[dialect.separator]} with a decimal {sign}"


def heading(above: Sequence[list[str]], columns: int) -> Heading:
    """Names and units of columns, from the rows above a table; no names if there are none."""
    near = takewhile(lambda cells: len(cells) in (columns, columns + 1), reversed(above[-MOST:]))
    rows = [cells for cells in reversed(list(near)) if any(cells)]
    paired = _pairs(rows, columns)
    if paired is not None:
        return paired
    # Only the last comment can be a heading, or the last two if the last holds units; comments
    # above are sentences.
    commented = [k for k, cells in enumerate(rows) if cells[0][:1] in ("#", "%")]
    if commented:
        last = commented[-1]
        bare = _unmarked(rows[last])
        named = last - 1 in commented and any(bare) and _all_units(bare)
        rows = rows[last - named :]
    rows = [_unmarked(cells) for cells in rows]
    # A comment mark may be a separate cell. An index without a name or a unit is still a column;
    # such a row is then one cell too long because it ends with a separator.
    marked = [not cells[0] and len(cells) > columns and cells[-1] != "" for cells in rows]
    rows = [cells[m : columns + m] for cells, m in zip(rows, map(int, marked), strict=True)]
    while rows and any(map(_is_any_number, rows[0])) and not _are_channels(rows):
        rows.pop(0)  # a key and its value
    if len(rows) > 1 and _is_key_of_units(rows[0]) and not _all_units(rows[1]):
        names, own = _named(rows[1:], columns)
        keyed = ("", *(without_brackets(cell) for cell in rows[0][1:]))
        return names, tuple(a or b for a, b in zip(own, keyed, strict=True))
    return _named(rows, columns)


def _unmarked(cells: Sequence[str]) -> list[str]:
    """A row without the comment mark, and without the quotes after that mark."""
    bare = cells[0].lstrip("#% ")
    quoted = bare != cells[0] and len(bare) > 1 and bare[0] == bare[-1] == '"'
    return [bare[1:-1] if quoted else bare, *cells[1:]]


def _named(rows: Sequence[list[str]], columns: int) -> Heading:
    named = next((k for k, cells in enumerate(rows) if not _all_units(cells)), None)
    if named is None:
        # A single row in which all cells may be units holds names: t, A, V.
        return tuple(rows[-1]) if len(rows) == 1 else (), ("",) * columns
    split_up = [name_and_unit(cell) for cell in rows[named]]
    names, units = (tuple(each) for each in zip(*split_up, strict=True))
    for cells in rows[named + 1 :]:
        if _all_units(cells):
            below = (without_brackets(cell) for cell in cells)
            units = tuple(own or other for own, other in zip(units, below, strict=True))
        elif cells[0] and is_unit(cells[0]) and all(cells):
            # A unit of time, and names of signals in place of the other units.
            names = (names[0], *cells[1:])
            units = (units[0] or without_brackets(cells[0]), *units[1:])
    return names, units


def _all_units(cells: Sequence[str]) -> bool:
    return all(map(is_unit, cells))


def _is_key_of_units(cells: Sequence[str]) -> bool:
    """`Vertical Units,V,V`: a key, and the units of all columns but the first."""
    return "unit" in cells[0].lower() and _all_units(cells[1:])


def _are_channels(rows: Sequence[list[str]]) -> bool:
    """`x-axis,1,2` above `second,Volt,Volt`: channels by their number."""
    first, *others = rows[0]
    numbers = all(cell.isdigit() and int(cell) < 100 for cell in others)
    return numbers and not _is_any_number(first) and len(rows) > 1 and _all_units(rows[1])


def _pairs(rows: Sequence[list[str]], columns: int) -> Heading | None:
    """`Channel name,"Force",Channel name,"RMV"`: a column of times before each channel."""
    keyed = {
        cells[0].lower(): cells[1:columns:2]
        for cells in rows
        if columns >= 4
        and columns % 2 == 0
        and len(set(cells[0:columns:2])) == 1
        and not _is_any_number(cells[0])
    }
    called = next((cells for key, cells in keyed.items() if "name" in key), None)
    if called is None:
        return None
    units = next((cells for key, cells in keyed.items() if "unit" in key), [""] * len(called))
    usable = [without_brackets(cell) if is_unit(cell) else "" for cell in units]
    return (
        tuple(cell for name in called for cell in ("time", name)),
        tuple(cell for unit in usable for cell in ("", unit)),
    )


def _is_any_number(cell: str) -> bool:
    return is_number(cell, ".") or is_number(cell, ",")
