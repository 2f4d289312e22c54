"""The file of one trial during writing: a `Recorder` of samples."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from campaign.archive.layout.checksums import series_digest
from campaign.archive.layout.files import PART, publish, why
from campaign.archive.layout.journal import TrialFinished
from campaign.archive.layout.names import entry_name, file_name
from campaign.archive.layout.packed_trial import PackedSeries, PackedTrial
from campaign.archive.layout.record import (
    EventRecord,
    PreviewRecord,
    SeriesRecord,
    TrialRecord,
    plain,
    shared_trees,
    trees_text,
)
from campaign.archive.reading.archived_samples import (
    TIME,
    MemorySamples,
    PackedSamples,
    trial_of_record,
)
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.writing.default_plot import Aim
from campaign.archive.writing.packed_file import PackedFile, SampleColumns
from campaign.archive.writing.preview import PREVIEW_POINTS, Preview
from campaign.channels import wrong_names
from campaign.errors import ArchiveError, BackendError
from campaign.policy import NotKept
from campaign.recording import Array, ChannelInfo, Ending, Event
from campaign.trial import Trial

Publish = Callable[[Path, Path], Path]
"""Publishes a file under its final name, at once or later with others; returns its present path."""
Written = tuple[int, str, list[SeriesRecord]]
"""Length of every series, digest of the time base, and the channels."""


class TrialFile:
    """Writer of a trial's samples during recording (a `Recorder`).

    `close` completes the file and publishes it, at once or later with others.
    """

    def __init__(
        self,
        folder: Path,
        trial: Trial,
        attempt: int = 1,
        not_kept: NotKept | None = None,
        publish: Publish | None = None,
    ) -> None:
        """`not_kept`: at the end, returns the reason to keep only digests; None: keep samples."""
        self._trial = trial
        self._attempt = attempt
        self._rule = not_kept
        self._not_kept = ""
        self._publish = publish or _publish_now
        self._final = folder / file_name(trial.number, attempt)
        self._part = self._final.with_name(self._final.name + PART)
        self._channels: tuple[ChannelInfo, ...] = ()
        self._shown = 0
        self._columns: SampleColumns | None = None
        self._held = np.empty((0, 0))  # buffered rows, if the ending decides on keeping samples
        self._count = 0  # number of samples in `_held`
        self._preview = Preview()
        self._events: list[Event] = []
        self._whole: Array | None = None  # a recording of one chunk
        try:
            self._file = PackedFile(self._part)
        except OSError as error:
            raise lost_trial(self._part, error) from None

    def start(self, channels: tuple[ChannelInfo, ...]) -> None:
        """Announce the channels."""
        if self._columns is not None:
            raise BackendError(f"{self._trial.name}: the channels were announced twice")
        _check_names(self._trial, channels)
        self._channels = channels
        names = [channel.name for channel in channels]
        self._shown = names.index(Aim.of(self._trial.task, self._trial.requires).channel(names))
        self._columns = SampleColumns((TIME.name, *names), self._file)
        self._held = np.empty((1 + len(names), 0))

    def append(self, time: Array, block: Array) -> None:
        """Add samples: `time` (n,) in s, `block` (channels, n). Raises ArchiveError (disk full)."""
        if self._columns is None:
            raise BackendError(f"{self._trial.name}: samples came before the channels' names")
        if time.ndim != 1 or block.shape != (len(self._channels), len(time)):
            raise BackendError(
                f"{self._trial.name}: samples of shape {block.shape} do not fit times of shape "
                f"{time.shape} and {len(self._channels)} channels"
            )
        if self._rule is not None:
            self._hold(time, block)
            return
        self._put(self._columns, [time, *block])

    def event(self, event: Event) -> None:
        self._events.append(event)

    def close(
        self, ending: Ending, started: str, ended: str
    ) -> tuple[TrialFinished, ArchivedTrial]:
        """Write the rest and publish the file.

        Returns the line for the journal, and the trial at the file's present path; a short
        recording is still in memory.
        """
        groups: dict[str, tuple[PackedSeries, ...]] = {}
        if self._rule is not None and self._columns is not None:
            self._not_kept = self._rule(ending)
            self._put_held(self._columns)
        with self._writing():
            series, preview = self._finish_samples(groups)
            trial, trees = shared_trees(self._trial)
            samples, time, channels = series or (None, "", [])
            record = TrialRecord(
                trial=trial,
                label=self._trial.label,
                fingerprint=self._trial.fingerprint,
                attempt=self._attempt,
                started=started,
                ended=ended,
                outcome=ending.outcome,
                reason=ending.reason,
                safe_state=ending.safe_state,
                fault=ending.fault,
                telemetry=plain(ending.telemetry),
                samples=samples,
                time=time,
                channels=tuple(channels),
                preview=preview,
                events=tuple(EventRecord(time=float(e.time), text=e.text) for e in self._events),
            )
            packed = PackedTrial(
                record=record.text,
                trees=trees_text(trees),
                not_kept=self._not_kept,
                groups=groups,
            )
            digest, size = self._file.finish(packed)
            path = self._publish(self._part, self._final)
        place = path, entry_name(self._trial.number), record
        kept = (
            PackedSamples(*place, self._not_kept)
            if self._whole is None
            else MemorySamples(*place, rows=self._whole)
        )
        finished = TrialFinished(
            at=ended,
            trial=self._trial.number,
            attempt=self._attempt,
            file=self._final.name,
            sha256=digest,
            record=record.sha256,
            bytes=size,
            outcome=ending.outcome,
            reason=ending.reason,
            safe_state=ending.safe_state,
        )
        return finished, trial_of_record(self._trial, kept)

    def discard(self) -> None:
        """Remove the file. Never fails: by its name, a remaining file is not an archive."""
        self._file.close()
        with contextlib.suppress(OSError):
            self._part.unlink(missing_ok=True)

    def _finish_samples(
        self, groups: dict[str, tuple[PackedSeries, ...]]
    ) -> tuple[Written | None, PreviewRecord | None]:
        """Write the rest of the samples; return their record data, and those of a preview."""
        if self._columns is None:
            return None, None
        if self._not_kept and self._whole is not None:
            return self._described(self._whole.shape[1], map(series_digest, self._whole)), None
        rest, digests = self._columns.finish()
        if rest.shape[1] == self._columns.length:
            self._whole = rest
        self._add_to_preview(rest)
        series = self._described(self._columns.length, digests)
        groups["data"] = self._columns.series
        if self._columns.length <= PREVIEW_POINTS:
            return series, None
        channel = self._channels[self._shown].name
        columns = SampleColumns((TIME.name, channel), self._file)
        columns.append(self._preview.points())
        _, (time, values) = columns.finish()
        groups["preview"] = columns.series
        preview = PreviewRecord(channel=channel, samples=columns.length, time=time, values=values)
        return series, preview

    def _described(self, length: int, digests: Iterable[str]) -> Written:
        time, *of_channels = digests
        pairs = zip(self._channels, of_channels, strict=True)
        return length, time, [SeriesRecord.of(*both) for both in pairs]

    def _put(self, columns: SampleColumns, rows: Sequence[Array]) -> None:
        with self._writing():
            for chunk in columns.append(rows):
                self._add_to_preview(chunk)

    def _hold(self, time: Array, block: Array) -> None:
        """Buffer samples until the trial ends; memory for the planned duration is allocated."""
        start, self._count = self._count, self._count + len(time)
        if self._count > self._held.shape[1]:
            planned = self._trial.task.samples + 1
            room = np.empty((1 + len(block), max(planned, 2 * start, self._count)))
            room[:, :start] = self._held[:, :start]
            self._held = room
        self._held[0, start : self._count] = time
        self._held[1:, start : self._count] = block

    def _put_held(self, columns: SampleColumns) -> None:
        """Write the buffered samples, unless only their digests are kept."""
        self._whole = self._held[:, : self._count]
        if not self._not_kept:
            self._put(columns, list(self._whole))

    def _add_to_preview(self, rows: Array) -> None:
        self._preview.add(rows[0], rows[1 + self._shown])

    @contextlib.contextmanager
    def _writing(self) -> Iterator[None]:
        """On a write error, remove the part file and raise ArchiveError for the lost trial."""
        try:
            yield
        except (OSError, RuntimeError, ValueError) as error:
            self.discard()
            raise lost_trial(self._part, error) from None


def _publish_now(part: Path, final: Path) -> Path:
    publish(part, final)
    return final


def lost_trial(part: Path, error: Exception, count: int = 1) -> ArchiveError:
    """Error for `count` trials that could not be written, the first as `part`."""
    if isinstance(error, FileNotFoundError) or not part.parent.is_dir():
        return ArchiveError(
            f"{part.parent}: is gone: it was moved or removed while the run went on; wherever it "
            "is now, it has the trials that had finished by then"
        )
    lost = "this trial is" if count == 1 else f"{count} trials are"
    return ArchiveError(
        f"{part}: cannot be written: {why(error)}; {lost} not archived, those before are"
    )


def _check_names(trial: Trial, channels: tuple[ChannelInfo, ...]) -> None:
    if wrong := wrong_names([channel.name for channel in channels]):
        raise BackendError(f"{trial.name}: {wrong}")
    for channel in channels:
        rate = channel.own_rate
        if rate is not None and not (math.isfinite(rate) and rate > 0):
            raise BackendError(f"{trial.name}: {channel.name}: its own rate is {rate} Hz")
