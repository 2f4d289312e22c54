"""Which columns make a recording together: of tables that complete each other, and axis by axis.

A file may hold its channels in tables of their own, by their clocks; or several axes side by side,
numbered in the names of their columns.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from campaign.importing.guess.guessing import ColumnGuess, TableGuess
from campaign.importing.guess.names import INDEX, TIME, UNKNOWN

_NO_CHANNELS = (TIME, INDEX, UNKNOWN)


@dataclass(frozen=True)
class Placed:
    """A column, and where it is: its place from 1 in a table of its name."""

    column: ColumnGuess
    table: str
    place: int


@dataclass(frozen=True)
class LayoutGuess:
    """Columns that are read together.

    Attributes:
        name: a key, of letters and digits, that no other has.
        tables: where its columns are.
        several: whether each column has to say its table.
    """

    name: str
    tables: tuple[TableGuess, ...]
    columns: tuple[Placed, ...]
    several: bool


def layouts(tables: Sequence[TableGuess]) -> list[LayoutGuess]:
    """How tables are read, in the order of their files."""
    found: list[LayoutGuess] = []
    names: Counter[str] = Counter()
    for together in _together(tables):
        bare = re.sub(r"[^a-z0-9]+", "_", together[0].file.stem.lower()).strip("_") or "recording"
        placed = [
            Placed(column, table.name, place)
            for table in together
            for place, column in enumerate(table.columns, start=1)
        ]
        for columns in _axis_by_axis(placed):
            names[bare] += 1
            name = bare if names[bare] == 1 else f"{bare}_{names[bare]}"
            while any(name == other.name for other in found):
                names[bare] += 1
                name = f"{bare}_{names[bare]}"
            found.append(LayoutGuess(name, together, tuple(columns), len(together) > 1))
    return found


def _together(tables: Sequence[TableGuess]) -> Iterator[tuple[TableGuess, ...]]:
    """Tables of one file that hold different channels, beside each other; others by themselves."""
    for file in dict.fromkeys(table.file for table in tables):
        own = tuple(table for table in tables if table.file == file)
        channels = [_channels(table) for table in own]
        clocks = {_clock(table) for table in own}
        used = [role for roles in channels for role in roles]
        if len(own) > 1 and len(used) == len(set(used)) and len(clocks) == 1:
            # What holds no channel is not needed; if none does, all is shown.
            yield tuple(t for t, roles in zip(own, channels, strict=True) if roles) or own
        else:
            yield from ((table,) for table in own)


def _channels(table: TableGuess) -> set[str]:
    return {each.role for each in table.columns if each.role not in _NO_CHANNELS}


def _clock(table: TableGuess) -> tuple[bool, str, str]:
    """How times are found: tables that are read together have columns of one name for them."""
    time = next((each for each in table.columns if each.role == TIME), None)
    return (table.clock, time.name if time else "", time.unit if time else "")


def _axis_by_axis(columns: list[Placed]) -> Iterator[list[Placed]]:
    """Columns of each axis with those of all; together where there is but one."""
    groups: dict[str, set[str]] = {}
    for each in columns:
        if each.column.role not in _NO_CHANNELS:
            groups.setdefault(each.column.role, set()).add(each.column.group)
    axes = sorted({group for own in groups.values() if len(own) > 1 for group in own if group})
    if len(axes) < 2:
        yield columns
        return
    for axis in axes:
        yield [
            each
            for each in columns
            if each.column.group in ("", axis) or each.column.role in _NO_CHANNELS
        ]
