"""Columns that form one recording: complementing tables, axis by axis.

A file may hold its channels in tables of their own, or several axes side by side; files of one
signal each hold a recording together. What is read alike shares its `[columns.NAME]`.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from campaign.importing.guess.columns import INDEX, TIME, ColumnGuess, TableGuess

Tables = tuple[TableGuess, ...]
_OF_A_RIG = ("temperature", "normal_load", "gyro_rate", "base_rate")
"""Channels that a rig may well have two of, without a second axis."""


@dataclass(frozen=True)
class PlacedColumn:
    """A column, and where it is: in which of the tables, at which place; both from 1."""

    column: ColumnGuess
    table: int
    place: int


@dataclass(frozen=True)
class Layout:
    """Columns that are read together.

    Attributes:
        name: a key, of letters and digits, of the columns; what is read alike has one.
        tables: where its columns are; of one file, or each of its own.
        axis: which of several axes of the file it is; "" where there is one.
    """

    name: str
    tables: Tables
    columns: tuple[PlacedColumn, ...]
    axis: str

    @property
    def joins_files(self) -> bool:
        """Whether each of its tables is a file of its own."""
        return self.tables[0].file != self.tables[-1].file


def layouts(tables: Sequence[TableGuess]) -> list[Layout]:
    """How tables are read, in the order of their files."""
    names: dict[object, str] = {}
    found = []
    for layout in (each for together in _together(tables) for each in _axis_by_axis(together)):
        read = _what_is_read(layout)
        if read not in names:
            bare = slug(f"{layout.tables[0].file.stem} {layout.axis}") or "recording"
            numbered = (f"{bare}_{number}" for number in range(2, len(names) + 3))
            names[read] = next(n for n in (bare, *numbered) if n not in names.values())
        found.append(replace(layout, name=names[read]))
    return found


def slug(text: str) -> str:
    """As a key of letters and digits."""
    return re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")


def _what_is_read(layout: Layout) -> object:
    """What two layouts that are read alike agree in."""
    # Of one table the name stands in the recording, of several in their columns.
    tables = [(table.clock, len(layout.tables) == 1 or table.name) for table in layout.tables]
    columns = [
        (p.column.name, p.column.role, p.column.unit, p.column.basis) for p in layout.columns
    ]
    return layout.axis, *tables, *columns


def _together(tables: Sequence[TableGuess]) -> Iterator[Tables]:
    """Tables that complete each other: of files of one signal each, or of one file."""
    files = [tuple(t for t in tables if t.file == f) for f in dict.fromkeys(t.file for t in tables)]
    signals = [[c for c in own[0].columns if c.role not in (TIME, INDEX)] for own in files]
    single = len(files) == len(tables) and all(len(each) == 1 for each in signals)
    if single and _complete(tables) and sum(c.is_channel for (c,) in signals) > 1:
        yield tuple(tables)
        return
    for own in files:
        if _complete(own):
            # What holds no channel is not needed; if none does, all is shown.
            yield tuple(table for table in own if _channels(table)) or own
        else:
            yield from ((table,) for table in own)


def _complete(tables: Sequence[TableGuess]) -> bool:
    """Whether they hold no channel twice, on clocks that are told alike."""
    channels = [each for table in tables for each in _channels(table)]
    clocks = {_clock(table) for table in tables}
    return len(tables) > 1 and len(clocks) == 1 and len(set(channels)) == len(channels)


def _channels(table: TableGuess) -> set[tuple[str, str]]:
    return {(each.role, each.axis) for each in table.columns if each.is_channel}


def _clock(table: TableGuess) -> tuple[object, ...]:
    """How times are found: in columns of one name, or by the rows alone."""
    time = next(((c.name, c.unit) for c in table.columns if c.role == TIME), None)
    return table.clock, time or table.rows


def _axis_by_axis(tables: Tables) -> Iterator[Layout]:
    """Columns of each axis with those of all; together where there is but one."""
    columns = tuple(
        PlacedColumn(column, number, place)
        for number, table in enumerate(tables, start=1)
        for place, column in enumerate(table.columns, start=1)
    )
    found = dict.fromkeys(each.column.axis for each in columns if each.column.is_channel)
    axes = list(filter(None, found))
    for axis in axes if len(axes) > 1 else [""]:
        own = tuple(p for p in columns if not axis or p.column.axis in ("", axis))
        yield Layout("", tables, own, axis)


def axes(columns: Sequence[ColumnGuess]) -> list[str]:
    """The axis of each column; "" of those of all.

    Numbers, and the letters x, y and z, name axes where a role has several of them: `q1`, `q2`.
    Words do where two roles have the same ones: `shoulder` and `elbow` with an angle and a rate
    each; of `encoder left` and `encoder right` one alone is no axis.
    """
    moving = [each for each in columns if each.is_channel and each.role not in _OF_A_RIG]
    common = set(moving[0].tag).intersection(*(each.tag for each in moving)) if moving else set()
    keys = [_key(each.tag, common) for each in columns]
    of = {(each.role, _key(each.tag, common)) for each in moving}
    numbered = Counter(role for role, key in of if _is_number(key))
    roles = Counter(key for _, key in of if key and not _is_number(key))
    found = {key for role, key in of if _is_number(key) and numbered[role] > 1}
    words = {key for key, count in roles.items() if count > 1}
    found |= words if len(words) > 1 else set()
    return [key if key in found else "" for key in keys]


def _key(tag: Sequence[str], common: set[str]) -> str:
    """Numbers and letters of a machine's axes, or else the words, that not all columns have."""
    own = [word for word in tag if word not in common]
    return " ".join(filter(_is_number, own)) or " ".join(own)


def _is_number(key: str) -> bool:
    return bool(key) and all(word.isdigit() or word in ("x", "y", "z") for word in key.split())
