"""TDMS of LabVIEW and other programs of NI; needs npTDMS (`pip install 'campaign[tdms]'`).

Time is no channel: a waveform states its offset and its step; without them its time is unknown.
Channels with different clocks or start times are in separate tables.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from campaign.importing.interface import (
    ROWS,
    Array,
    Clock,
    Column,
    RecordingError,
    RecordingFormat,
    Table,
    read_by,
)
from campaign.importing.subprocess_reader import tables_streamed

MAGIC = b"TDSm"
_reading = partial(read_by, "npTDMS", what="TDMS file", extra="tdms")


def tables(path: Path) -> Sequence[Table]:
    """The tables of a file, read in this process."""
    groups: dict[tuple[str, int, Clock | None, str], list[tuple[str, Any]]] = {}
    with _reading(path):
        from nptdms import TdmsFile

        with TdmsFile.open(path) as file:
            for group in file.groups():
                for channel in group.channels():
                    if len(channel) > 1 and channel.dtype.kind in "fiub":
                        facts = channel.properties
                        clock = _clock(facts)
                        start = facts.get("wf_start_time")
                        key = (group.name, len(channel), clock, str(start))
                        groups.setdefault(key, []).append((channel.name, facts.get("unit_string")))
    if not groups:
        raise RecordingError.of(path, "no channel of it is a series of numbers")
    return [
        Table(
            str(group),
            tuple(Column(name, str(unit or ""), f"{group}/{name}") for name, unit in channels),
            partial(_read, path, group, [name for name, _ in channels], length),
            clock,
        )
        for (group, length, clock, _), channels in groups.items()
    ]


def _clock(told: Any) -> Clock | None:
    """The clock of a waveform; None unless both step and offset are stated."""
    step, offset = told.get("wf_increment"), told.get("wf_start_offset")
    if step is None or offset is None or not float(step) > 0:
        return None
    return Clock(float(step), float(offset))


def _read(
    path: Path, group: str, names: Sequence[str], length: int, places: Sequence[int]
) -> Iterator[Array]:
    with _reading(path):
        from nptdms import TdmsFile

        with TdmsFile.open(path) as file:
            channels = [file[group][names[place]] for place in places]
            for start in range(0, length, ROWS):
                stop = min(start + ROWS, length)
                yield np.column_stack(
                    # Scaled as the file states: raw counts are no physical quantity.
                    [np.asarray(channel[start:stop], dtype=np.float64) for channel in channels]
                )


FORMAT = RecordingFormat(
    "tdms",
    "TDMS of NI, by npTDMS",
    (".tdms",),
    lambda head: head.startswith(MAGIC),
    partial(tables_streamed, __name__),
)
