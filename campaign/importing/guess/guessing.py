"""Roles and units of the columns of files, each with what it rests on.

Certain is what a file states. What its numbers suggest is likely, and is marked; sign, side of the
gear, constants, offsets and filters are never guessed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from pathlib import Path

import numpy as np

from campaign.channels import MOTOR_ANGLE, MOTOR_RATE, RELATIVE_ANGLE, RELATIVE_RATE
from campaign.importing.defects import Defect, Severity, find
from campaign.importing.defects.clock import ticks
from campaign.importing.guess.evidence import (
    TICKS,
    Likely,
    counts,
    evenly,
    factor,
    increases,
    unit_of_angle,
    unit_of_rate,
    unit_of_time,
)
from campaign.importing.guess.names import INDEX, TIME, UNKNOWN, Named, named
from campaign.importing.guess.stated import stated_unit
from campaign.importing.interface import Array, Table
from campaign.importing.opening import open_recordings

SAMPLE = 200_000
"""Rows by which is guessed: enough for any motion, and little of a large file."""
_PAIRS = ((RELATIVE_ANGLE, RELATIVE_RATE), (MOTOR_ANGLE, MOTOR_RATE), (RELATIVE_ANGLE, MOTOR_RATE))


class Basis(StrEnum):
    """What a unit rests on."""

    STATED = "stated"  # the file says so
    LIKELY = "likely"  # the numbers suggest it
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class ColumnGuess:
    """A column of a table, and what it may be.

    Attributes:
        role: a channel of the vocabulary, or `time`, `index`, `unknown`.
        why: what the role rests on.
        unit: as `parse_unit` has it; "" where unknown.
        doubts: what its reader should check, in sentences.
        low, high: the range of what was looked at; NaN where it holds no numbers.
        group: which of several axes it is of.
    """

    name: str
    place: str
    role: str
    why: str = ""
    unit: str = ""
    basis: Basis = Basis.UNKNOWN
    unit_why: str = ""
    doubts: tuple[str, ...] = ()
    low: float = np.nan
    high: float = np.nan
    group: str = ""


@dataclass(frozen=True)
class TableGuess:
    """A table of a file.

    Attributes:
        rows: how many were looked at; `more` says that there are further ones.
        step: s between samples, by a clock that the file states, or by times whose unit is
            stated or likely; None where that cannot be told.
        clock: whether the file states the clock, without a column of times.
        doubts: what is wrong with it as a whole.
    """

    file: Path
    format: str
    name: str
    columns: tuple[ColumnGuess, ...]
    rows: int
    more: bool = False
    step: float | None = None
    clock: bool = False
    doubts: tuple[str, ...] = ()
    said: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Guess:
    """What files may be."""

    tables: tuple[TableGuess, ...]


def guess(paths: Sequence[Path]) -> Guess:
    """What the files at `paths` may be. Raises RecordingError for those that cannot be read."""
    return Guess(tuple(each for path in paths for each in _of_file(path)))


def _of_file(path: Path) -> Iterator[TableGuess]:
    found, tables = open_recordings(path)
    for table in tables:
        yield _of_table(path, found.name, table)


def _beginning(table: Table, places: Sequence[int]) -> Array:
    blocks: list[Array] = []
    reading = table.read(places)
    while sum(map(len, blocks)) < SAMPLE and (block := next(reading, None)) is not None:
        blocks.append(block)
    return np.concatenate(blocks)[:SAMPLE] if blocks else np.empty((0, len(places)))


def _of_table(path: Path, format_name: str, table: Table) -> TableGuess:
    places = [k for k, column in enumerate(table.columns) if column.numeric]
    values = _beginning(table, places)
    series = {place: values[:, k] for k, place in enumerate(places)}
    more = len(values) == SAMPLE
    columns = [_by_name(table, place, series.get(place)) for place in range(len(table.columns))]
    columns = _one_time(columns, series, table)
    time, step = _time(columns, series, table)
    doubts = list(table.doubts)
    if time is None:
        doubts.append("no time is known: state a rate, or which column holds times")
    else:
        columns = _with_units(columns, series, time)
        doubts += _defects(columns, series, time)
    return TableGuess(
        path, format_name, table.name, tuple(columns), len(values), more, step,
        table.clock is not None, tuple(doubts), dict(table.said),
    )  # fmt: skip


def _by_name(table: Table, place: int, values: Array | None) -> ColumnGuess:
    column = table.columns[place]
    if values is None:
        return ColumnGuess(column.name, column.place, UNKNOWN, "it holds no numbers")
    unit, usable = stated_unit(column.unit)
    says = named(column.name, column.unit)
    role, why = says.role, says.why
    if role == TIME and not increases(values):
        role, why = UNKNOWN, "a name of times, but they do not increase"
    if role == INDEX and not (counts(values) or increases(values)):
        role, why = UNKNOWN, "a name of an index, but it does not count"
    doubts = []
    if role not in (TIME, INDEX, UNKNOWN) and not says.side and role in (
        RELATIVE_ANGLE, RELATIVE_RATE, "drive_torque"
    ):  # fmt: skip
        doubts.append("which side of the gear is not said")
    if unit and not usable:
        doubts.append(f"{unit!r}, as the file has it, is no unit that is known here")
    basis, unit_why = Basis.UNKNOWN, ""
    chosen = ""
    if usable:
        chosen, basis, unit_why = usable, Basis.STATED, "the file states it"
        if usable == "1/min" and role in (RELATIVE_RATE, MOTOR_RATE):
            chosen = "rpm"
    elif says.unit:
        chosen, basis, unit_why = says.unit, Basis.STATED, "its name ends with it"
    known = values[np.isfinite(values)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (np.nan, np.nan)
    return ColumnGuess(
        column.name, column.place, role, why, chosen, basis, unit_why, tuple(doubts), low, high,
        says.group,
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
            break
        if each.role != UNKNOWN or (each.why and not nameless):
            continue
        if evenly(values):
            columns[place] = replace(
                each, role=TIME, why="it increases evenly", doubts=("its name does not say so",)
            )
            break
    return columns


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
        values = series[place]
        if each.basis is not Basis.STATED:
            likely = unit_of_time(values)
            if likely is None:
                continue
            each = replace(each, unit=likely.unit, basis=Basis.LIKELY, unit_why=likely.why)
            columns[place] = each
        seconds = TICKS.get(each.unit)
        if seconds is None:
            continue
        time = (values - values[0]) * seconds
        return time, ticks(time).step or None
    return None, None


def _with_units(
    columns: list[ColumnGuess], series: dict[int, Array], time: Array
) -> list[ColumnGuess]:
    """Units that the numbers suggest, where the file states none."""
    for place, each in enumerate(columns):
        if each.role in (RELATIVE_ANGLE, MOTOR_ANGLE) and each.basis is Basis.UNKNOWN:
            columns[place] = _likely(each, unit_of_angle(series[place]))
    for angle_role, rate_role in _PAIRS:
        for k, angle in enumerate(columns):
            for j, rate in enumerate(columns):
                alike = angle.role == angle_role and rate.role == rate_role
                if alike and angle.group == rate.group:
                    columns[k], columns[j] = _pair(
                        columns[k], columns[j], time, series[k], series[j]
                    )
    return columns


def _likely(column: ColumnGuess, likely: Likely | None) -> ColumnGuess:
    if likely is None:
        return column
    return replace(column, unit=likely.unit, basis=Basis.LIKELY, unit_why=likely.why)


def _pair(
    angle: ColumnGuess, rate: ColumnGuess, time: Array, q: Array, v: Array
) -> tuple[ColumnGuess, ColumnGuess]:
    """A rate beside its angle: the unit of the one from that of the other, and what is odd."""
    found = factor(time, q, v)
    if found is None:
        return angle, rate
    told = f"{found.factor:.5g} times the derivative of {angle.name}, R² {found.explained:.4f}"
    if rate.basis is Basis.UNKNOWN and angle.unit:
        rate = _likely(rate, unit_of_rate(found, angle.unit))
    rate = replace(rate, doubts=(*rate.doubts, told))
    return angle, rate


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


__all__ = ["Basis", "ColumnGuess", "Guess", "Named", "TableGuess", "guess"]
