"""Draft roles and units of columns, each with its evidence.

Statements of the file are certain; suggestions of its numbers are marked as likely. Sign, side of
the gear, constants, offsets and filters are never guessed. The plan reports defects of the numbers.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from campaign.channels import MOTOR_ANGLE, RELATIVE_ANGLE, TEMPERATURE
from campaign.importing.defects.clock import restarts, ticks
from campaign.importing.defects.samples import of_channel
from campaign.importing.formats import open_recordings
from campaign.importing.guess.columns import INDEX, TIME, UNKNOWN, Basis, ColumnGuess, TableGuess
from campaign.importing.guess.layouts import axes
from campaign.importing.guess.names import BY_UNIT, common_path, named
from campaign.importing.guess.relations import Series, with_roles, with_units
from campaign.importing.interface import Array, Column, Table
from campaign.unit_grammar import parse_unit

SAMPLE = 200_000
"""Number of examined rows: enough for any motion, and little of a large file."""
_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_THIS_CENTURY = (1e9, 4e9)
"""Times (s) since 1970 in the years 2001 to 2096."""


def guess(paths: Sequence[Path]) -> list[TableGuess]:
    """Guesses for the tables of files. Raises RecordingError for unreadable files."""
    return [each for path in paths for each in _of_file(path)]


def _of_file(path: Path) -> Iterator[TableGuess]:
    form, tables = open_recordings(path)
    series = [_beginning(table) for table in tables]
    columns = [_by_names(path, *both) for both in zip(tables, series, strict=True)]
    axis = iter(axes([column for own in columns for column in own]))
    for table, own, values in zip(tables, columns, series, strict=True):
        yield _of_table(path, form.name, table, [replace(c, axis=next(axis)) for c in own], values)


def _beginning(table: Table) -> Series:
    """The first rows of the numeric columns, by column index."""
    places = [k for k, column in enumerate(table.columns) if column.numeric]
    blocks = [np.empty((0, len(places)))]
    reading = table.read(places)
    while sum(map(len, blocks)) < SAMPLE and (block := next(reading, None)) is not None:
        blocks.append(block)
    values = np.concatenate(blocks)[:SAMPLE]
    return {place: values[:, k] for k, place in enumerate(places)}


def _by_names(path: Path, table: Table, series: Series) -> list[ColumnGuess]:
    """Guesses by names, checked with the numbers; the file's name may name a single signal."""
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
    guess = named(column.name, column.unit, column.place, before)
    known = values[np.isfinite(values)]
    if len(known):
        guess = replace(guess, low=float(known.min()), high=float(known.max()))
    if guess.role in (TIME, INDEX) and not _increases(values):
        return replace(guess, role=UNKNOWN, why=f"a name of {guess.role}, but it does not increase")
    if guess.role != TIME and guess.why in ("", BY_UNIT) and _counts(values):
        return replace(guess, role=INDEX, why="it counts rows")
    if guess.role == TIME and len(known) < len(values):
        return replace(guess, doubts=(f"{len(values) - len(known)} of its cells hold no number",))
    return guess


def _with_time(columns: list[ColumnGuess], series: Series) -> list[ColumnGuess]:
    """The columns with the first one that increases evenly as time; no column is named time.

    Its name is uninformative, or it is the first column of a matrix: the other columns of that
    matrix are signals of one axis, not one per axis.
    """
    for place, values in series.items():
        each = columns[place]
        matrix = each.name.endswith(("(1,:)", "(:,1)"))
        if (matrix or (each.role == UNKNOWN and not each.why)) and _evenly(values):
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
    columns = [_unit_by_range(c, series[k]) if k in series else c for k, c in enumerate(columns)]
    doubts, step, starts = table.doubts, None, []
    if time is None:
        doubts = (*doubts, "no time is known: state a rate, or which column holds times")
    else:
        starts = restarts(time)
        step = ticks(np.split(time, starts[:1])[0]).step or None
        columns = with_units(with_roles(columns, series, time), series, time)
    return TableGuess(
        path, form, table.name, tuple(columns), rows, step, table.clock is not None, len(starts),
        tuple(doubts),
    )  # fmt: skip


def _timed(
    columns: list[ColumnGuess], series: Series, table: Table, rows: int
) -> tuple[list[ColumnGuess], Array | None]:
    """The columns with the unit of their times, and the times (s); None if unknown."""
    if table.clock is not None:
        return columns, table.clock.start + table.clock.step * np.arange(rows, dtype=np.float64)
    for place in (k for k, each in enumerate(columns) if each.role == TIME):
        each, known = columns[place], np.isfinite(series[place])
        values = np.interp(np.arange(rows), np.flatnonzero(known), series[place][known])
        if each.basis is not Basis.STATED:
            once = np.split(values, restarts(values)[:1])[0]
            each = each.likely(*_unit_of_time(once))
        if each.unit:
            columns = [*columns[:place], each, *columns[place + 1 :]]
            return columns, (values - values[0]) * float(parse_unit(each.unit).factor)
    return columns, None


# Evidence from the numbers of one column


def _increases(values: Array) -> bool:
    """Whether a column can hold times: under 1 % of its steps decrease, except at restarts."""
    known = values[np.isfinite(values)]
    parts = [part for part in np.split(known, restarts(known)) if len(part) > 1]
    return bool(parts) and all(p[-1] > p[0] and (np.diff(p) < 0).mean() < 0.01 for p in parts)


def _evenly(values: Array) -> bool:
    """Whether a column increases in equal steps, as clocks do and motions do not."""
    if len(values) < 8 or not np.isfinite(values).all() or not _increases(values):
        return False
    clock = ticks(values)
    return clock.step > 0 and clock.scatter < 0.05 * clock.step


def _counts(values: Array) -> bool:
    """Whether a column counts rows: steps of 1 from 0 or 1."""
    return len(values) > 1 and values[0] in (0.0, 1.0) and bool(np.all(np.diff(values) == 1))


def _unit_of_time(values: Array) -> tuple[str, str]:
    """Likely unit of times and its evidence, from size and usual sampling steps; else "" twice."""
    step = ticks(values).step
    if step <= 0:
        return "", ""
    for unit, seconds in _SECONDS.items():
        if _THIS_CENTURY[0] <= values[0] * seconds < _THIS_CENTURY[1]:
            return unit, "they would be times since 1970"
    whole = step >= 1 and bool(np.all(values == np.round(values)))
    unit = "ms" if whole or step >= 0.5 else "s"
    return unit, f"{step:.4g} apart, {1 / (step * _SECONDS[unit]):.6g} Hz if it is {unit}"


def _unit_by_range(column: ColumnGuess, values: Array) -> ColumnGuess:
    """The column with a likely unit: degC in laboratory range; an angle by its wraparound."""
    known = values[np.isfinite(values)]
    span = column.high - column.low
    if column.basis is not Basis.UNKNOWN or not len(known):
        return column
    if column.role == TEMPERATURE and column.low > -60 and column.high < 220:
        return column.likely("degC", f"it is between {column.low:.4g} and {column.high:.4g}")
    if column.role not in (RELATIVE_ANGLE, MOTOR_ANGLE):
        return column
    for each in of_channel("", values, angle=True):
        if each.kind == "wraparound":
            turns = {round(2 * math.pi, 6): "rad", 360.0: "deg", 1.0: "rev"}
            unit = turns.get(round(each.size, 6), "count")
            return column.likely(unit, f"it begins anew at {each.size:.6g}")
    if span > 20 and np.array_equal(known, np.round(known)):
        return column.likely("count", "whole numbers")
    if column.role == RELATIVE_ANGLE and 8 * math.pi < span <= 720:
        return column.likely("deg", f"in rad it would be {span / (2 * math.pi):.3g} turns")
    return column
