"""The samples of a trial, checked against its record when they are read."""

from __future__ import annotations

from collections.abc import Callable, ItemsView, Iterable, Iterator, Mapping, ValuesView
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from typing import Generic, Protocol, TypeVar

import numpy as np

from campaign.archive.layout.header import SEALED
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
"""Finds a series of an open trial: group, name, length and unit, which must be what is there."""


@dataclass(frozen=True)
class RecordedSamples:
    """What a trial recorded: a group of a sealed run, and the record that vouches for it.

    Attributes:
        not_kept: why the samples are not there, and were not lost; empty when they are.
    """

    path: Path
    entry: str
    record: TrialRecord = field(repr=False)
    not_kept: str = ""

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

    def digests(self) -> Mapping[str, str]:
        told = {channel.name: channel.sha256 for channel in self.record.channels}
        return {TIME.name: self.record.time, **told}

    def read(self, channels: Iterable[SeriesRecord]) -> Iterator[Channel]:
        """Channels, read now, one after another. Raises ArchiveError."""
        length = self.record.samples or 0
        with self.opened() as series:
            for told in channels:
                samples = series("data", told.name, length, told.unit).read(told.sha256)
                yield told.info.with_samples(samples)

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
        """The trial's series, while its file is open."""
        with safe_hdf5.open_file(self.path) as file, safe_hdf5.guarded(self.path, f"/{self.entry}"):
            entry = safe_hdf5.inner_group(file, self.entry)
            inner = cache(partial(safe_hdf5.inner_group, entry))

            def series(group: str, name: str, length: int, unit: str) -> Series:
                with safe_hdf5.guarded(self.path, f"/{self.entry}/{group}/{name}"):
                    dataset, found = series_at(inner(group), name, length)
                    safe_hdf5.check_attribute(dataset, "units", unit)
                    return found

            yield series


@dataclass(frozen=True)
class PackedSamples(RecordedSamples):
    """The same of a trial's own file, in the folder of a run in progress.

    Attributes:
        sealed_as: the group that the trial becomes when its run is sealed.
    """

    sealed_as: str = ""

    @contextmanager
    def opened(self) -> Iterator[_Open]:
        """See `RecordedSamples`."""
        sealed = self.path.parent.with_suffix(SEALED)
        if self.sealed_as and not self.path.exists() and sealed.is_file():  # since it was opened
            with RecordedSamples(sealed, self.sealed_as, self.record).opened() as there:
                yield there
            return
        packed = read_packed(self.path, self.entry)
        with safe_hdf5.guarded(self.path), self.path.open("rb") as file:

            def series(group: str, name: str, length: int, _: str) -> Series:
                place = f"{self.path}: /{self.entry}/{group}/{name}"
                for told in packed.groups.get(group, ()):
                    if told.name == name:
                        return file_series(file, place, length, told)
                raise ArchiveError(f"{place}: is missing")

            yield series


@dataclass(frozen=True)
class MemorySamples(PackedSamples):
    """The same of a trial that has just ended, which need not be read from its file.

    Attributes:
        rows: time and every channel as they were written, shape (1 + channels, n).
    """

    rows: Array = field(kw_only=True, repr=False)

    def _time(self) -> Array:
        return np.array(self.rows[0])

    def read(self, channels: Iterable[SeriesRecord]) -> Iterator[Channel]:
        """From memory."""
        places = {told.name: place for place, told in enumerate(self.record.channels, 1)}
        for told in channels:
            yield told.info.with_samples(self.rows[places[told.name]].copy())


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


def archived_trial(samples: RecordedSamples, trees: Trees) -> ArchivedTrial:
    """The trial of a record. Raises ArchiveError when it is not whole."""
    place = f"{samples.path}: /{samples.entry}"
    try:
        trial = samples.record.restored(trees)
    except LookupError:
        raise ArchiveError(f"{place}: its bench or its options cannot be read") from None
    except ValueError as error:
        raise ArchiveError(f"{place}: {first_line(error)}") from None
    return trial_of_record(trial, samples)


def trial_of_record(trial: Trial, samples: RecordedSamples) -> ArchivedTrial:
    """A trial that is at hand, with what its record says and vouches for."""
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
