"""The samples of a trial, checked against its record when they are read."""

from __future__ import annotations

from collections.abc import Callable, ItemsView, Iterable, Iterator, Mapping, ValuesView
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path

import numpy as np

from campaign.archive.layout.names import SEALED
from campaign.archive.layout.record import SeriesRecord, Trees, TrialRecord, series_of
from campaign.archive.layout.run_folder import first_line
from campaign.archive.reading import safe_hdf5
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.reading.packed_trial_reader import read_packed
from campaign.archive.reading.series import Series, file_series, series_at
from campaign.errors import ArchiveError
from campaign.recording import Array, Channel, ChannelInfo, Ending, Event, Recording
from campaign.trial import Trial

TIME = ChannelInfo("time", "s", "Time", "s")
PLOTTED = ("data", "preview")
"""The groups of an entry that hold samples."""


_Open = Callable[[str, str, int, str], Series]
"""Opens a series of a trial by group, name, length and unit; length and unit must match."""


@dataclass(frozen=True)
class RecordedSamples:
    """Samples of a trial: a group of a sealed run, and the record with its digests.

    Attributes:
        not_kept: reason why the samples were left out on purpose; empty if they are present.
    """

    path: Path
    entry: str
    record: TrialRecord = field(repr=False)
    not_kept: str = ""

    def recording(self, ending: Ending) -> Recording:
        """Recording with events and times; channels are read on access. Raises ArchiveError."""
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

    def digests(self) -> Mapping[str, str]:
        channels = {channel.name: channel.sha256 for channel in self.record.channels}
        return {TIME.name: self.record.time, **channels}

    def read(self, channels: Iterable[SeriesRecord]) -> Iterator[Channel]:
        """Read the channels, one after another. Raises ArchiveError."""
        length = self.record.samples or 0
        with self.opened() as series:
            for entry in channels:
                samples = series("data", entry.name, length, entry.unit).read(entry.sha256)
                yield entry.info.with_samples(samples)

    def problems(self) -> Iterator[str]:
        if self.record.samples is None or self.not_kept:
            return
        units = {info.name: info.unit for info in (TIME, *self.record.series)}
        try:
            with self.opened() as series:
                for group, name, length, digest in series_of(self.record):
                    try:
                        series(group, name, length, units[name]).check(digest)
                    except ArchiveError as error:
                        yield str(error)
        except ArchiveError as error:
            yield str(error)

    def _time(self) -> Array:
        with self.opened() as series:
            length = self.record.samples or 0
            return series("data", TIME.name, length, TIME.unit).read(self.record.time)

    @contextmanager
    def opened(self) -> Iterator[_Open]:
        """Open the file of the trial; yields the function that opens its series."""
        with safe_hdf5.open_file(self.path) as file, safe_hdf5.guarded(self.path, f"/{self.entry}"):
            entry = safe_hdf5.inner_group(file, self.entry)
            inner = cache(partial(safe_hdf5.inner_group, entry))

            def series(group: str, name: str, length: int, unit: str) -> Series:
                with safe_hdf5.guarded(self.path, f"/{self.entry}/{group}/{name}"):
                    dataset, samples = series_at(inner(group), name, length)
                    safe_hdf5.check_attribute(dataset, "units", unit)
                    return samples

            yield series


@dataclass(frozen=True)
class PackedSamples(RecordedSamples):
    """Samples in a trial's own file, in the folder of a run in progress.

    Attributes:
        sealed_as: group of the trial after its run is sealed.
    """

    sealed_as: str = ""

    @contextmanager
    def opened(self) -> Iterator[_Open]:
        """See `RecordedSamples`."""
        sealed = self.path.parent.with_suffix(SEALED)
        if self.sealed_as and not self.path.exists() and sealed.is_file():  # since it was opened
            with RecordedSamples(sealed, self.sealed_as, self.record).opened() as sealed_series:
                yield sealed_series
            return
        packed = read_packed(self.path, self.entry)
        with safe_hdf5.guarded(self.path), self.path.open("rb") as file:

            def series(group: str, name: str, length: int, _: str) -> Series:
                place = f"{self.path}: /{self.entry}/{group}/{name}"
                for entry in packed.groups.get(group, ()):
                    if entry.name == name:
                        return file_series(file, place, length, entry)
                raise ArchiveError(f"{place}: is missing")

            yield series


@dataclass(frozen=True)
class MemorySamples(PackedSamples):
    """Samples in memory of a trial that has just ended.

    Attributes:
        rows: time and every channel as written, shape (1 + channels, n).
    """

    rows: Array = field(kw_only=True, repr=False)

    def _time(self) -> Array:
        return np.array(self.rows[0])

    def read(self, channels: Iterable[SeriesRecord]) -> Iterator[Channel]:
        """Copy the channels from memory."""
        places = {entry.name: place for place, entry in enumerate(self.record.channels, 1)}
        for entry in channels:
            yield entry.info.with_samples(self.rows[places[entry.name]].copy())


class LazyChannels(Mapping[str, Channel]):
    """Channels by name; the samples of each are read once, on first access.

    `read` reads the given channels, one after another; it raises ArchiveError.
    """

    def __init__(
        self,
        entries: Iterable[SeriesRecord],
        read: Callable[[Iterable[SeriesRecord]], Iterator[Channel]],
    ) -> None:
        self._read_from = read
        self._entries = {channel.name: channel for channel in entries}
        self._read: dict[str, Channel] = {}

    def __getitem__(self, name: str) -> Channel:
        if name not in self._read:
            (self._read[name],) = self._read_from([self._entries[name]])
        return self._read[name]

    def values(self) -> ValuesView[Channel]:
        self._read_all()
        return super().values()

    def items(self) -> ItemsView[str, Channel]:
        self._read_all()
        return super().items()

    def _read_all(self) -> None:
        """Read the remaining channels; opens the file once."""
        left = [entry for name, entry in self._entries.items() if name not in self._read]
        if left:
            self._read |= {channel.name: channel for channel in self._read_from(left)}

    def __contains__(self, name: object) -> bool:
        return name in self._entries

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)


def archived_trial(samples: RecordedSamples, trees: Trees) -> ArchivedTrial:
    """The trial of a record. Raises ArchiveError if a part of it is missing or invalid."""
    place = f"{samples.path}: /{samples.entry}"
    try:
        trial = samples.record.restored(trees)
    except LookupError:
        raise ArchiveError(f"{place}: its bench or its options cannot be read") from None
    except ValueError as error:
        raise ArchiveError(f"{place}: {first_line(error)}") from None
    return trial_of_record(trial, samples)


def trial_of_record(trial: Trial, samples: RecordedSamples) -> ArchivedTrial:
    """An archived trial from a parsed trial and its record."""
    record = samples.record
    return ArchivedTrial(
        trial=trial,
        ending=record.ending,
        started=record.started,
        ended=record.ended,
        path=samples.path,
        entry=samples.entry,
        samples=samples,
        windows=record.windows,
        estimates=record.estimates,
        measured_by=record.measured_by,
    )
