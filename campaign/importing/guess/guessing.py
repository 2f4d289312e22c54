"""Roles and units of the columns of files, each with what it rests on.

Certain is what a file states. What its numbers suggest is likely, and is marked; sign, side of the
gear, constants, offsets and filters are never guessed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from campaign.channels import COMMAND, MOTOR_RATE, RELATIVE_ANGLE, RELATIVE_RATE
from campaign.importing.cutting import restarts
from campaign.importing.defects import Defect, Severity, find
from campaign.importing.defects.clock import ticks
from campaign.importing.guess.axes import axes
from campaign.importing.guess.beside import beside
from campaign.importing.guess.columns import Basis, ColumnGuess, Guess, TableGuess
from campaign.importing.guess.evidence import (
    counts,
    evenly,
    goes_on_anew,
    increases,
    seconds_of,
    stated_rate,
    unit_of_time,
)
from campaign.importing.guess.names import OF_ANYTHING, named
from campaign.importing.guess.quantities import INDEX, TIME, UNKNOWN
from campaign.importing.guess.relations import by_numbers, with_units
from campaign.importing.guess.stated import stated_unit
from campaign.importing.interface import Array, Table
from campaign.importing.opening import open_recordings

SAMPLE = 200_000
"""Rows by which is guessed: enough for any motion, and little of a large file."""


def guess(paths: Sequence[Path]) -> Guess:
    """What the files at `paths` may be. Raises RecordingError for those that cannot be read."""
    return Guess(tuple(each for path in paths for each in _of_file(path)))


@dataclass
class _Looked:
    """A table of which the names were read: its columns, and their values by place."""

    table: Table
    columns: list[ColumnGuess]
    series: dict[int, Array]
    rows: int


def _of_file(path: Path) -> Iterator[TableGuess]:
    found, tables = open_recordings(path)
    looked = [_looked_at(table) for table in tables]
    every = [column for each in looked for column in each.columns]
    groups = iter(axes([(column.role, column.tag) for column in every]))
    for each in looked:
        each.columns = [replace(column, group=next(groups)) for column in each.columns]
        yield _of_table(path, found.name, each)


def _beginning(table: Table, places: Sequence[int]) -> Array:
    blocks: list[Array] = []
    reading = table.read(places)
    while sum(map(len, blocks)) < SAMPLE and (block := next(reading, None)) is not None:
        blocks.append(block)
    return np.concatenate(blocks)[:SAMPLE] if blocks else np.empty((0, len(places)))


def _looked_at(table: Table) -> _Looked:
    places = [k for k, column in enumerate(table.columns) if column.numeric]
    values = _beginning(table, places)
    series = {place: values[:, k] for k, place in enumerate(places)}
    columns = [_by_name(table, place, series.get(place)) for place in range(len(table.columns))]
    return _Looked(table, _one_time(beside(columns), series, table), series, len(values))


def _of_table(path: Path, format_name: str, looked: _Looked) -> TableGuess:
    table, columns, series = looked.table, looked.columns, looked.series
    time, step = _time(columns, series, table)
    doubts = list(table.doubts)
    anew = 0 if time is None else len(restarts(time))
    if time is None:
        doubts.append("no time is known: state a rate, or which column holds times")
    else:
        columns = with_units(by_numbers(columns, series, time), series, time)
        once = slice(0, next(iter(restarts(time)), None))
        first = {place: values[once] for place, values in series.items()}
        doubts += _defects(columns, first, time[once])
    return TableGuess(
        path, format_name, table.name, tuple(columns), looked.rows, looked.rows == SAMPLE, step,
        table.clock is not None, anew, table.below, tuple(doubts), dict(table.said),
    )  # fmt: skip


def _by_name(table: Table, place: int, values: Array | None) -> ColumnGuess:
    column = table.columns[place]
    if values is None:
        return ColumnGuess(column.name, column.place, UNKNOWN, "it holds no numbers")
    unit, usable = stated_unit(column.unit)
    says = named(column.name, column.unit)
    role, why = says.role, says.why
    known = values[np.isfinite(values)]
    if role == TIME and not (increases(known) or goes_on_anew(known)):
        role, why = UNKNOWN, "a name of times, but they do not increase"
    if role == INDEX and not (counts(values) or increases(values)):
        role, why = UNKNOWN, "a name of an index, but it does not count"
    if role == RELATIVE_ANGLE and why.startswith("its unit count") and counts(values):
        role, why = INDEX, "it counts rows"
    doubts = []
    if role == TIME and (holes := int((~np.isfinite(values)).sum())):
        doubts.append(f"{holes} of its cells hold no number")
    if role not in (TIME, INDEX, UNKNOWN) and not says.side and role in (
        RELATIVE_ANGLE, RELATIVE_RATE, "drive_torque"
    ):  # fmt: skip
        doubts.append("which side of the gear is not said")
    if says.doubt:
        doubts.append(says.doubt)
    if unit and not usable:
        doubts.append(f"{unit!r}, as the file has it, is no unit that is known here")
    basis, unit_why = Basis.UNKNOWN, ""
    chosen = ""
    if usable:
        chosen, basis, unit_why = usable, Basis.STATED, "the file states it"
        if usable == "1/min" and role in (RELATIVE_RATE, MOTOR_RATE, COMMAND):
            chosen = "rpm"
    elif says.unit:
        basis = Basis.STATED if says.sure else Basis.LIKELY
        chosen, unit_why = says.unit, "its name ends with it"
    low, high = (float(known.min()), float(known.max())) if len(known) else (np.nan, np.nan)
    return ColumnGuess(
        column.name, column.place, role, why, chosen, basis, unit_why, tuple(doubts), low, high,
        says.tag, spare=says.spare, of_anything=says.doubt == OF_ANYTHING,
    )  # fmt: skip


def _one_time(
    columns: list[ColumnGuess], series: dict[int, Array], table: Table
) -> list[ColumnGuess]:
    """Without any column that is called so, one that runs like a clock is time, or an index."""
    for place, values in series.items():
        if columns[place].role == UNKNOWN and not columns[place].why and counts(values):
            columns[place] = replace(columns[place], role=INDEX, why="it counts rows")
    if any(each.role == TIME for each in columns) or table.clock is not None:
        return columns
    nameless = all(each.role in (UNKNOWN, INDEX) for each in columns)
    for place, values in series.items():
        each = columns[place]
        if each.name.endswith(("(1,:)", "(:,1)")) and evenly(values):
            columns[place] = replace(each, role=TIME, why="first of a matrix, and runs evenly")
            return _of_one_matrix(columns, each.name)
        if each.role != UNKNOWN or (each.why and not nameless):
            continue
        if evenly(values):
            columns[place] = replace(
                each, role=TIME, why="it increases evenly", doubts=("its name does not say so",)
            )
            break
    return columns


def _without_holes(times: Array) -> Array:
    """Times with those that are missing between the others."""
    known = np.isfinite(times)
    rows = np.arange(len(times))
    filled: Array = times if known.all() else np.interp(rows, rows[known], times[known])
    return filled


def _of_one_matrix(columns: list[ColumnGuess], first: str) -> list[ColumnGuess]:
    """What stands beside times in a matrix are signals of one axis, and not one of each."""
    matrix = first[: first.rindex("(")]
    return [
        replace(each, tag=()) if each.name.startswith(f"{matrix}(") else each for each in columns
    ]


def _time(
    columns: list[ColumnGuess], series: dict[int, Array], table: Table
) -> tuple[Array | None, float | None]:
    """Times, s, and their step; the unit of times is judged here, for everything rests on it."""
    if table.clock is not None:
        rows = len(next(iter(series.values()))) if series else 0
        stated: Array = table.clock.start + table.clock.step * np.arange(rows, dtype=np.float64)
        return stated, table.clock.step
    for place, each in enumerate(columns):
        if each.role != TIME:
            continue
        values = _without_holes(series[place])
        if each.basis is not Basis.STATED:
            once = np.split(values, restarts(values)[:1])[0]
            likely = unit_of_time(once, stated_rate(table.said))
            if likely is None:
                continue
            each = replace(each, unit=likely.unit, basis=Basis.LIKELY, unit_why=likely.why)
            columns[place] = each
        seconds = seconds_of(each.unit)
        if seconds is None:
            continue
        time = (values - values[0]) * seconds
        return time, ticks(np.split(time, restarts(time)[:1])[0]).step or None
    return None, None


_OF_INTEREST = (Severity.REFUSED, Severity.REPAIRABLE)


def _defects(
    columns: Sequence[ColumnGuess], series: dict[int, Array], time: Array
) -> Iterator[str]:
    """What is wrong with the recording, in sentences with the names of the file."""
    names: dict[str, str] = {}
    channels: dict[str, Array] = {}
    for place, each in enumerate(columns):
        if each.role not in (TIME, INDEX, UNKNOWN) and each.role not in names:
            names[each.role] = each.name
            channels[each.role] = series[place]
    found: tuple[Defect, ...] = find(time, channels)
    for defect in found:
        # A factor is told with the units, where it may be explained by them.
        if defect.severity in _OF_INTEREST and defect.kind != "factor":
            what = defect.what
            for role, name in names.items():
                what = what.replace(role, name)
            yield what
