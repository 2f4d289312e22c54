"""TwinCAT Scope text export: channel facts, then times beside values.

A column headed `Name` holds times (ms) of the channels up to the next such column. Columns of
different clocks share rows but are unrelated: each clock is a table.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from campaign.importing.cells import NO_UNIT, is_lost, is_number, is_unit
from campaign.importing.dialect import Dialect, split
from campaign.importing.interface import Array, Column, RecordingError, RecordingFormat, Table
from campaign.importing.rows import beginning, blocks

NAME = "Name"
SEPARATORS = "\t;,"
LONGEST_HEADING = 200
"""Number of lines in which the table must begin."""


def _tables(path: Path) -> Sequence[Table]:
    lines = beginning(path, LONGEST_HEADING)
    separator = next((each for each in SEPARATORS if lines[0].startswith(f"{NAME}{each}")), "\t")
    rows = [split(line, separator) for line in lines]
    headed = next((k for k, cells in enumerate(rows) if k and cells[0] == NAME), None)
    if headed is None:
        raise RecordingError.of(path, f"no row of the channels begins with {NAME!r}")
    first = next((k for k in range(headed, len(rows)) if _decimal(rows[k])), None)
    if first is None:
        raise RecordingError.of(path, "no row of numbers follows", headed + 1)
    names = rows[headed]
    while not names[-1]:
        names.pop()
    facts = {
        cells[0]: [*cells, *[""] * len(names)][: len(names)]
        for cells in rows[headed:first]
        if cells[0]
    }
    dialect = Dialect.of_numbers(separator, _decimal(rows[first]), first + 1, names)
    return list(_by_clock(path, dialect, facts))


def _decimal(cells: Sequence[str]) -> str:
    """The decimal sign of a row of numbers; "" for any other row."""
    given = [cell for cell in cells if not is_lost(cell)]
    # Without decimals, either sign is correct; whole milliseconds give no evidence.
    decimal = "," if any("," in cell for cell in given) else "."
    return decimal if given and all(is_number(cell, decimal) for cell in given) else ""


def _by_clock(path: Path, dialect: Dialect, facts: dict[str, list[str]]) -> Iterator[Table]:
    starts = [place for place, name in enumerate(dialect.names) if name == NAME]
    for start, end in zip(starts, [*starts[1:], dialect.width], strict=True):
        channels = range(start + 1, end)
        if not channels:
            continue
        columns = (
            Column("time", "ms", f"column {start + 1}"),
            *(Column(dialect.names[k], _unit(facts, k), f"column {k + 1}") for k in channels),
        )
        read = partial(_rows, path, dialect, range(start, end))
        name = "" if len(starts) == 1 else ", ".join(dialect.names[k] for k in channels)
        yield Table(name, columns, read)


def _unit(facts: dict[str, list[str]], place: int) -> str:
    """Unit of a channel; `Nm (Torque)` is the unit and its quantity."""
    unit = facts["Unit"][place].split(" (")[0].strip() if "Unit" in facts else ""
    return unit if unit.lower() not in NO_UNIT and is_unit(unit) else ""


def _rows(
    path: Path, dialect: Dialect, among: Sequence[int], places: Sequence[int]
) -> Iterator[Array]:
    """Blocks of a clock; after its end, its cells are empty up to the end of the file."""
    over, row = False, dialect.first
    for block in blocks(path, dialect, [0, *places], among=among):
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
