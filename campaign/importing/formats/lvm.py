"""LabVIEW measurement files (`.lvm`): blocks with heading and clock.

A block has one column of times for all channels, one for each channel, or none; without one, time
follows from `X0` and `Delta_X`. The comment column is no channel. LabVIEW files without a heading
are plain text tables.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from campaign.importing.cells import is_number, value_of
from campaign.importing.dialect import Dialect, split
from campaign.importing.interface import Clock, Column, RecordingError, RecordingFormat, Table
from campaign.importing.rows import blocks, lines_of

MARK = "LabVIEW Measurement"
END = "***End_of_Header***"
SEPARATORS = {"tab": "\t", "comma": ",", "semicolon": ";"}
TIMES = "X_Value"
_FACT = re.compile(r"([^\t,;]+)([\t,;])(.*)")


@dataclass
class _Block:
    """A block by its heading; `rows` counts the rows after it."""

    name: str
    heading: dict[str, list[str]]
    titles: list[str]
    first: int
    rows: int = 0


def _tables(path: Path) -> Sequence[Table]:
    lines = enumerate(lines_of(path), start=1)
    properties = _said(lines)
    separator = SEPARATORS.get(properties.get("Separator", "Tab").lower(), "\t")
    found_blocks = _blocks(path, lines, separator)
    decimal = properties.get("Decimal_Separator", ".")
    if decimal not in (".", ","):
        message = f"Decimal_Separator is {decimal!r}, and not a point or a comma"
        raise RecordingError.of(path, message)
    if not found_blocks:
        raise RecordingError.of(path, f"no block ended its heading with {END}")
    tables: list[Table] = []
    for block in found_blocks:
        if not block.rows:
            raise RecordingError.of(path, "a block without any row", block.first)
        dialect = Dialect.of_numbers(separator, decimal, block.first, block.titles)
        tables += _of_block(path, dialect, properties, block)
    return tables


def _said(lines: Iterator[tuple[int, str]]) -> dict[str, str]:
    """The properties in the heading of the file."""
    properties: dict[str, str] = {}
    for _, line in lines:
        if line.startswith(END):
            break
        if fact := _FACT.match(line):
            key, separator, value = fact.groups()
            properties[key] = value.strip(f"{separator} ")
    return properties


def _blocks(path: Path, lines: Iterator[tuple[int, str]], separator: str) -> list[_Block]:
    result: list[_Block] = []
    heading: dict[str, list[str]] = {}
    titled = inside = False
    for number, line in lines:
        cells = split(line, separator)
        if not any(cells):
            inside = False
        elif cells[0] == END:
            titled, inside = True, False
        elif titled:
            titles = [title for title in cells if title]
            titles = titles[:-1] if titles[-1] == "Comment" else titles
            result.append(_Block(f"block {len(result) + 1}", heading, titles, number + 1))
            titled, inside, heading = False, True, {}
        elif inside and cells[0] != "Channels":
            result[-1].rows += 1
        elif result and not heading and _is_row(cells):
            message = "a row of numbers behind an empty line, which ends a block"
            raise RecordingError.of(path, message, number)
        else:
            inside = False
            heading[cells[0]] = cells[1:]
    return result


def _is_row(cells: Sequence[str]) -> bool:
    return all(is_number(cell, ".") or is_number(cell, ",") for cell in cells if cell)


def _of_block(path: Path, dialect: Dialect, said: dict[str, str], block: _Block) -> Iterator[Table]:
    """The tables of one block: one for each different clock."""
    titles, times = block.titles, said.get("X_Columns", "One").lower()
    channels = list(range(1, len(titles), 2 if times == "multi" else 1))
    clocks: list[Clock | int] = [0] * len(channels)
    if times == "multi":
        clocks = [place - 1 for place in channels]
    elif times == "no":
        # The column of times exists nevertheless, and is empty.
        channels = [place for place, title in enumerate(titles) if title != TIMES]
        clocks = [*_clocks(path, block, dialect.decimal, len(channels))]
    units = [*block.heading.get("Y_Unit_Label", []), *[""] * len(titles)]
    for clock in dict.fromkeys(clocks):
        own = [k for k, each in enumerate(clocks) if each == clock]
        places = [channels[k] for k in own]
        part = "" if len(own) == len(channels) else f", {', '.join(titles[p] for p in places)}"
        columns = [Column(titles[channels[k]], units[k], _place(block, channels[k])) for k in own]
        if isinstance(clock, int):
            columns.insert(0, Column("time", "s", _place(block, clock)))
            places.insert(0, clock)
        yield Table(
            f"{block.name}{part}",
            tuple(columns),
            partial(blocks, path, dialect, rows=block.rows, among=places),
            clock if isinstance(clock, Clock) else None,
        )


def _place(block: _Block, column: int) -> str:
    return f"{block.name}, column {column + 1}"


def _clocks(path: Path, block: _Block, decimal: str, count: int) -> list[Clock]:
    """Start and step of each channel, from the heading."""
    try:
        starts, steps = (
            [value_of(cell, decimal) for cell in block.heading[key] if cell][:count]
            for key in ("X0", "Delta_X")
        )
        return [Clock(step, start) for step, start in zip(steps, starts, strict=True)]
    except (KeyError, ValueError):
        message = "the heading of the block above states no X0 and Delta_X of each channel"
        raise RecordingError.of(path, message, block.first) from None


FORMAT = RecordingFormat(
    "lvm",
    "LabVIEW measurement file",
    (".lvm",),
    lambda head: head.lstrip(b"\xef\xbb\xbf")[:19] == MARK.encode(),
    _tables,
)
