"""CSV, TSV and other text tables, with a detected dialect.

Test machines write one table per step of a procedure, each after lines about that step. Such tables
follow each other in the file, with the same heading.
"""

from __future__ import annotations

import mmap
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from campaign.importing.cells import is_lost, is_number, name_and_unit
from campaign.importing.dialect import SEPARATORS, Dialect, dialect_of, encoding_of, heading
from campaign.importing.interface import HEAD, RecordingError, RecordingFormat, Table
from campaign.importing.rows import beginning, blocks, columns_of, encoding_of_file, lines_of

SAMPLE = 400
"""Number of lines in which the table must begin."""


def tables(path: Path) -> Sequence[Table]:
    """The table of a text file, or its consecutive tables. Raises RecordingError."""
    sample = beginning(path, SAMPLE)
    dialect = dialect_of(sample)
    if dialect is None:
        separators = ", ".join(SEPARATORS.values())
        message = f"no table of numbers, separated by {separators}, was found in it"
        raise RecordingError.of(path, message)
    title = _title(dialect, sample)
    several = _below(path, dialect, title) if title and _again(path, title) else []
    if len(several) > 1:
        return several
    read = partial(blocks, path, dialect)
    return [Table("", columns_of(dialect), read, doubts=dialect.doubts)]


def _title(dialect: Dialect, sample: Sequence[str]) -> str:
    """The line with the names of the columns; "" if there is none."""
    for line in reversed(sample[: dialect.first - 1]):
        cells = dialect.split(line)
        if dialect.names and [name_and_unit(each)[0] for each in cells][: len(dialect.names)] == [
            *dialect.names
        ]:
            return line.rstrip("\r\n")
    return ""


def _again(path: Path, title: str) -> bool:
    """Whether the heading occurs at the start of a second line; searched in the raw bytes."""
    needle = title.encode(encoding_of_file(path).removesuffix("-sig"))
    with path.open("rb") as raw, mmap.mmap(raw.fileno(), 0, access=mmap.ACCESS_READ) as content:
        first = content.find(needle)
        return first >= 0 and content.find(b"\n" + needle, first) >= 0


def _below(path: Path, dialect: Dialect, title: str) -> list[Table]:
    """The consecutive tables, from the dialect of the first and its line of names."""
    result: list[Table] = []
    titles: list[str] = []
    own, first, last = dialect, 0, 0

    def end() -> None:
        if first:
            read = partial(blocks, path, own, rows=last - first + 1)
            name = f"block {len(result) + 1}"
            result.append(Table(name, columns_of(own), read, doubts=dialect.doubts))

    for number, line in enumerate(lines_of(path), start=1):
        bare = line.rstrip("\r\n")
        if bare != title and titles and _is_row(dialect, line):
            if not first:
                own, first = _headed(dialect, titles, number), number
            last = number
        elif bare == title or (first and bare.strip()):
            end()
            first = 0
            titles = [bare] if bare == title else []
        elif titles and bare.strip():
            titles.append(bare)
    end()
    return result


def _headed(dialect: Dialect, titles: Sequence[str], first: int) -> Dialect:
    """The dialect of the first table for a later one, with its first line and its units."""
    names, units = heading([dialect.split(line) for line in titles], len(dialect.numeric))
    units = units if len(names) == len(dialect.names) else dialect.units
    return replace(dialect, first=first, units=units)


def _is_row(dialect: Dialect, line: str) -> bool:
    cells = dialect.split(line)
    if len(cells) != dialect.width:
        return False
    numbers = [c for c, number in zip(cells, dialect.numeric, strict=False) if number]
    known = [is_number(cell, dialect.decimal) for cell in numbers]
    return any(known) and all(k or is_lost(c) for k, c in zip(known, numbers, strict=True))


def _recognises(head: bytes) -> bool:
    text = head.decode(encoding_of(head, whole=len(head) < HEAD), "ignore")
    return "\0" not in text


FORMAT = RecordingFormat(
    "text",
    "a table of text: CSV, TSV, or separated by anything usual",
    (".csv", ".tsv", ".txt", ".dat", ".asc"),
    _recognises,
    tables,
)
