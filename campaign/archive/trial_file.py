"""One trial's file while it is written, and the layout of a trial in every archive.

`trial-00017.nxs` holds one NXentry called `trial_00017` (NeXus allows no hyphen in a name), which
sealing copies as it is. A trial file is therefore a small archive of its own: any NeXus viewer
shows what is left of a killed run.
"""

from __future__ import annotations

import contextlib
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from campaign.archive import hdf5, nexus
from campaign.archive.files import PART, publish, sha256_of, why
from campaign.archive.header import SEALED
from campaign.archive.preview import PREVIEW_POINTS, Preview
from campaign.channels import FRICTION_TORQUE, GYRO_RATE, RELATIVE_RATE
from campaign.errors import ArchiveError, BackendError
from campaign.trial import ChannelInfo, Ending, Event, Trial, canonical_json

Array = NDArray[np.float64]

TELLING = {
    "rate": GYRO_RATE,
    "torque": RELATIVE_RATE,
    "prescribed": FRICTION_TORQUE,
    "spring": RELATIVE_RATE,
}
"""By a task's mode, the channel that the default plot shows; else it is the first one."""

_CHANNEL_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,62}")


def entry_name(trial_number: int) -> str:
    """Name of a trial's group: `trial_00017` for the trial that is called `trial-00017`."""
    return f"trial_{trial_number:05d}"


def earlier_entry_name(trial_number: int, attempt: int) -> str:
    """Name, in a sealed run, of an attempt that a later one replaced: `trial_00017_attempt_1`."""
    return f"{entry_name(trial_number)}_attempt_{attempt}"


def file_name(trial: Trial, attempt: int) -> str:
    """Name of a trial's file: `trial-00017.nxs`, and `trial-00017-2.nxs` for a second attempt."""
    return f"{trial.name}{f'-{attempt}' if attempt > 1 else ''}{SEALED}"


@dataclass(frozen=True)
class FinishedFile:
    """A trial file that is whole and on the disk."""

    name: str
    sha256: str
    bytes: int


class TrialFile:
    """Takes a trial's samples as they come (a `Recorder`); closed, it is whole and on the disk."""

    def __init__(self, folder: Path, trial: Trial, attempt: int = 1) -> None:
        self._trial = trial
        self._final = folder / file_name(trial, attempt)
        self._part = self._final.with_name(self._final.name + PART)
        self._channels: tuple[ChannelInfo, ...] = ()
        self._shown = 0
        self._columns: hdf5.SampleColumns | None = None
        self._preview = Preview()
        self._events: list[Event] = []
        try:
            self._file = hdf5.create_file(self._part)
        except OSError as error:
            raise ArchiveError(f"{self._part}: cannot be written: {why(error)}") from None
        self._entry = hdf5.make_group(self._file, entry_name(trial.number), "NXentry")

    def start(self, channels: tuple[ChannelInfo, ...]) -> None:
        """Announce the channels. See `TELLING` for the one that the default plot shows."""
        if self._columns is not None:
            raise BackendError(f"{self._trial.name}: the channels were announced twice")
        _check_names(self._trial, channels)
        self._channels = channels
        shown = TELLING[self._trial.task.mode]
        names = [channel.name for channel in channels]
        self._shown = names.index(shown) if shown in names else 0
        others = [name for name in names if name != names[self._shown]]
        data = _plot_group(self._entry, "data", self._trial, names[self._shown], others)
        attributes = {"time": _time_attributes()} | {c.name: _attributes(c) for c in channels}
        self._columns = hdf5.SampleColumns(data, attributes)

    def append(self, time: Array, block: Array) -> None:
        """Add samples: `time` (n,) in s, `block` (channels, n); ArchiveError on a full disk."""
        if self._columns is None:
            raise BackendError(f"{self._trial.name}: samples came before the channels' names")
        if time.ndim != 1 or block.shape != (len(self._channels), len(time)):
            raise BackendError(
                f"{self._trial.name}: samples of shape {block.shape} do not fit times of shape "
                f"{time.shape} and {len(self._channels)} channels"
            )
        with self._writing():
            for chunk in self._columns.append([time, *block]):
                self._add_to_preview(chunk)

    def event(self, event: Event) -> None:
        self._events.append(event)

    def close(self, ending: Ending, started: str, ended: str) -> FinishedFile:
        """Write the rest, put it on the disk and give the file its real name."""
        with self._writing():
            self._finish_samples()
            _write_record(self._entry, self._trial, ending, self._channels, self._events)
            nexus.write_definition(self._entry, self._trial.bench, self._channels)
            hdf5.put_text(self._entry, "title", self._trial.label)
            hdf5.put_text(self._entry, "entry_identifier", self._trial.name)
            hdf5.put_text(self._entry, "start_time", started)
            hdf5.put_text(self._entry, "end_time", ended)
            write_root(self._file, started, self._entry)
            self._file.close()
            digest, size = sha256_of(self._part), self._part.stat().st_size
            publish(self._part, self._final)
        return FinishedFile(self._final.name, digest, size)

    def discard(self) -> None:
        """Leave nothing of it. Never fails: what cannot be removed is no archive by its name."""
        with contextlib.suppress(OSError, RuntimeError, ValueError):
            self._file.close()
        with contextlib.suppress(OSError):
            self._part.unlink(missing_ok=True)

    def _finish_samples(self) -> None:
        if self._columns is None:
            return
        rest = self._columns.finish()
        self._add_to_preview(rest)
        shown = "data"
        if self._columns.length > PREVIEW_POINTS:
            shown = "preview"
            channel = self._channels[self._shown]
            _write_preview(self._entry, self._trial, channel, self._preview)
        hdf5.put_attribute(self._entry, "default", shown)

    def _add_to_preview(self, rows: Array) -> None:
        self._preview.add(rows[0], rows[1 + self._shown])

    @contextlib.contextmanager
    def _writing(self) -> Iterator[None]:
        """A failure to write leaves no part file behind and says which trial is lost."""
        try:
            yield
        except (OSError, RuntimeError, ValueError) as error:
            self.discard()
            raise ArchiveError(
                f"{self._part}: cannot be written: {why(error)}; this trial is not archived, "
                "the finished ones are"
            ) from None


def write_root(file: h5py.File, created: str, shown: h5py.Group | None) -> None:
    """The attributes of a file's root; `shown` is the entry that viewers open first."""
    from campaign import __version__

    hdf5.put_attribute(file, "NX_class", "NXroot")
    hdf5.put_attribute(file, "creator", "campaign")
    hdf5.put_attribute(file, "creator_version", __version__)
    hdf5.put_attribute(file, "file_time", created)
    if shown is not None:
        hdf5.put_attribute(file, "default", shown.name.lstrip("/"))


def _write_record(
    entry: h5py.Group,
    trial: Trial,
    ending: Ending,
    channels: tuple[ChannelInfo, ...],
    events: list[Event],
) -> None:
    record = hdf5.make_group(entry, "record", "NXcollection")
    hdf5.put_text(record, "trial", canonical_json(trial.model_dump(mode="json")))
    hdf5.put_text(record, "fingerprint", trial.fingerprint)
    hdf5.put_text(record, "outcome", ending.outcome)
    hdf5.put_text(record, "reason", ending.reason)
    hdf5.put_text(record, "safe_state", ending.safe_state)
    hdf5.put_text(record, "fault", ending.fault or "")
    hdf5.put_text(record, "telemetry", canonical_json(_plain(ending.telemetry)))
    hdf5.put_text(record, "channels", canonical_json([_described(channel) for channel in channels]))
    told = [{"time": float(event.time), "text": event.text} for event in events]
    hdf5.put_text(record, "events", canonical_json(told))


def _described(channel: ChannelInfo) -> dict[str, Any]:
    """What there is to say of a channel; its own rate only where it has one."""
    return {name: value for name, value in vars(channel).items() if value is not None}


def _plain(value: Any) -> Any:
    """`value` as JSON has it: what a backend measured of itself must not cost the trial."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, (bool, int, str)):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else str(value)
    return str(value)


def _write_preview(entry: h5py.Group, trial: Trial, channel: ChannelInfo, preview: Preview) -> None:
    group = _plot_group(entry, "preview", trial, channel.name, [])
    times, values = preview.points()
    attributes = {"time": _time_attributes(), channel.name: _attributes(channel)}
    columns = hdf5.SampleColumns(group, attributes)
    columns.append([times, values])
    columns.finish()


def _plot_group(
    entry: h5py.Group, name: str, trial: Trial, signal: str, others: list[str]
) -> h5py.Group:
    group = hdf5.make_group(entry, name, "NXdata")
    hdf5.put_attribute(group, "signal", signal)
    if others:
        group.attrs["auxiliary_signals"] = others
    group.attrs["axes"] = ["time"]
    group.attrs["time_indices"] = np.array([0], dtype="<i4")
    hdf5.put_text(group, "title", trial.label)
    return group


def _attributes(channel: ChannelInfo) -> dict[str, str]:
    return {
        "units": channel.unit,
        "long_name": f"{channel.label} ({channel.unit})" if channel.unit else channel.label,
    }


def _time_attributes() -> dict[str, str]:
    return {"units": "s", "long_name": "Time (s)"}


def _check_names(trial: Trial, channels: tuple[ChannelInfo, ...]) -> None:
    names = [channel.name for channel in channels]
    if not names:
        raise BackendError(f"{trial.name}: a recording needs at least one channel")
    for name in names:
        if not _CHANNEL_NAME.fullmatch(name) or name == "time" or names.count(name) > 1:
            raise BackendError(
                f"{trial.name}: {name!r} cannot name a channel: letters, digits and '_', "
                "not 'time', and each once"
            )
    for channel in channels:
        rate = channel.own_rate
        if rate is not None and not (math.isfinite(rate) and rate > 0):
            raise BackendError(f"{trial.name}: {channel.name}: its own rate is {rate} Hz")
