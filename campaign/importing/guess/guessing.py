"""Roles and units of the columns of files, each with what it rests on.

Certain is what a file states. What its numbers suggest is likely, and is marked; sign, side of the
gear, constants, offsets and filters are never guessed. What is wrong with the numbers a plan says.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from campaign.importing.cutting import restarts
from campaign.importing.defects.clock import ticks
from campaign.importing.formats import open_recordings
from campaign.importing.guess import numbers
from campaign.importing.guess.axes import axes
from campaign.importing.guess.columns import Basis, ColumnGuess, Guess, TableGuess
from campaign.importing.guess.names import BY_UNIT, common_path, named
from campaign.importing.guess.relations import Series, with_roles, with_units
from campaign.importing.guess.words import INDEX, TIME, UNKNOWN
from campaign.importing.interface import Array, Column, Table
from campaign.unit_grammar import parse_unit

SAMPLE = 200_000
"""Rows by which is guessed: enough for any motion, and little of a large file."""


def guess(paths: Sequence[Path]) -> Guess:
    """What the files at `paths` may be. Raises RecordingError for those that cannot be read."""
    return Guess(tuple(each for path in paths for each in _of_file(path)))


def _of_file(path: Path) -> Iterator[TableGuess]:
    found, tables = open_recordings(path)
    series = [_beginning(table) for table in tables]
    columns = [_by_names(path, *both) for both in zip(tables, series, strict=True)]
    axis = iter(axes([column for own in columns for column in own]))
    for table, own, values in zip(tables, columns, series, strict=True):
        yield _of_table(path, found.name, table, [replace(c, axis=next(axis)) for c in own], values)


def _beginning(table: Table) -> Series:
    """The first rows of the columns that hold numbers, by their places."""
    places = [k for k, column in enumerate(table.columns) if column.numeric]
    blocks = [np.empty((0, len(places)))]
    reading = table.read(places)
    while sum(map(len, blocks)) < SAMPLE and (block := next(reading, None)) is not None:
        blocks.append(block)
    values = np.concatenate(blocks)[:SAMPLE]
    return {place: values[:, k] for k, place in enumerate(places)}


def _by_names(path: Path, table: Table, series: Series) -> list[ColumnGuess]:
    """What names say, held against the numbers; of a single signal the file's name may be one."""
    path_of_all = common_path([each.name for each in table.columns])
    columns = [_by_name(c, series.get(k), path_of_all) for k, c in enumerate(table.columns)]
    if table.clock is None and len(series) > 1 and all(each.role != TIME for each in columns):
        columns = _with_time(columns, series)
    signals = [k for k in series if columns[k].role not in (TIME, INDEX)]
    for k in signals if len(signals) == 1 else ():
        own = _by_name(replace(table.columns[k], name=path.stem), series[k])
        silent = columns[k].role == UNKNOWN and not columns[k].why
        if own.is_channel and silent and all(map(str.isdigit, columns[k].tag)):
            columns[k] = replace(own, name=columns[k].name, why=f"{own.why}, as the file is called")
    return columns


def _by_name(column: Column, values: Array | None, before: str = "") -> ColumnGuess:
    if values is None:
        return ColumnGuess(column.name, column.place, UNKNOWN, "it holds no numbers")
    found = named(column.name, column.unit, column.place, before)
    known = values[np.isfinite(values)]
    if len(known):
        found = replace(found, low=float(known.min()), high=float(known.max()))
    if found.role in (TIME, INDEX) and not numbers.increases(values):
        return replace(found, role=UNKNOWN, why=f"a name of {found.role}, but it does not increase")
    if found.role != TIME and found.why in ("", BY_UNIT) and numbers.counts(values):
        return replace(found, role=INDEX, why="it counts rows")
    if found.role == TIME and len(known) < len(values):
        return replace(found, doubts=(f"{len(values) - len(known)} of its cells hold no number",))
    return found


def _with_time(columns: list[ColumnGuess], series: Series) -> list[ColumnGuess]:
    """Without any column that is called so, the first that runs like a clock is time.

    Its name says nothing, or it is the first of a matrix: what stands beside it there are signals
    of one axis, and not one of each.
    """
    for place, values in series.items():
        each = columns[place]
        matrix = each.name.endswith(("(1,:)", "(:,1)"))
        if (matrix or (each.role == UNKNOWN and not each.why)) and numbers.evenly(values):
            why = "it increases evenly, by its numbers alone"
            columns[place] = replace(each, role=TIME, why=why)
            begin = each.name[: each.name.rindex("(")] if matrix else None
            return [replace(c, tag=()) if c.name.split("(")[0] == begin else c for c in columns]
    return columns


def _of_table(
    path: Path, form: str, table: Table, columns: list[ColumnGuess], series: Series
) -> TableGuess:
    rows = len(next(iter(series.values()), ()))
    columns, time = _timed(columns, series, table, rows)
    columns = [
        numbers.unit_by_range(c, series[k]) if k in series else c for k, c in enumerate(columns)
    ]
    doubts, step, anew = table.doubts, None, []
    if time is None:
        doubts = (*doubts, "no time is known: state a rate, or which column holds times")
    else:
        anew = restarts(time)
        step = ticks(np.split(time, anew[:1])[0]).step or None
        columns = with_units(with_roles(columns, series, time), series, time)
    return TableGuess(
        path, form, table.name, tuple(columns), rows, step, table.clock is not None, len(anew),
        table.below, tuple(doubts),
    )  # fmt: skip


def _timed(
    columns: list[ColumnGuess], series: Series, table: Table, rows: int
) -> tuple[list[ColumnGuess], Array | None]:
    """The columns with the unit of their times, and those, s; None where nothing tells them."""
    if table.clock is not None:
        return columns, table.clock.start + table.clock.step * np.arange(rows, dtype=np.float64)
    for place in (k for k, each in enumerate(columns) if each.role == TIME):
        each, known = columns[place], np.isfinite(series[place])
        values = np.interp(np.arange(rows), np.flatnonzero(known), series[place][known])
        if each.basis is not Basis.STATED:
            once = np.split(values, restarts(values)[:1])[0]
            each = numbers.likely(each, *numbers.unit_of_time(once))
        if each.unit:
            columns = [*columns[:place], each, *columns[place + 1 :]]
            return columns, (values - values[0]) * float(parse_unit(each.unit).factor)
    return columns, None
