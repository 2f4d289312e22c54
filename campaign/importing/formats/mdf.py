"""MDF files (`.mf4`, `.mdf`), group by group; needs asammdf.

A group has one clock. Groups are never merged: values between the times of a group would be
invented.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from campaign.importing.interface import (
    ROWS,
    Array,
    Column,
    RecordingError,
    RecordingFormat,
    Table,
    read_by,
)
from campaign.importing.subprocess_reader import tables_streamed

MAGIC = (b"MDF     3.", b"MDF     4.")
UNFINISHED = b"UnFinMF "
DENSEST = 1100
"""Largest ratio of the unpacked size to the compressed size."""


def tables(path: Path) -> Sequence[Table]:
    """The groups of a file with more than one sample, read in this process."""
    with path.open("rb") as raw:
        if raw.read(len(UNFINISHED)) == UNFINISHED:
            message = "its recording was never finished: let its program mend it first"
            raise RecordingError.of(path, message)
    result: list[Table] = []
    with _opened(path) as file:
        for group, each in enumerate(file.groups):
            rows = int(each.channel_group.cycles_nr)
            if rows < 2:
                continue
            size = each.channel_group.samples_byte_nr + each.channel_group.invalidation_bytes_nr
            if rows * size > DENSEST * path.stat().st_size:
                size_note = f"group {group + 1} says that it has {rows} samples of {size} bytes"
                raise RecordingError.of(path, f"{size_note}, more than are in a file of this size")
            columns, places = _columns(file, group, each)
            if any(column.numeric for column in columns[1:]):
                name = str(getattr(each.channel_group, "acq_name", "") or f"group {group + 1}")
                read = partial(_read, path, group, places, rows)
                result.append(Table(name, tuple(columns), read))
    if not result:
        raise RecordingError.of(path, "no group of it has a series of numbers")
    return result


def _columns(file: Any, group: int, of: Any) -> tuple[list[Column], list[int | None]]:
    """The clock, then the channels in order, by index: two channels may have the same name."""
    where = f"group {group + 1}"
    columns = [Column("time", "s", f"{where}, its clock")]
    places: list[int | None] = [None]
    master = file.masters_db.get(group)
    for index, channel in enumerate(of.channels):
        if index == master:
            continue
        first = file.get(group=group, index=index, record_count=1)
        usable = first.samples.dtype.kind in "fiub" and first.samples.ndim == 1
        unit = str(first.unit or "")
        columns.append(Column(str(channel.name), unit, f"{where}, channel {index}", usable))
        places.append(index)
    return columns, places


def _read(
    path: Path, group: int, places: Sequence[int | None], rows: int, wanted: Sequence[int]
) -> Iterator[Array]:
    with _opened(path) as file:
        for start in range(0, rows, ROWS):
            count = min(ROWS, rows - start)
            series = [_part(file, group, places[place], start, count) for place in wanted]
            available = min((len(each) for each in series), default=count)
            if available < count:
                message = f"group {group + 1} ends after {start + available} of {rows} samples"
                raise RecordingError.of(path, message)
            yield np.column_stack(series) if series else np.empty((count, 0))


def _part(file: Any, group: int, index: int | None, start: int, count: int) -> Array:
    """Physical values of a channel, or the clock (index None); invalid samples become NaN."""
    if index is None:
        times = file.get_master(group, record_offset=start, record_count=count)
        return np.asarray(times, dtype=np.float64)
    signal = file.get(
        group=group,
        index=index,
        record_offset=start,
        record_count=count,
        ignore_invalidation_bits=False,
    )
    values = np.asarray(signal.samples, dtype=np.float64)
    if signal.invalidation_bits is not None:
        values = np.where(np.asarray(signal.invalidation_bits, dtype=bool), np.nan, values)
    return values


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    with read_by("asammdf", path, "MDF file", "mdf"):
        from asammdf import MDF

        with MDF(path) as file:
            yield file


FORMAT = RecordingFormat(
    "mdf",
    "MDF 3 and 4, by asammdf",
    (".mf4", ".mdf", ".dat"),
    lambda head: head.startswith((*MAGIC, UNFINISHED)),
    partial(tables_streamed, __name__),
)
