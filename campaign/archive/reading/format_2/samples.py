"""Reading samples back, and finding what is damaged of them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path

import h5py
import numpy as np
from pydantic import BaseModel, TypeAdapter

from campaign.archive.reading import guarded
from campaign.archive.reading.recorded import LazyChannels
from campaign.errors import ArchiveError
from campaign.recording import Channel, ChannelInfo, Ending, Event, Recording


@dataclass(frozen=True)
class StoredSamples:
    """The samples of a trial: of the group `entry` in a file."""

    path: Path
    entry: str
    not_kept: str = ""

    def recording(self, ending: Ending) -> Recording:
        return read_recording(self.path, self.entry, ending)

    def channels(self) -> tuple[ChannelInfo, ...]:
        return read_channels(self.path, self.entry)

    def problems(self) -> Iterator[str]:
        return check_recordings(self.path, [self.entry])


class _Event(BaseModel):
    time: float
    text: str


_EVENTS = TypeAdapter(list[_Event])
_CHANNELS = TypeAdapter(list[ChannelInfo])


@lru_cache(maxsize=64)
def _announced(text: str) -> tuple[ChannelInfo, ...]:
    """The channels of a text that is the same for every trial of a test."""
    return tuple(_CHANNELS.validate_json(text))


def read_recording(path: Path, entry_name: str, ending: Ending) -> Recording:
    """A trial's events and times, checked, and each channel when it is asked for.

    A trial that recorded nothing has no channels.
    """
    with guarded.open_file(path) as file, guarded.guarded(path, f"/{entry_name}"):
        entry = guarded.group_at(file, entry_name, "NXentry")
        record = guarded.group_at(entry, "record", "NXcollection")
        told = _EVENTS.validate_json(guarded.text_at(record, "events"))
        events = tuple(Event(event.time, event.text) for event in told)
        if "data" not in entry:
            return Recording(np.empty(0), {}, events, ending)
        data = guarded.group_at(entry, "data", "NXdata")
        time = guarded.read_samples(guarded.samples_at(data, "time"))
        infos = _announced(guarded.text_at(record, "channels"))
    channels = LazyChannels(infos, partial(_read_channels, path, entry_name, len(time)))
    return Recording(time, channels, events, ending)


def _read_channels(
    path: Path, entry_name: str, length: int, infos: Iterable[ChannelInfo]
) -> Iterator[Channel]:
    """Channels, read now, one after another. Raises ArchiveError."""
    with guarded.open_file(path) as file, guarded.guarded(path, f"/{entry_name}"):
        # Their classes were looked at when the times were read.
        data = guarded.inner_group(guarded.inner_group(file, entry_name), "data")
        for info in infos:
            yield _channel(data, info, length)


def read_channels(path: Path, entry_name: str) -> tuple[ChannelInfo, ...]:
    """The channels that a trial announced. Raises ArchiveError when they cannot be read."""
    with guarded.open_file(path) as file, guarded.guarded(path, f"/{entry_name}"):
        entry = guarded.group_at(file, entry_name, "NXentry")
        record = guarded.group_at(entry, "record", "NXcollection")
        return _announced(guarded.text_at(record, "channels"))


def check_recordings(path: Path, entries: Iterable[str]) -> Iterator[str]:
    """What is damaged of the trials in a file, one line each; reads them in flat memory."""
    try:
        with guarded.open_file(path) as file:
            for name in entries:
                yield from _check_entry(path, file, name)
    except ArchiveError as error:
        yield str(error)


def _check_entry(path: Path, file: h5py.File, name: str) -> Iterator[str]:
    try:
        entry = guarded.group_at(file, name, "NXentry")
        for group in ("data", "preview"):
            if group in entry:
                yield from _damaged(path, guarded.group_at(entry, group, "NXdata"))
    except ArchiveError as error:
        yield str(error)


def _damaged(path: Path, data: h5py.Group) -> Iterator[str]:
    plotted = [guarded.attribute(data, "signal"), *guarded.text_list(data, "auxiliary_signals")]
    for name in ["time", *plotted]:
        try:
            with guarded.guarded(path, f"{data.name}/{name}"):
                guarded.check_samples(guarded.samples_at(data, name))
        except ArchiveError as error:
            yield str(error)


def _channel(data: h5py.Group, info: ChannelInfo, length: int) -> Channel:
    dataset = guarded.samples_at(data, info.name)
    if dataset.shape[0] != length:
        raise ArchiveError(
            f"{data.file.filename}: {data.name}/{info.name}: has {dataset.shape[0]} samples, "
            f"and time has {length}"
        )
    return info.with_samples(guarded.read_samples(dataset))
