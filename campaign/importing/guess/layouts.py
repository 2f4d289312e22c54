"""Columns that form one recording: complementing tables, axis by axis.

A file may hold each channel in a separate table, or several axes side by side; files of one signal
each may form one recording. Recordings with the same layout share a `[columns.NAME]`.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from campaign.importing.guess.columns import INDEX, TIME, ColumnGuess, TableGuess

Tables = tuple[TableGuess, ...]
_OF_A_RIG = ("temperature", "normal_load", "gyro_rate", "base_rate")
"""Channels that a rig may have twice without a second axis."""


@dataclass(frozen=True)
class PlacedColumn:
    """A column with the numbers of its table and its place, both from 1."""

    column: ColumnGuess
    table: int
    place: int


@dataclass(frozen=True)
class Layout:
    """Columns of one recording.

    Attributes:
        name: key of the columns, letters and digits; equal layouts have the same.
        tables: tables of the columns, all in one file or each in its own.
        axis: the axis, if the file has several; else "".
    """

    name: str
    tables: Tables
    columns: tuple[PlacedColumn, ...]
    axis: str

    @property
    def joins_files(self) -> bool:
        """Whether each table is in its own file."""
        return self.tables[0].file != self.tables[-1].file


def layouts(tables: Sequence[TableGuess]) -> list[Layout]:
    """The layouts of tables, in the order of their files."""
    names: dict[object, str] = {}
    result = []
    for layout in (each for together in _together(tables) for each in _axis_by_axis(together)):
        read = _what_is_read(layout)
        if read not in names:
            bare = slug(f"{layout.tables[0].file.stem} {layout.axis}") or "recording"
            numbered = (f"{bare}_{number}" for number in range(2, len(names) + 3))
            names[read] = next(n for n in (bare, *numbered) if n not in names.values())
        result.append(replace(layout, name=names[read]))
    return result


def slug(text: str) -> str:
    """Text as a key of lower-case letters, digits and _."""
    return re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")


def _what_is_read(layout: Layout) -> object:
    """Key that is equal for layouts with the same `[columns.NAME]`."""
    # The name of a single table is in the recording, names of several are in the columns.
    tables = [(table.clock, len(layout.tables) == 1 or table.name) for table in layout.tables]
    columns = [
        (p.column.name, p.column.role, p.column.unit, p.column.basis) for p in layout.columns
    ]
    return layout.axis, *tables, *columns


def _together(tables: Sequence[TableGuess]) -> Iterator[Tables]:
    """Groups of complementary tables: from files of one signal each, or from one file."""
    files = [tuple(t for t in tables if t.file == f) for f in dict.fromkeys(t.file for t in tables)]
    signals = [[c for c in own[0].columns if c.role not in (TIME, INDEX)] for own in files]
    single = len(files) == len(tables) and all(len(each) == 1 for each in signals)
    if single and _complete(tables) and sum(c.is_channel for (c,) in signals) > 1:
        yield tuple(tables)
        return
    for own in files:
        if _complete(own):
            # Tables without a channel are omitted, unless no table has one.
            yield tuple(table for table in own if _channels(table)) or own
        else:
            yield from ((table,) for table in own)


def _complete(tables: Sequence[TableGuess]) -> bool:
    """Whether several tables have no channel twice and state their clocks in the same way."""
    channels = [each for table in tables for each in _channels(table)]
    clocks = {_clock(table) for table in tables}
    return len(tables) > 1 and len(clocks) == 1 and len(set(channels)) == len(channels)


def _channels(table: TableGuess) -> set[tuple[str, str]]:
    return {(each.role, each.axis) for each in table.columns if each.is_channel}


def _clock(table: TableGuess) -> tuple[object, ...]:
    """Source of the times: the clock and the time column (name, unit), or the number of rows."""
    time = next(((c.name, c.unit) for c in table.columns if c.role == TIME), None)
    return table.clock, time or table.rows


def _axis_by_axis(tables: Tables) -> Iterator[Layout]:
    """A layout for each axis, with the common columns; one layout if there is one axis."""
    columns = tuple(
        PlacedColumn(column, number, place)
        for number, table in enumerate(tables, start=1)
        for place, column in enumerate(table.columns, start=1)
    )
    names = dict.fromkeys(each.column.axis for each in columns if each.column.is_channel)
    axes = list(filter(None, names))
    for axis in axes if len(axes) > 1 else [""]:
        own = tuple(p for p in columns if not axis or p.column.axis in ("", axis))
        yield Layout("", tables, own, axis)


def axes(columns: Sequence[ColumnGuess]) -> list[str]:
    """The axis of each column; "" for common columns.

    Numbers and the letters x, y, z name axes if a role has several of them: `q1`, `q2`. Words name
    axes if two roles share them: `shoulder` and `elbow`, each with an angle and a rate. `encoder
    left` and `encoder right` alone are no axes.
    """
    moving = [each for each in columns if each.is_channel and each.role not in _OF_A_RIG]
    common = set(moving[0].tag).intersection(*(each.tag for each in moving)) if moving else set()
    keys = [_key(each.tag, common) for each in columns]
    of = {(each.role, _key(each.tag, common)) for each in moving}
    numbered = Counter(role for role, key in of if _is_number(key))
    roles = Counter(key for _, key in of if key and not _is_number(key))
    names = {key for role, key in of if _is_number(key) and numbered[role] > 1}
    words = {key for key, count in roles.items() if count > 1}
    names |= words if len(words) > 1 else set()
    return [key if key in names else "" for key in keys]


def _key(tag: Sequence[str], common: set[str]) -> str:
    """Numbers and axis letters of a tag, or else its words, without those of all columns."""
    own = [word for word in tag if word not in common]
    return " ".join(filter(_is_number, own)) or " ".join(own)


def _is_number(key: str) -> bool:
    return bool(key) and all(word.isdigit() or word in ("x", "y", "z") for word in key.split())
