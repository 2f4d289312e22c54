"""The origin of an imported trial's samples, as a complete tree.

Planning makes it from a mapping and stores it in the trial (`Trial.recording`). It is sufficient to
read the samples, now and when a run is resumed, without the mapping.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from pydantic import Field

from campaign.importing.interface import regular
from campaign.options import Options
from campaign.recording import ChannelInfo


class FileSnapshot(Options):
    """A file as it was when the plan was made."""

    name: str
    """As the mapping writes it."""
    path: str
    """Where it lay."""
    sha256: str
    """Of its bytes."""
    size: int
    """Bytes."""


class Cells(Options):
    """One column of one table of one file, each by its place from 0."""

    file: int
    table: int
    column: int
    name: str = ""
    """As the file has it."""

    @property
    def rows_of(self) -> tuple[int, int]:
        """File and table: columns of one have their rows in common."""
        return self.file, self.table


class ClockUsed(Options):
    """How rows are told by their times: row k is at start + k / sample_rate, or as `cells` say."""

    cells: Cells | None = None
    """A column of times."""
    factor: float = 1.0
    """From that column's unit to s."""
    step: float | None = None
    """Of a clock that the file or the mapping states (s)."""
    start: float = 0.0
    """Time of row 0 by such a clock (s)."""


class ChannelSource(Options):
    """A channel: factor * (column - offset), read `shift` samples later; or from another channel.

    `how` = column, copy, derivative or integral; where it is made from another channel, that one
    stands before it.
    """

    name: str
    unit: str
    label: str
    display_unit: str
    how: Literal["column", "copy", "derivative", "integral"] = "column"
    cells: Cells | None = None
    """Of a column."""
    source: str = ""
    """Of a copy, a derivative or an integral: the other channel."""
    factor: float = 1.0
    """From the column's unit to `unit`, with its sign and what it is multiplied by."""
    offset: float = 0.0
    """In the column's unit."""
    shift: int = 0
    """Samples by which the column is late."""
    period: float | None = None
    """Of a scale that begins anew and was made continuous, in `unit`."""
    relative_uncertainty: float | None = None
    """Of `factor` (1 sigma), as far as the mapping says."""
    filter: str = ""
    """What was done to it before it was recorded, in words."""
    own_rate: float | None = None
    """How often it is new (Hz), where it comes from a slower clock and is held."""
    clock: ClockUsed | None = None
    """That slower clock."""

    @property
    def info(self) -> ChannelInfo:
        """Name, unit and rate of the channel for a recording."""
        return ChannelInfo(
            self.name, self.unit, self.label, self.display_unit, own_rate=self.own_rate
        )


class RecordingDescription(Options):
    """A recording that a trial is served from.

    The trial's time is 0 at its first row, and its samples are at k / sample_rate.
    """

    files: tuple[FileSnapshot, ...] = Field(min_length=1)
    table: tuple[int, int]
    """File and table whose rows are the trial's samples."""
    first: int
    """Its first row, from 0."""
    rows: int
    """How many."""
    clock: ClockUsed
    sample_rate: float
    """Of the trial (Hz)."""
    samples: int
    """Of the trial; more than `rows` where gaps were marked."""
    skip: int = 0
    """Samples at the beginning that only serve channels which are put back by less."""
    repairs: tuple[str, ...] = ()
    """What is done to the times."""
    channels: tuple[ChannelSource, ...]
    remarks: tuple[str, ...] = ()
    """What was done, and what was seen, in sentences."""

    @property
    def label(self) -> str:
        """Files and first row, for messages."""
        return label(self.files, self.first)


def label(files: Sequence[FileSnapshot], first: int = 0) -> str:
    """Names of files and the first row, for messages."""
    names = " and ".join(each.name for each in files)
    return f"{names} from row {first + 1}" if first else names


def file_used(path: Path, name: str) -> FileSnapshot:
    """A file with its digest. Raises RecordingError if it cannot be read."""
    with regular(path) as file:
        digest, size = hashlib.file_digest(file, "sha256"), file.tell()
    return FileSnapshot(name=name, path=str(path.resolve()), sha256=digest.hexdigest(), size=size)
