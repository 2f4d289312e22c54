"""TwinCAT Scope's text export: rows of facts about each channel, then times beside values.

A column headed `Name` holds times (ms); the channels up to the next such column share them. Columns
of other clocks stand in the same rows and have nothing to do with each other: each clock is a
table.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from campaign.importing.cells import NO_UNIT, is_lost, is_number, is_unit
from campaign.importing.dialect import Dialect, split
from campaign.importing.interface import (
    Array,
    Column,
    RecordingError,
    RecordingFormat,
    Table,
)
from campaign.importing.rows import beginning, blocks, encoding_of_file

NAME = "Name"
SEPARATORS = "\t;,"
LONGEST_HEADING = 200
"""Lines in which the table has to begin."""


def _tables(path: Path) -> Sequence[Table]:
    encoding = encoding_of_file(path)
    with path.open(encoding=encoding) as file:
        lines = beginning(file, path, LONGEST_HEADING)
    separator = next((each for each in SEPARATORS if lines[0].startswith(f"{NAME}{each}")), "\t")
    rows = [split(line, separator) for line in lines]
    headed = next((k for k, cells in enumerate(rows) if k and cells[0] == NAME), None)
    said = {cells[0]: cells[1] for cells in rows[:headed] if len(cells) > 1 and cells[0]}
    if headed is None:
        raise RecordingError.of(path, f"no row of the channels begins with {NAME!r}")
    facts: dict[str, list[str]] = {}
    first = None
    for number, cells in enumerate(rows[headed:], start=headed + 1):
        decimal = _decimal(cells)
        if decimal:
            first = number
            break
        if cells[0]:
            facts[cells[0]] = cells
    if first is None or decimal is None:
        raise RecordingError.of(path, "no row of numbers follows", headed + 1)
    names = facts[NAME]
    width = len(names)
    while width > 1 and not names[width - 1]:
        width -= 1
    dialect = Dialect(
        separator, decimal, first, width, tuple(names[:width]), ("",) * width, (True,) * width,
        comments=True,
    )  # fmt: skip
    return list(_by_clock(path, encoding, dialect, facts, said))


def _decimal(cells: Sequence[str]) -> str | None:
    """The decimal sign of a row of numbers; None for any other row."""
    given = [cell for cell in cells if not is_lost(cell)]
    for decimal in ",.":
        if given and all(is_number(cell, decimal) for cell in given):
            # Without any decimals either will do; times of whole milliseconds say nothing.
            return "," if any("," in cell for cell in given) else "."
    return None


def _by_clock(
    path: Path, encoding: str, dialect: Dialect, facts: dict[str, list[str]], said: dict[str, str]
) -> Iterator[Table]:
    starts = [place for place, name in enumerate(dialect.names) if name == NAME]
    for start, end in zip(starts, [*starts[1:], dialect.width], strict=True):
        places = range(start, end)
        if len(places) < 2:
            continue
        columns = (
            Column("time", "ms", f"column {start + 1}"),
            *(_channel(facts, place) for place in places[1:]),
        )
        read = partial(_rows, path, encoding, dialect, list(places))
        name = "" if len(starts) == 1 else ", ".join(dialect.names[k] for k in places[1:])
        yield Table(name, columns, read, said=_said(facts, said, places[1:]))


def _channel(facts: dict[str, list[str]], place: int) -> Column:
    def fact(name: str) -> str:
        cells = facts.get(name, [])
        return cells[place] if place < len(cells) else ""

    # `Nm (Torque)`: the unit, and what it is of.
    unit = fact("Unit").split(" (")[0].strip()
    usable = unit.lower() not in NO_UNIT and is_unit(unit)
    return Column(fact(NAME), unit if usable else "", f"column {place + 1}")


def _said(
    facts: dict[str, list[str]], said: dict[str, str], places: Sequence[int]
) -> dict[str, str]:
    """What the file says of itself, and of its channels; whether values are scaled is not told."""
    of_channels = {
        f"{row} of {facts[NAME][place]}": cells[place]
        for row, cells in facts.items()
        for place in places
        if row != NAME and place < len(cells) and cells[place]
    }
    return {**said, **of_channels}


def _rows(
    path: Path, encoding: str, dialect: Dialect, of_file: list[int], places: Sequence[int]
) -> Iterator[Array]:
    """A clock that ends before others leaves its cells empty, from there to the end of the file."""
    over, row = False, dialect.first
    for block in blocks(path, encoding, dialect, [of_file[0], *(of_file[p] for p in places)]):
        timed = np.isfinite(block[:, 0])
        count = 0 if over else len(timed) if timed.all() else int(np.argmin(timed))
        left = np.flatnonzero(np.isfinite(block[count:]).any(axis=1))
        if len(left):
            at = row + count + int(left[0])
            message = "values without a time beside them, or after an end of their times"
            raise RecordingError.of(path, message, at)
        over = over or count < len(timed)
        yield block[:count, 1:]
        row += len(block)


def _recognises(head: bytes) -> bool:
    text = head[:4096].decode("utf-8", "replace")
    return text.startswith(("Name\t", "Name;", "Name,")) and "Starttime of export" in text


FORMAT = RecordingFormat(
    "twincat", "text export of TwinCAT Scope", (".csv", ".txt"), _recognises, _tables
)
