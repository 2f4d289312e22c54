"""One trial's file while it is written, and the layout of a trial in every archive.

`trial-00017.nxs` holds one NXentry called `trial_00017` (NeXus allows no hyphen in a name), which
sealing copies. A trial file is therefore a small archive of its own: any NeXus viewer shows what is
left of a killed run.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from campaign.archive.layout.entries import entry_name, file_name
from campaign.archive.layout.files import PART, publish, sha256_of, why
from campaign.archive.layout.record import (
    PreviewRecord,
    SeriesRecord,
    Trees,
    TrialRecord,
    make_record,
    shared_trees,
    trees_text,
)
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.reading.recorded import MemorySamples, trial_of_record
from campaign.archive.writing import hdf5
from campaign.archive.writing.default_plot import Aim, beside
from campaign.archive.writing.preview import PREVIEW_POINTS, Preview
from campaign.channels import wrong_names
from campaign.errors import ArchiveError, BackendError
from campaign.estimate import Estimate, Window
from campaign.recording import ChannelInfo, Ending, Event
from campaign.trial import Trial

Array = NDArray[np.float64]

Written = tuple[int, str, list[SeriesRecord]]
"""Length of every series, digest of the time base, and the channels."""


@dataclass(frozen=True)
class FinishedFile:
    """A trial file that is whole and on the disk, under its real name.

    Attributes:
        archived: the trial as the file has it; a short recording is still in memory.
        sha256: of the file.
        record: digest of the trial's record.
    """

    archived: ArchivedTrial
    sha256: str
    bytes: int
    record: str

    @property
    def name(self) -> str:
        return self.archived.path.name


class TrialFile:
    """Takes a trial's samples as they come (a `Recorder`); closed, it is whole and on the disk."""

    def __init__(self, folder: Path, trial: Trial, attempt: int = 1, not_kept: str = "") -> None:
        """`not_kept`: why of the samples only digests are to be kept; empty: all of them are."""
        self._trial = trial
        self._attempt = attempt
        self._not_kept = not_kept
        self._final = folder / file_name(trial.number, attempt)
        self._part = self._final.with_name(self._final.name + PART)
        self._channels: tuple[ChannelInfo, ...] = ()
        self._shown = 0
        self._columns: hdf5.SampleColumns | None = None
        self._preview = Preview()
        self._events: list[Event] = []
        self._whole: Array | None = None  # a recording that was one chunk
        try:
            self._file = hdf5.create_file(self._part)
        except OSError as error:
            raise _lost(self._part, error) from None
        self._entry = hdf5.make_group(self._file, entry_name(trial.number), "NXentry")
        hdf5.put_text(self._entry, "title", trial.label)

    def start(self, channels: tuple[ChannelInfo, ...]) -> None:
        """Announce the channels. `default_plot` says which one viewers show first."""
        if self._columns is not None:
            raise BackendError(f"{self._trial.name}: the channels were announced twice")
        _check_names(self._trial, channels)
        self._channels = channels
        names = [channel.name for channel in channels]
        aim = Aim.of(self._trial.task, self._trial.requires)
        self._shown = names.index(aim.channel(names))
        others = beside(channels[self._shown], channels)
        data = (
            None if self._not_kept else _plot_group(self._entry, "data", names[self._shown], others)
        )
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

    def close(
        self,
        ending: Ending,
        started: str,
        ended: str,
        windows: Iterable[Window] = (),
        estimates: Iterable[Estimate] = (),
    ) -> FinishedFile:
        """Write the rest, put it on the disk and give the file its real name."""
        with self._writing():
            series, preview = self._finish_samples()
            trial, trees = shared_trees(self._trial)
            record = make_record(
                trial,
                self._trial.label,
                self._trial.fingerprint,
                self._attempt,
                ending,
                (started, ended),
                self._events,
                series=series,
                preview=preview,
                windows=windows,
                estimates=estimates,
            )
            write_record(self._entry, record, record.text, trees, self._not_kept)
            write_root(self._file, started, self._entry)
            self._file.close()
            digest, size = sha256_of(self._part), self._part.stat().st_size
            publish(self._part, self._final)
        place = self._final, entry_name(self._trial.number), record, self._not_kept
        archived = trial_of_record(self._trial, *place)
        if self._whole is not None and not self._not_kept:
            archived = replace(archived, samples=MemorySamples(*place, rows=self._whole))
        return FinishedFile(archived, digest, size, record.sha256)

    def discard(self) -> None:
        """Leave nothing of it. Never fails: what cannot be removed is no archive by its name."""
        with contextlib.suppress(OSError, RuntimeError, ValueError):
            self._file.close()
        with contextlib.suppress(OSError):
            self._part.unlink(missing_ok=True)

    def _finish_samples(self) -> tuple[Written | None, PreviewRecord | None]:
        """What the record says of the samples, and of their preview where one was written."""
        if self._columns is None:
            return None, None
        rest, (time, *digests) = self._columns.finish()
        self._whole = rest if rest.shape[1] == self._columns.length else None
        self._add_to_preview(rest)
        told = zip(self._channels, digests, strict=True)
        series = self._columns.length, time, [SeriesRecord.of(*both) for both in told]
        if self._not_kept:
            return series, None
        long = self._columns.length > PREVIEW_POINTS
        hdf5.put_attribute(self._entry, "default", "preview" if long else "data")
        return series, self._write_preview() if long else None

    def _write_preview(self) -> PreviewRecord:
        channel = self._channels[self._shown]
        group = _plot_group(self._entry, "preview", channel.name, [])
        attributes = {"time": _time_attributes(), channel.name: _attributes(channel)}
        columns = hdf5.SampleColumns(group, attributes)
        columns.append(self._preview.points())
        _, (time, values) = columns.finish()
        return PreviewRecord(channel=channel.name, samples=columns.length, time=time, values=values)

    def _add_to_preview(self, rows: Array) -> None:
        self._preview.add(rows[0], rows[1 + self._shown])

    @contextlib.contextmanager
    def _writing(self) -> Iterator[None]:
        """A failure to write leaves no part file behind and says which trial is lost."""
        try:
            yield
        except (OSError, RuntimeError, ValueError) as error:
            self.discard()
            raise _lost(self._part, error) from None


def _lost(part: Path, error: Exception) -> ArchiveError:
    """Why a trial could not be written, and what that means for the others."""
    if not part.parent.is_dir():
        return ArchiveError(
            f"{part.parent}: is gone: it was moved or removed while the run went on; wherever it "
            "is now, it has the trials that had finished by then"
        )
    return ArchiveError(
        f"{part}: cannot be written: {why(error)}; this trial is not archived, those before are"
    )


def write_record(
    entry: h5py.Group, record: TrialRecord, text: str, trees: Trees, not_kept: str = ""
) -> None:
    """The record of a trial, as text, the trees that it names, and why samples are not there."""
    hdf5.put_text(entry, "start_time", record.started)
    hdf5.put_text(entry, "end_time", record.ended)
    kept = hdf5.make_group(entry, "record", "NXcollection")
    hdf5.put_text(kept, "json", text)
    hdf5.put_text(kept, "trees", trees_text(trees))
    if not_kept:
        hdf5.put_text(kept, "not_kept", not_kept)


def write_root(file: h5py.File, created: str, shown: h5py.Group | None) -> None:
    """The attributes of a file's root; `shown` is the entry that viewers open first."""
    from campaign import __version__

    hdf5.put_attribute(file, "NX_class", "NXroot")
    hdf5.put_attribute(file, "creator", "campaign")
    hdf5.put_attribute(file, "creator_version", __version__)
    hdf5.put_attribute(file, "file_time", created)
    if shown is not None:
        hdf5.put_attribute(file, "default", shown.name.lstrip("/"))


def _plot_group(entry: h5py.Group, name: str, signal: str, others: list[str]) -> h5py.Group:
    group = hdf5.make_group(entry, name, "NXdata")
    hdf5.put_attribute(group, "signal", signal)
    if others:
        group.attrs["auxiliary_signals"] = others
    group.attrs["axes"] = ["time"]
    group.attrs["time_indices"] = np.array([0], dtype="<i4")
    hdf5.link(entry, "title", group, "title")  # viewers look for it beside the samples
    return group


def _attributes(channel: ChannelInfo) -> dict[str, str]:
    return {"units": channel.unit, "long_name": channel.long_name}


def _time_attributes() -> dict[str, str]:
    return {"units": "s", "long_name": "Time (s)"}


def _check_names(trial: Trial, channels: tuple[ChannelInfo, ...]) -> None:
    if wrong := wrong_names([channel.name for channel in channels]):
        raise BackendError(f"{trial.name}: {wrong}")
    for channel in channels:
        rate = channel.own_rate
        if rate is not None and not (math.isfinite(rate) and rate > 0):
            raise BackendError(f"{trial.name}: {channel.name}: its own rate is {rate} Hz")
