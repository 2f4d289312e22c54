"""Writing one trial of a run, and its journal line."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import NDArray

from campaign.archive.layout.files import publish_all, why
from campaign.archive.layout.journal import Entry, TrialAbandoned, TrialFinished, utc_now
from campaign.archive.reading.archived_metrics import trial_measured
from campaign.errors import ArchiveError
from campaign.estimate import Estimate, Window
from campaign.policy import KEEP_ALL, NotKept, SampleRetention
from campaign.recording import ChannelInfo, Ending, Event
from campaign.stopwatch import UNTIMED, Timing, Work
from campaign.trial import Trial

if TYPE_CHECKING:
    from campaign.archive.reading.archived_metrics import Measure
    from campaign.archive.reading.archived_trial import ArchivedTrial
    from campaign.archive.writing.trial_file import Publish, TrialFile

Array = NDArray[np.float64]


class FolderWriter:
    """Writes trials into the folder of a run whose journal another process has.

    What is finished counts once `publish` has put it on the disk, together.

    Args:
        folder: of the run.
        attempts: how often each trial is executed with this one, by number.
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
        return TrialWriter.open(self._folder, trial, attempt, note, self._timing, not_kept, publish)

    def publish(self) -> None:
        """Put the trials on the disk that were finished. Raises ArchiveError: none counts."""
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
        """The content of the trials that were finished, by file; nothing stays in the folder."""
        files, self._files = self._files, []
        found = {final.name: part.read_bytes() for part, final in files}
        for part, _ in files:
            part.unlink()
        return found

    def take_entries(self) -> tuple[Entry, ...]:
        """The journal entries since the last call."""
        taken = tuple(self._entries)
        self._entries.clear()
        return taken


class TrialWriter:
    """Takes one trial's recording: a `campaign.recording.Recorder` that ends in a file.

    Use it from one thread; several may be open at once. End it with `finish` or `abandon`.
    """

    def __init__(
        self,
        trial: Trial,
        attempt: int,
        file: TrialFile,
        note: Callable[[Entry], None],
        timing: Timing = UNTIMED,
    ) -> None:
        """`note` puts a line into the run's journal."""
        self._trial = trial
        self._attempt = attempt
        self._file = file
        self._note = note
        self._timing = timing
        self._open = True
        self._kept: tuple[TrialFinished, ArchivedTrial] | None = None

    @classmethod
    def open(
        cls,
        folder: Path,
        trial: Trial,
        attempt: int,
        note: Callable[[Entry], None],
        timing: Timing,
        not_kept: NotKept | None = None,
        publish: Publish | None = None,
    ) -> Self:
        """Begin the trial's file in the folder of its run; see `RunWriter.begin`."""
        from campaign.archive.writing.trial_file import TrialFile

        with timing.span(Work.TRIAL_FILES):
            file = TrialFile(folder, trial, attempt, not_kept, publish)
        return cls(trial, attempt, file, note, timing)

    @property
    def attempt(self) -> int:
        """How often the trial is executed with this one, from 1."""
        return self._attempt

    def start(self, channels: tuple[ChannelInfo, ...]) -> None:
        self._file.start(channels)

    def append(self, time: Array, block: Array) -> None:
        with self._timing.span(Work.TRIAL_FILES):
            self._file.append(time, block)

    def event(self, event: Event) -> None:
        self._file.event(event)

    @property
    def is_open(self) -> bool:
        """Whether it was neither finished nor abandoned."""
        return self._open

    def finish(
        self,
        ending: Ending,
        started: str,
        ended: str,
        *,
        windows: Iterable[Window] = (),
        estimates: Iterable[Estimate] = (),
    ) -> None:
        """Keep the trial. When this returns, no crash can lose it; of a `FolderWriter`, once that
        has published it.

        Args:
            ending: however it ended: a failed trial is kept too.
            started, ended: ISO 8601 with a time zone.
            windows, estimates: what was found of it meanwhile; kept with it.

        Raises:
            ArchiveError: it could not be written; nothing of it remains.
        """
        self._open = False
        with self._timing.span(Work.TRIAL_FILES):
            file = self._file.close(ending, started, ended, windows, estimates)
            finished = TrialFinished(
                at=ended,
                trial=self._trial.number,
                attempt=self._attempt,
                file=file.name,
                sha256=file.sha256,
                record=file.record,
                bytes=file.bytes,
                outcome=ending.outcome,
                reason=ending.reason,
                safe_state=ending.safe_state,
            )
            self._note(finished)
        self._kept = finished, file.archived

    def measure(self, measure: Measure) -> str:
        """Keep what `measure` finds in the samples of the trial, which is finished.

        What is kept is a line of the journal: the trial's file is whole and stays as it is.

        Returns:
            Why nothing was measured, in one line; empty when something was, or nobody looked.

        Raises:
            ArchiveError: the journal cannot be written.
        """
        if self._kept is None:
            raise RuntimeError(f"{self._trial.name}: is measured before it is finished")
        finished, archived = self._kept
        if archived.not_kept or not archived.channels():
            return ""
        found = measure(archived)
        try:
            if found.estimates:
                self._note(trial_measured(utc_now(), finished, found))
        except ArchiveError:
            raise
        except Exception as error:  # noqa: BLE001 - a plug-in's, of which no line can be made
            return f"what was measured cannot be kept: {type(error).__name__}: {why(error)}"
        return found.problem

    def abandon(self, at: str, reason: str = "") -> None:
        """Keep nothing of the trial but that it was begun."""
        if not self._open:
            return
        self._open = False
        self._file.discard()
        self._note(TrialAbandoned(at=at, trial=self._trial.number, reason=reason))
