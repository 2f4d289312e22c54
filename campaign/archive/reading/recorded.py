"""The samples of a trial, held against its record when they are read."""

from __future__ import annotations

from collections.abc import Callable, ItemsView, Iterable, Iterator, Mapping, ValuesView
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Generic, Protocol, TypeVar

import h5py
import numpy as np

from campaign.archive.layout.header import SEALED
from campaign.archive.layout.record import SeriesRecord, Trees, TrialRecord
from campaign.archive.layout.run_folder import first_line
from campaign.archive.reading import guarded
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.reading.series import series_at
from campaign.errors import ArchiveError
from campaign.recording import Array, Channel, ChannelInfo, Ending, Event, Recording
from campaign.trial import Trial

TIME = ChannelInfo("time", "s", "Time", "s")
PLOTTED = ("data", "preview")
"""The groups of an entry that hold samples."""


@dataclass(frozen=True)
class RecordedSamples:
    """What a trial recorded: the group `entry` of a file, and the record that vouches for it.

    Attributes:
        not_kept: why the samples are not there, and were not lost; empty when they are.
        sealed_as: of a trial's own file, the group that it becomes when its run is sealed.
    """

    path: Path
    entry: str
    record: TrialRecord = field(repr=False)
    not_kept: str = ""
    sealed_as: str = ""

    def recording(self, ending: Ending) -> Recording:
        """Events and times, and each channel when it is asked for."""
        events = tuple(Event(event.time, event.text) for event in self.record.events)
        if self.record.samples is None:
            return Recording(np.empty(0), {}, events, ending)
        if self.not_kept:
            raise ArchiveError(
                f"{self.path}: /{self.entry}: its samples were not kept: {self.not_kept}"
            )
        return Recording(
            self._time(), LazyChannels(self.record.channels, self.read), events, ending
        )

    def channels(self) -> tuple[ChannelInfo, ...]:
        return self.record.series

    def read(self, channels: Iterable[SeriesRecord]) -> Iterator[Channel]:
        """Channels, read now, one after another. Raises ArchiveError."""
        with self._data() as data:
            for told in channels:
                series = series_at(data, told.name, self.record.samples or 0)
                samples = series.read(told.sha256)
                check_unit(series.hdf5, told.unit)
                yield told.info.with_samples(samples)

    def problems(self) -> Iterator[str]:
        if self.record.samples is None or self.not_kept:
            return
        path, entry = self._place()
        try:
            with guarded.open_file(path) as file:
                yield from _problems(path, file, entry, self.record)
        except ArchiveError as error:
            yield str(error)

    def _time(self) -> Array:
        with self._data() as data:
            series = series_at(data, TIME.name, self.record.samples or 0)
            check_unit(series.hdf5, TIME.unit)
            return series.read(self.record.time)

    @contextmanager
    def _data(self) -> Iterator[h5py.Group]:
        path, entry = self._place()
        with guarded.open_file(path) as file, guarded.guarded(path, f"/{entry}"):
            yield guarded.inner_group(guarded.inner_group(file, entry), "data")

    def _place(self) -> tuple[Path, str]:
        """Where the trial lies now: its run may have been sealed since it was opened."""
        if self.sealed_as and not self.path.exists():
            sealed = self.path.parent.with_suffix(SEALED)
            if sealed.is_file():
                return sealed, self.sealed_as
        return self.path, self.entry


@dataclass(frozen=True)
class MemorySamples(RecordedSamples):
    """The same of a trial that has just ended, which need not be read from its file.

    Attributes:
        rows: time and every channel as they were written, shape (1 + channels, n).
    """

    rows: Array = field(kw_only=True, repr=False)

    def _time(self) -> Array:
        time: Array = self.rows[0]
        return time

    def read(self, channels: Iterable[SeriesRecord]) -> Iterator[Channel]:
        """From memory."""
        places = {told.name: place for place, told in enumerate(self.record.channels, 1)}
        for told in channels:
            yield told.info.with_samples(self.rows[places[told.name]])


class _Named(Protocol):
    """What an archive says of a channel besides its samples."""

    @property
    def name(self) -> str: ...


_Told = TypeVar("_Told", bound=_Named)


class LazyChannels(Mapping[str, Channel], Generic[_Told]):
    """Channels by name; the samples of each are read once, when it is first asked for.

    `read` reads those that it is handed, one after another; it raises ArchiveError.
    """

    def __init__(
        self, told: Iterable[_Told], read: Callable[[Iterable[_Told]], Iterator[Channel]]
    ) -> None:
        self._read_from = read
        self._told = {channel.name: channel for channel in told}
        self._read: dict[str, Channel] = {}

    def __getitem__(self, name: str) -> Channel:
        if name not in self._read:
            (self._read[name],) = self._read_from([self._told[name]])
        return self._read[name]

    def values(self) -> ValuesView[Channel]:
        self._read_all()
        return super().values()

    def items(self) -> ItemsView[str, Channel]:
        self._read_all()
        return super().items()

    def _read_all(self) -> None:
        """Whatever is left, the file being opened once."""
        left = [told for name, told in self._told.items() if name not in self._read]
        if left:
            self._read |= {channel.name: channel for channel in self._read_from(left)}

    def __contains__(self, name: object) -> bool:
        return name in self._told

    def __iter__(self) -> Iterator[str]:
        return iter(self._told)

    def __len__(self) -> int:
        return len(self._told)


def archived_trial(
    path: Path,
    entry: str,
    record: TrialRecord,
    trees: Trees,
    not_kept: str = "",
    sealed_as: str = "",
) -> ArchivedTrial:
    """The trial of a record; see `RecordedSamples`. Raises ArchiveError when it is not whole."""
    try:
        trial = record.restored(trees)
    except LookupError:
        raise ArchiveError(f"{path}: /{entry}: its bench or its options cannot be read") from None
    except ValueError as error:
        raise ArchiveError(f"{path}: /{entry}: {first_line(error)}") from None
    return trial_of_record(trial, path, entry, record, not_kept, sealed_as)


def trial_of_record(
    trial: Trial,
    path: Path,
    entry: str,
    record: TrialRecord,
    not_kept: str = "",
    sealed_as: str = "",
) -> ArchivedTrial:
    """A trial that is at hand, with what its record says and vouches for."""
    return ArchivedTrial(
        trial=trial,
        ending=record.ending,
        started=record.started,
        ended=record.ended,
        path=path,
        entry=entry,
        samples=RecordedSamples(path, entry, record, not_kept, sealed_as),
        windows=record.windows,
        estimates=record.estimates,
        measured_by=record.measured_by,
    )


def parse_record(path: Path, place: str, text: str) -> TrialRecord:
    """A record from its text. Raises ArchiveError."""
    try:
        return TrialRecord.model_validate_json(text)
    except ValueError as error:
        raise ArchiveError(f"{path}: {place}: {first_line(error)}") from None


def check_unit(series: h5py.Dataset, told: str) -> None:
    """ArchiveError unless a series has the unit in which it was recorded."""
    unit = guarded.attribute(series, "units")
    if unit != told:
        place = f"{series.file.filename}: {series.name}@units"
        raise ArchiveError(f"{place}: is {unit!r}, and {told!r} was recorded")


def series_of(record: TrialRecord) -> Iterator[tuple[str, str, int, str]]:
    """Every series that an entry holds: its group, its name, its length, its digest."""
    if record.samples is not None:
        yield "data", "time", record.samples, record.time
        for channel in record.channels:
            yield "data", channel.name, record.samples, channel.sha256
    if (preview := record.preview) is not None:
        yield "preview", "time", preview.samples, preview.time
        yield "preview", preview.channel, preview.samples, preview.values


def _problems(path: Path, file: h5py.File, entry_name: str, record: TrialRecord) -> Iterator[str]:
    units = {info.name: info.unit for info in (TIME, *record.series)}
    for group, name, length, digest in series_of(record):
        try:
            with guarded.guarded(path, f"/{entry_name}/{group}/{name}"):
                data = guarded.inner_group(guarded.inner_group(file, entry_name), group)
                series = series_at(data, name, length)
                series.check(digest)
                check_unit(series.hdf5, units[name])
        except ArchiveError as error:
            yield str(error)
