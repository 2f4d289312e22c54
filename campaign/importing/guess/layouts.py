"""Which columns make a recording together: of tables that complete each other, and axis by axis.

A file may hold its channels in tables of their own, by their clocks; or several axes side by side,
told apart in the names of their columns. Files whose columns are alike are read alike.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from campaign.importing.guess.columns import ColumnGuess, TableGuess
from campaign.importing.guess.quantities import INDEX, TIME, UNKNOWN

_NO_CHANNELS = (TIME, INDEX, UNKNOWN)


@dataclass(frozen=True)
class Placed:
    """A column, and where it is: its place from 1 in a table of its name, in a file from 1."""

    column: ColumnGuess
    table: str
    place: int
    file: int


@dataclass(frozen=True)
class LayoutGuess:
    """Columns that are read together.

    Attributes:
        name: a key, of letters and digits, of the columns.
        tables: where its columns are.
        several: whether each column has to say its table, or its file where there are several.
        axis: which of several axes of the file it is; "" where there is one.
        known: whether the columns of this name were told with an earlier file.
        files: how many have columns of this name.
    """

    name: str
    tables: tuple[TableGuess, ...]
    columns: tuple[Placed, ...]
    several: bool
    axis: str = ""
    known: bool = False
    files: int = 1

    @property
    def paths(self) -> list[Path]:
        """Of the files that make one recording together."""
        return list(dict.fromkeys(table.file for table in self.tables))


def layouts(tables: Sequence[TableGuess]) -> list[LayoutGuess]:
    """How tables are read, in the order of their files."""
    found: list[LayoutGuess] = []
    for together in _together(tables):
        bare = _slug(together[0].file.stem) or "recording"
        placed = [
            Placed(column, table.name, place, number)
            for number, table in enumerate(together, start=1)
            for place, column in enumerate(table.columns, start=1)
        ]
        for axis, columns in _axis_by_axis(placed):
            layout = LayoutGuess("", together, tuple(columns), len(together) > 1, axis)
            alike = next((k for k, each in enumerate(found) if _alike(each, layout)), None)
            if alike is not None:
                found[alike] = _with_ranges(found[alike], layout)
                found.append(replace(layout, name=found[alike].name, known=True))
                continue
            name = f"{bare}_{_slug(axis)}" if axis and _slug(axis) else bare
            taken = {each.name for each in found}
            numbers = (f"{name}_{number}" for number in range(2, len(taken) + 3))
            free = name if name not in taken else next(n for n in numbers if n not in taken)
            found.append(replace(layout, name=free))
    return found


def _slug(text: str) -> str:
    return re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")


def _alike(one: LayoutGuess, other: LayoutGuess) -> bool:
    """Whether the same columns are read in the same way.

    Within a file each table is its own, but for those of a text file that lie below each other.
    """
    below = one.tables[0].below and other.tables[0].below
    return (
        not one.known
        and (below or one.tables[0].file != other.tables[0].file)
        and _what_is_read(one) == _what_is_read(other)
    )


def _what_is_read(layout: LayoutGuess) -> list[object]:
    found: list[object] = [layout.axis, *(table.clock for table in layout.tables)]
    for each in layout.columns:
        column = each.column
        found += [
            "" if layout.tables[0].below else each.table,
            each.place,
            column.name,
            column.role,
            column.unit,
            column.basis,
        ]
    return found


def _with_ranges(one: LayoutGuess, other: LayoutGuess) -> LayoutGuess:
    """The first, with the ranges of both."""
    columns = tuple(
        replace(
            first,
            column=replace(
                first.column,
                low=min(first.column.low, second.column.low),
                high=max(first.column.high, second.column.high),
            ),
        )
        for first, second in zip(one.columns, other.columns, strict=True)
    )
    return replace(one, columns=columns, files=one.files + 1)


def _together(tables: Sequence[TableGuess]) -> Iterator[tuple[TableGuess, ...]]:
    """Tables of one file that hold different channels, beside each other; others by themselves.

    Files of one signal each, of one length and one clock, are one recording.
    """
    if _one_signal_each(tables):
        yield tuple(tables)
        return
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


def _one_signal_each(tables: Sequence[TableGuess]) -> bool:
    signals = [[c for c in table.columns if c.role not in (TIME, INDEX)] for table in tables]
    known = [(c.role, c.group) for own in signals for c in own if c.role != UNKNOWN]
    clocks = {(*_clock(table), table.rows, table.step) for table in tables}
    return (
        1 < len(tables) == len({table.file for table in tables})
        and all(len(own) == 1 for own in signals)
        and len(known) == len(set(known))
        and len(clocks) == 1
    )


def _channels(table: TableGuess) -> set[tuple[str, str]]:
    return {(each.role, each.group) for each in table.columns if each.role not in _NO_CHANNELS}


def _clock(table: TableGuess) -> tuple[bool, str, str]:
    """How times are found: tables that are read together have columns of one name for them."""
    time = next((each for each in table.columns if each.role == TIME), None)
    return (table.clock, time.name if time else "", time.unit if time else "")


def _axis_by_axis(columns: list[Placed]) -> Iterator[tuple[str, list[Placed]]]:
    """Columns of each axis with those of all; together where there is but one."""
    groups = {each.column.group for each in columns if each.column.role not in _NO_CHANNELS} - {""}
    if len(groups) < 2:
        yield "", columns
        return
    for axis in sorted(groups, key=_naturally):
        yield axis, [each for each in columns if each.column.group in ("", axis)]


def _naturally(text: str) -> list[tuple[int, str]]:
    """Numbers by size: axis 10 comes after axis 2."""
    return [(int(word), "") if word.isdigit() else (-1, word) for word in text.split()]
