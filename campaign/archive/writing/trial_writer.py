"""Writing one trial of a run, and its journal line."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from campaign.archive.layout.files import publish_all, why
from campaign.archive.layout.journal import Entry, TrialAbandoned, TrialFinished, utc_now
from campaign.archive.reading.archived_metrics import trial_measured
from campaign.errors import ArchiveError
from campaign.policy import KEEP_ALL, NotKept, SampleRetention
from campaign.recording import Array, ChannelInfo, Ending, Event
from campaign.stopwatch import UNTIMED, Timing, Work
from campaign.trial import Trial

if TYPE_CHECKING:
    from campaign.archive.reading.archived_metrics import Measure
    from campaign.archive.reading.archived_trial import ArchivedTrial
    from campaign.archive.writing.trial_file import Publish


class FolderWriter:
    """Writer of trials into the folder of a run, for a process without the journal.

    Finished trials become valid when `publish` puts them on the disk together.

    Args:
        folder: folder of the run.
        attempts: number of this attempt at each trial, by trial number.
    """

    def __init__(self, folder: Path, attempts: Mapping[int, int], timing: Timing = UNTIMED) -> None:
        self._folder = folder
        self._attempts = attempts
        self._timing = timing
        self._entries: list[Entry] = []
        self._files: list[tuple[Path, Path]] = []

    def begin(self, trial: Trial, keeping: SampleRetention = KEEP_ALL) -> TrialWriter:
        """As `RunWriter.begin`."""
        note, attempt = self._entries.append, self._attempts[trial.number]

        def publish(part: Path, final: Path) -> Path:
            self._files.append((part, final))
            return part

        not_kept = keeping.rule(trial, attempt)
        return TrialWriter(self._folder, trial, attempt, note, self._timing, not_kept, publish)

    def publish(self) -> None:
        """Put the finished trials on the disk. If it raises ArchiveError, none is valid."""
        from campaign.archive.writing.trial_file import lost_trial

        files, self._files = self._files, []
        try:
            with self._timing.span(Work.TRIAL_FILES):
                publish_all(files)
        except OSError as error:
            for part, _ in files:
                with contextlib.suppress(OSError):
                    part.unlink(missing_ok=True)
            raise lost_trial(files[0][0], error, count=len(files)) from None

    def take_files(self) -> dict[str, bytes]:
        """Contents of the finished trials, by file name; the files are removed from the folder."""
        files, self._files = self._files, []
        contents = {final.name: part.read_bytes() for part, final in files}
        for part, _ in files:
            part.unlink()
        return contents

    def take_entries(self) -> tuple[Entry, ...]:
        """The journal entries since the last call."""
        taken = tuple(self._entries)
        self._entries.clear()
        return taken


class TrialWriter:
    """Writer of one trial's recording to a file (a `campaign.recording.Recorder`).

    Use it from one thread; several may be open at once. End it with `finish` or `abandon`.

    Attributes:
        attempt: number of this attempt, from 1.
        is_open: whether it was neither finished nor abandoned.
    """

    def __init__(
        self,
        folder: Path,
        trial: Trial,
        attempt: int,
        note: Callable[[Entry], None],
        timing: Timing,
        not_kept: NotKept | None = None,
        publish: Publish | None = None,
    ) -> None:
        """Begin the trial's file in the folder of its run; see `RunWriter.begin`.

        `note` adds a line to the run's journal.
        """
        from campaign.archive.writing.trial_file import TrialFile

        self.attempt = attempt
        self.is_open = True
        self._trial = trial
        self._note = note
        self._timing = timing
        self._kept: tuple[TrialFinished, ArchivedTrial] | None = None
        with timing.span(Work.TRIAL_FILES):
            self._file = TrialFile(folder, trial, attempt, not_kept, publish)

    def start(self, channels: tuple[ChannelInfo, ...]) -> None:
        self._file.start(channels)

    def append(self, time: Array, block: Array) -> None:
        with self._timing.span(Work.TRIAL_FILES):
            self._file.append(time, block)

    def event(self, event: Event) -> None:
        self._file.event(event)

    def finish(
        self,
        ending: Ending,
        started: str,
        ended: str,
    ) -> None:
        """Archive the trial. After the return, no crash can lose it; with a `FolderWriter`, after
        `publish`.

        Args:
            ending: any ending: a failed trial is archived too.
            started, ended: ISO 8601 with a time zone.

        Raises:
            ArchiveError: the file could not be written and was removed.
        """
        self.is_open = False
        with self._timing.span(Work.TRIAL_FILES):
            finished, archived = self._file.close(ending, started, ended)
            self._note(finished)
        self._kept = finished, archived

    def measure(self, measure: Measure) -> str:
        """Measure the metrics of the finished trial and add them to the journal.

        The trial's file stays unchanged.

        Returns:
            Reason why nothing was measured, in one line; empty if measured, or not attempted.

        Raises:
            ArchiveError: the journal cannot be written.
        """
        if self._kept is None:
            raise RuntimeError(f"{self._trial.name}: is measured before it is finished")
        finished, archived = self._kept
        if archived.not_kept or not archived.channels():
            return ""
        metrics = measure(archived)
        try:
            if metrics.estimates:
                self._note(trial_measured(utc_now(), finished, metrics))
        except ArchiveError:
            raise
        except Exception as error:  # noqa: BLE001 - metrics of a plug-in may not be serializable
            return f"what was measured cannot be kept: {type(error).__name__}: {why(error)}"
        return metrics.problem

    def abandon(self, at: str, reason: str = "") -> None:
        """Discard the trial; only its start is noted in the journal."""
        if not self.is_open:
            return
        self.is_open = False
        self._file.discard()
        self._note(TrialAbandoned(at=at, trial=self._trial.number, reason=reason))
