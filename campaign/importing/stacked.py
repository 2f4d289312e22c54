"""Tables of text that lie in one file below each other, each under the same heading.

Test machines write a table for each step of a procedure, with lines about the step above it.
"""

from __future__ import annotations

import mmap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from campaign.importing.cells import is_lost, is_number, name_and_unit
from campaign.importing.dialect import Dialect, said_above
from campaign.importing.heading import heading
from campaign.importing.rows import encoding_of_file, lines_of

ABOVE = 100
"""Lines above a heading that are kept for what they say."""


@dataclass(frozen=True)
class Block:
    """One of the tables: how it is read, in how many lines, of which so many are rows.

    None of those of a table that goes on to the end of its file.
    """

    dialect: Dialect
    lines: int | None = None
    rows: int | None = None


def stacked(path: Path, dialect: Dialect, sample: Sequence[str]) -> list[Block]:
    """The tables below each other, or the only one, given how the first is read.

    Args:
        sample: the beginning of the file, with the heading of the first.

    Raises RecordingError for what is no text.
    """
    title = _title(dialect, sample)
    again = title and _again(path, title)
    found = list(_blocks(path, dialect, title)) if again else []
    return found if len(found) > 1 else [Block(dialect)]


def _title(dialect: Dialect, sample: Sequence[str]) -> str:
    """The line with the names of the columns; "" where there is none."""
    for line in reversed(sample[: dialect.first - 1]):
        cells = dialect.split(line)
        if dialect.names and [name_and_unit(each)[0] for each in cells][: len(dialect.names)] == [
            *dialect.names
        ]:
            return line.rstrip("\r\n")
    return ""


def _again(path: Path, title: str) -> bool:
    """Whether a line begins as that heading twice; found without reading lines."""
    codec = encoding_of_file(path).removesuffix("-sig")
    if codec.startswith("utf-16"):
        return False
    needle = title.encode(codec)
    with path.open("rb") as raw, mmap.mmap(raw.fileno(), 0, access=mmap.ACCESS_READ) as content:
        first = content.find(needle)
        return first >= 0 and content.find(b"\n" + needle, first) >= 0


def _blocks(path: Path, dialect: Dialect, title: str) -> Iterator[Block]:
    above: list[str] = []
    titles: list[str] = []
    own, first, last, rows = dialect, 0, 0, 0
    for number, line in enumerate(lines_of(path), start=1):
        bare = line.rstrip("\r\n")
        if bare != title and titles and _is_row(dialect, line):
            if not first:
                own, first = _headed(dialect, titles, above, number), number
            last, rows = number, rows + 1
        elif bare == title or (first and bare.strip()):
            if first:
                yield Block(own, last - first + 1, rows)
                above, first, rows = [], 0, 0
            titles = [bare] if bare == title else []
            above += [] if titles else [line]
        elif bare.strip():
            (titles if titles else above).append(bare)
            del above[:-ABOVE]
    if first:
        yield Block(own, last - first + 1, rows)


def _headed(dialect: Dialect, titles: Sequence[str], above: Sequence[str], first: int) -> Dialect:
    """As the first table is read, from another line, with the units and words of its own."""
    names, units, _ = heading([dialect.split(line) for line in titles], len(dialect.numeric))
    alike = len(names) == len(dialect.names)
    return replace(
        dialect,
        first=first,
        units=units if alike else dialect.units,
        said=said_above(above),
    )


def _is_row(dialect: Dialect, line: str) -> bool:
    cells = dialect.split(line)
    if len(cells) != dialect.width:
        return False
    numbers = [c for c, number in zip(cells, dialect.numeric, strict=False) if number]
    known = [is_number(cell, dialect.decimal) for cell in numbers]
    return any(known) and all(k or is_lost(c) for k, c in zip(known, numbers, strict=True))
