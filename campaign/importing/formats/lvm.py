"""LabVIEW measurement files (`.lvm`): blocks, each with a heading of its own and a clock.

A block has a column of times for all channels, one for each, or none; then time follows from `X0`
and `Delta_X`. What stands in the comment column is no channel. Files that LabVIEW wrote without any
heading are plain text tables.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from campaign.importing.cells import is_number, value_of
from campaign.importing.dialect import Dialect, split
from campaign.importing.interface import (
    Array,
    Clock,
    Column,
    RecordingError,
    RecordingFormat,
    Table,
)
from campaign.importing.rows import blocks, encoding_of_file, lines_of

MARK = "LabVIEW Measurement"
END = "***End_of_Header***"
SEPARATORS = {"tab": "\t", "comma": ",", "semicolon": ";"}
TIMES = "X_Value"


@dataclass
class _Block:
    """A block as its heading tells it; `rows` counts what follows."""

    heading: dict[str, list[str]]
    titles: list[str] = field(default_factory=list)
    first: int = 0
    rows: int = 0


def _tables(path: Path) -> Sequence[Table]:
    encoding = encoding_of_file(path)
    with path.open(encoding=encoding) as file:
        said, found = _blocks(path, lines_of(file, path))
    _check(path, found)
    separator = SEPARATORS.get(said.get("Separator", "Tab").lower(), "\t")
    decimal = said.get("Decimal_Separator", ".")
    if decimal not in (".", ","):
        message = f"Decimal_Separator is {decimal!r}, and not a point or a comma"
        raise RecordingError.of(path, message)
    return [
        table
        for number, block in enumerate(found, start=1)
        for table in _of_block(path, encoding, (separator, decimal), said, block, number)
    ]


def _blocks(path: Path, lines: Iterator[str]) -> tuple[dict[str, str], list[_Block]]:
    """What the file says of itself, and its blocks."""
    said: dict[str, str] = {}
    found: list[_Block] = []
    heading: dict[str, list[str]] = {}
    separator, state = "\t", "file"
    for number, line in enumerate(lines, start=1):
        if number == 1 and "," in line and "\t" not in line:
            separator = ","
        cells = split(line, separator)
        if not any(cells):
            state = "between" if state == "rows" else state
        elif cells[0] == END:
            state, heading = ("between", {}) if state == "file" else ("titles", heading)
        elif state == "file":
            said[cells[0]] = separator.join(cells[1:]).strip(separator)
            if cells[0] == "Separator" and len(cells) > 1:
                separator = SEPARATORS.get(cells[1].lower(), separator)
        elif state == "titles":
            found.append(_Block(heading, cells, number + 1))
            state, heading = "rows", {}
        elif state == "between" and found and not heading and _is_row(cells):
            message = "a row of numbers behind an empty line, which ends a block"
            raise RecordingError.of(path, message, number)
        elif state == "rows" and cells[0] != "Channels":
            found[-1].rows += 1
        else:
            state = "between"
            heading[cells[0]] = cells[1:]
    return said, found


def _check(path: Path, found: Sequence[_Block]) -> None:
    if not found:
        raise RecordingError.of(path, f"no block ended its heading with {END}")
    for block in found:
        if not block.rows:
            raise RecordingError.of(path, "a block without any row", block.first)


def _is_row(cells: Sequence[str]) -> bool:
    given = [cell for cell in cells if cell]
    return bool(given) and all(is_number(cell, ".") or is_number(cell, ",") for cell in given)


def _of_block(
    path: Path,
    encoding: str,
    notation: tuple[str, str],
    said: dict[str, str],
    block: _Block,
    number: int,
) -> Iterator[Table]:
    """The tables of one block: one, but for channels with clocks of their own."""
    separator, decimal = notation
    titles = [title for title in block.titles if title]
    if titles and titles[-1] == "Comment":
        titles.pop()
    width = len(titles)
    dialect = Dialect(
        separator, decimal, block.first, width, tuple(titles), ("",) * width, (True,) * width,
        comments=True,
    )  # fmt: skip
    units = [*block.heading.get("Y_Unit_Label", []), *[""] * width]
    name = f"block {number}"

    def table(places: Sequence[int], first: int, clock: Clock | None, part: str = "") -> Table:
        """Columns of the file at `places`, times first unless a clock tells them."""
        columns = [
            Column(titles[place], units[first + k], f"{name}, column {place + 1}")
            for k, place in enumerate(places if clock else places[1:])
        ]
        if clock is None:
            columns.insert(0, Column("time", "s", f"{name}, column {places[0] + 1}"))
        read = partial(_chosen, path, encoding, dialect, block.rows, places)
        title = f"{name}, {part}" if part else name
        return Table(title, tuple(columns), read, clock, block.rows, said)

    times = said.get("X_Columns", "One").lower()
    if times == "multi":
        for k, place in enumerate(range(0, width - 1, 2)):
            yield table((place, place + 1), k, None, titles[place + 1])
    elif times == "no":
        # The column of times is there all the same, and empty.
        channels = [place for place, title in enumerate(titles) if title != TIMES]
        clocks = _clocks(path, block, decimal, len(channels))
        if len(set(clocks)) == 1:
            yield table(channels, 0, clocks[0])
        else:
            for k, place in enumerate(channels):
                yield table((place,), k, clocks[k], titles[place])
    else:
        yield table(range(width), 0, None)


def _clocks(path: Path, block: _Block, decimal: str, count: int) -> list[Clock]:
    """Start and step of each channel, as the heading states them."""
    try:
        starts, steps = (
            [value_of(cell, decimal) for cell in block.heading[key] if cell][:count]
            for key in ("X0", "Delta_X")
        )
        return [Clock(step, start) for step, start in zip(steps, starts, strict=True)]
    except (KeyError, ValueError):
        message = "the heading of the block above states no X0 and Delta_X of each channel"
        raise RecordingError.of(path, message, block.first) from None


def _chosen(
    path: Path,
    encoding: str,
    dialect: Dialect,
    rows: int,
    of_file: Sequence[int],
    places: Sequence[int],
) -> Iterator[Array]:
    return blocks(path, encoding, dialect, [of_file[place] for place in places], rows)


FORMAT = RecordingFormat(
    "lvm",
    "LabVIEW measurement file",
    (".lvm",),
    lambda head: head.lstrip(b"\xef\xbb\xbf")[:19] == MARK.encode(),
    _tables,
)
