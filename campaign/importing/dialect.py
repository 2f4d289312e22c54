"""How a text file writes its table: encoding, separator, decimal sign, and where its rows begin.

Nothing is taken for granted of the first line. A way of reading is tried on the end of a sample,
where the rows are, and followed upwards; what is above is heading. The way that makes most of the
rows into numbers is the file's, and a second one that does as well is a doubt for the reader.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import NamedTuple

from campaign.errors import Problem
from campaign.importing.cells import is_lost, is_number, plain
from campaign.importing.heading import heading

SEPARATORS = {"\t": "tab", ";": "semicolon", ",": "comma", "|": "bar", " ": "blanks"}
ENDS = 20
"""Rows at the end of a sample by which a way of reading is judged first."""
_LONGEST_KEY = 60
_ENDS_KEY = ":=\t;,"
_AROUND = " \t;,"
"""Characters that end a key, and those around a value."""


@dataclass(frozen=True)
class Dialect:
    """How a file writes its table.

    Attributes:
        first: line of the first row, from 1.
        width: cells of a row as split; the last may be empty in all of them, and is then no column.
        numeric: for each column, whether its cells are numbers.
        comments: a row may go on after its cells, with words that are no column.
        sheet: of a workbook whose rows are read as lines.
        said: what stands above the heading as `key: value`.
        doubts: other ways of reading that fit as well, in words.
    """

    separator: str
    decimal: str
    first: int
    width: int
    names: tuple[str, ...]
    units: tuple[str, ...]
    numeric: tuple[bool, ...]
    said: dict[str, str] = field(default_factory=dict)
    doubts: tuple[str, ...] = ()
    comments: bool = False
    sheet: str = ""

    @classmethod
    def of_numbers(cls, separator: str, decimal: str, first: int, names: Sequence[str]) -> Dialect:
        """Of a file that says itself how it is written: columns of numbers, then anything."""
        count = len(names)
        some, all_ = ("",) * count, (True,) * count
        return cls(separator, decimal, first, count, tuple(names), some, all_, comments=True)

    def split(self, line: str) -> list[str]:
        return split(line, self.separator)

    def place(self, column: int) -> str:
        """Where a column is, for people."""
        return f"column {_letters(column) if self.sheet else column + 1}"

    def problem(
        self, path: Path, row: int, message: str, line: str = "", place: int = 0
    ) -> Problem:
        """What is wrong with a cell, where a person finds it."""
        if self.sheet:
            return Problem(path, 0, 0, f"{self.sheet}!{_letters(place)}{row}: {message}")
        if self.separator == " ":
            word = list(re.finditer(r"\S+", line))[place : place + 1]
            return Problem(path, row, word[0].start() + 1 if word else 1, message)
        before = line.split(self.separator)[:place]  # of quoted cells about there
        return Problem(path, row, sum(len(cell) + 1 for cell in before) + 1, message)


def _letters(place: int) -> str:
    """A column as Excel names it: 0 is A, 26 is AA."""
    return (_letters(place // 26 - 1) if place >= 26 else "") + chr(ord("A") + place % 26)


def encoding_of(head: bytes, whole: bool) -> str:
    """A codec that decodes a file that begins with `head`; `whole`: there is no more of it."""
    marks = {b"\xef\xbb\xbf": "utf-8-sig", b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}
    for mark, codec in marks.items():
        if head.startswith(mark):
            return codec
    if head[1:2] == b"\0" and head[3:4] == b"\0" and head[:1] != b"\0":
        return "utf-16-le"
    try:
        head.decode("utf-8")
    except UnicodeDecodeError as error:
        # A character cut by the end of the sample is no proof of anything.
        return "utf-8" if not whole and error.start > len(head) - 4 else "cp1252"
    return "utf-8"


def split(line: str, separator: str) -> list[str]:
    """The cells of a line, without the blanks around them."""
    if separator == " ":
        return line.split()
    if '"' in line:
        line = line.strip("\r\n")
        try:
            return [plain(cell) for cell in next(csv.reader([line], delimiter=separator), [])]
        except csv.Error:  # a quote that never ends, or no quote at all
            return [plain(cell) for cell in line.split(separator)]
    return [plain(cell) for cell in line.rstrip("\r\n").split(separator)]


def dialect_of(lines: Sequence[str]) -> Dialect | None:
    """How these lines, the beginning of a file, write their table; None where they hold none."""
    found = [
        each
        for separator in SEPARATORS
        for decimal in ".,"
        if separator != decimal and (each := read_as(lines, separator, decimal)) is not None
    ]
    if not found:
        return None
    found.sort(key=lambda each: each[0], reverse=True)
    fit, best = found[0]
    doubts = (
        f"{_in_words(other)} would fit as well"
        for its, other in found[1:]
        if its[:2] == fit[:2] and _differ(best, other, lines)
    )
    return replace(best, doubts=tuple(islice(doubts, 1)))


class _Fit(NamedTuple):
    """How well a way of reading fits; the larger the better, from first to last."""

    numeric: float
    """Share of the columns that are numbers."""
    rows: int
    titled: bool
    columns: int


def read_as(lines: Sequence[str], separator: str, decimal: str) -> tuple[_Fit, Dialect] | None:
    """What the lines hold when they are read in one way, and how well that fits; None: nothing."""
    rows = [(place, split(line, separator)) for place, line in enumerate(lines) if line.strip()]
    while rows and not _has_number(rows[-1][1], decimal):  # an end mark, such as EOF
        rows.pop()
    if not rows:
        return None
    width = len(rows[-1][1])
    end = rows[-min(ENDS, max(1, len(rows) // 2)) :]
    tail = [cells for _, cells in end if len(cells) == width]
    numeric = [_all_numbers([cells[k] for cells in tail], decimal) for k in range(width)]
    # The last rows may be the only ones of their kind, such as sums: they must be most of the end.
    if not any(numeric) or 2 * len(tail) < len(end):
        return None

    def is_row(cells: Sequence[str]) -> bool:
        return len(cells) == width and all(
            is_number(cell, decimal) or is_lost(cell)
            for cell, number in zip(cells, numeric, strict=True)
            if number
        )

    fits = [is_row(cells) for _, cells in rows]
    # The table begins at the first row that fits, of which most of what follows fits as well: a
    # broken row in between is a broken row, and what is above it no heading.
    begins = (k for k, fit in enumerate(fits) if fit and 2 * sum(fits[k:]) > len(fits) - k)
    start = next(begins, None)
    if start is None:
        return None
    while start and _looks_like_row(rows[start - 1][1], width, decimal):
        start -= 1  # a broken row that would be taken for heading
    body, first = rows[start:], rows[start][0]
    above = [(place, cells) for place, cells in rows if place < first]
    columns = width
    if columns > 1 and all(cells[-1] == "" for _, cells in body if len(cells) == width):
        columns -= 1  # every row ends with a separator
    names, units, used = heading([cells for _, cells in above], columns)
    said = said_above(lines[place] for place, _ in above[: len(above) - used])
    kept = tuple(numeric[:columns])
    found = Dialect(separator, decimal, first + 1, width, names, units, kept, said)
    return _Fit(sum(kept) / columns, sum(fits[start:]), bool(names), sum(kept)), found


def said_above(lines: Iterable[str]) -> dict[str, str]:
    """What lines above a heading say as `key: value`."""
    said: dict[str, str] = {}
    for line in lines:
        text = plain(line).lstrip("#%*/").lstrip()
        end = next((k for k, sign in enumerate(text[: _LONGEST_KEY + 1]) if sign in _ENDS_KEY), 0)
        key, value = text[:end].strip(), text[end + 1 :].strip(_AROUND)
        if key and value:
            said.setdefault(key, value)
    return said


def _looks_like_row(cells: Sequence[str], width: int, decimal: str) -> bool:
    """Whether a line above the table has so many numbers that it is a row of it, and no heading."""
    numbers = sum(is_number(cell, decimal) for cell in cells)
    return len(cells) > 1 and 2 * numbers >= max(len(cells), width)


def _has_number(cells: Sequence[str], decimal: str) -> bool:
    return any(is_number(cell, decimal) for cell in cells)


def _all_numbers(cells: Sequence[str], decimal: str) -> bool:
    return all(is_number(c, decimal) or is_lost(c) for c in cells) and _has_number(cells, decimal)


def _differ(one: Dialect, other: Dialect, lines: Sequence[str]) -> bool:
    """Whether the first row means something else when it is read the other way."""
    line = lines[one.first - 1]
    return (one.split(line), one.decimal) != (other.split(line), other.decimal) and (
        one.split(line) != other.split(line) or any("." in c or "," in c for c in one.split(line))
    )


def _in_words(dialect: Dialect) -> str:
    sign = "comma" if dialect.decimal == "," else "point"
    return f"cells separated by {SEPARATORS[dialect.separator]} with a decimal {sign}"
