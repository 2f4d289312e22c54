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
    """State of a file when the plan was made."""

    name: str
    """Name in the mapping."""
    path: str
    """Its path then."""
    sha256: str
    """SHA-256 of its bytes."""
    size: int
    """Size in bytes."""


class Cells(Options):
    """One column of one table of one file, each by its index from 0."""

    file: int
    table: int
    column: int
    name: str = ""
    """Name in the file."""

    @property
    def rows_of(self) -> tuple[int, int]:
        """File and table: columns of one have their rows in common."""
        return self.file, self.table


class ClockUsed(Options):
    """Times of rows: row k is at start + k * step, or as `cells` state."""

    cells: Cells | None = None
    """A column of times."""
    factor: float = 1.0
    """From that column's unit to s."""
    step: float | None = None
    """Sample period that the file or the mapping states (s)."""
    start: float = 0.0
    """Time of row 0 with `step` (s)."""


class ChannelSource(Options):
    """A channel: factor * (column - offset), read `shift` samples later; or from another channel.

    `how` = column, copy, derivative or integral; a source channel precedes the channels made from
    it.
    """

    name: str
    unit: str
    label: str
    display_unit: str
    how: Literal["column", "copy", "derivative", "integral"] = "column"
    cells: Cells | None = None
    """The column."""
    source: str = ""
    """Source channel of a copy, a derivative or an integral."""
    factor: float = 1.0
    """Factor from the column's unit to `unit`, with sign and scale."""
    offset: float = 0.0
    """Offset in the column's unit."""
    shift: int = 0
    """Delay of the column in samples."""
    period: float | None = None
    """Period of a scale that was unwrapped, in `unit`."""
    relative_uncertainty: float | None = None
    """Uncertainty of `factor` (1 sigma), if the mapping states it."""
    filter: str = ""
    """Processing before the recording, in words."""
    own_rate: float | None = None
    """Update rate of a channel that a slower clock samples and holds (Hz)."""
    clock: ClockUsed | None = None
    """That slower clock."""

    @property
    def info(self) -> ChannelInfo:
        """Name, unit and rate of the channel for a recording."""
        return ChannelInfo(
            self.name, self.unit, self.label, self.display_unit, own_rate=self.own_rate
        )


class RecordingDescription(Options):
    """The recording that supplies a trial.

    The trial's time is 0 at its first row, and its samples are at k / sample_rate.
    """

    files: tuple[FileSnapshot, ...] = Field(min_length=1)
    table: tuple[int, int]
    """File and table whose rows are the trial's samples."""
    first: int
    """First row, from 0."""
    rows: int
    """Number of rows."""
    clock: ClockUsed
    sample_rate: float
    """Sample rate of the trial (Hz)."""
    samples: int
    """Samples of the trial; more than `rows` if gaps are marked."""
    skip: int = 0
    """Samples at the start that only channels with a smaller shift use."""
    repairs: tuple[str, ...] = ()
    """Repairs of the times."""
    channels: tuple[ChannelSource, ...]
    remarks: tuple[str, ...] = ()
    """Repairs and observations, in sentences."""

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
