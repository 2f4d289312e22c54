"""Writing a run: a folder while it is in progress, one file when it is sealed."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import NDArray

from campaign.archive.files import sync_folder, write_atomically
from campaign.archive.header import FORMAT, PARTIAL, SEALED, PlannedTrial, RunHeader, RunStatus
from campaign.archive.journal import (
    JOURNAL,
    Journal,
    RunEnded,
    RunStarted,
    TrialAbandoned,
    TrialFinished,
)
from campaign.archive.run_folder import HEADER, PLAN
from campaign.errors import UsageError
from campaign.trial import ChannelInfo, Ending, Event, SafeState, Trial, canonical_json

if TYPE_CHECKING:
    from campaign.archive.trial_file import TrialFile

Array = NDArray[np.float64]


class TrialWriter:
    """Takes one trial's recording: a `campaign.trial.Recorder` that ends in a file.

    Use it from one thread; several may be open at once. End it with `finish` or `abandon`.
    """

    def __init__(self, trial: Trial, file: TrialFile, journal: Journal) -> None:
        self._trial = trial
        self._file = file
        self._journal = journal
        self._open = True

    def start(self, channels: tuple[ChannelInfo, ...]) -> None:
        self._file.start(channels)

    def append(self, time: Array, block: Array) -> None:
        self._file.append(time, block)

    def event(self, event: Event) -> None:
        self._file.event(event)

    @property
    def is_open(self) -> bool:
        """Whether it was neither finished nor abandoned."""
        return self._open

    def finish(self, ending: Ending, started: str, ended: str) -> None:
        """Keep the trial. When this returns, no crash can lose it.

        Args:
            ending: however it ended: a failed trial is kept too.
            started, ended: ISO 8601 with a time zone.

        Raises:
            ArchiveError: it could not be written; nothing of it remains.
        """
        self._open = False
        file = self._file.close(ending, started, ended)
        self._journal.append(
            TrialFinished(
                at=ended,
                trial=self._trial.number,
                file=file.name,
                sha256=file.sha256,
                bytes=file.bytes,
                outcome=ending.outcome,
                reason=ending.reason,
                safe_state=ending.safe_state,
            )
        )

    def abandon(self, at: str, reason: str = "") -> None:
        """Keep nothing of the trial but that it was begun."""
        if not self._open:
            return
        self._open = False
        self._file.discard()
        self._journal.append(TrialAbandoned(at=at, trial=self._trial.number, reason=reason))


class RunWriter:
    """Writes one run: `create` it, `begin` each trial, `seal` it. Threads may share it."""

    def __init__(self, folder: Path, journal: Journal) -> None:
        self._folder = folder
        self._journal = journal
        self._lock = threading.Lock()
        self._writers: list[TrialWriter] = []

    @classmethod
    def create(cls, results: Path, header: RunHeader, trials: Sequence[Trial]) -> Self:
        """Begin a run in `results`, which is made if need be.

        Raises:
            UsageError: the folder cannot be made or written, or has a run of that name.
        """
        folder = results / f"{header.name}{PARTIAL}"
        if (results / f"{header.name}{SEALED}").exists():
            raise UsageError(f"{results}: there is a run {header.name!r} already")
        header = header.model_copy(update={"trials": len(trials)})
        try:
            results.mkdir(parents=True, exist_ok=True)
            folder.mkdir()
            _write_header(folder, header, trials)
            journal = Journal(folder / JOURNAL)
            sync_folder(folder)
            sync_folder(results)
        except FileExistsError:
            if folder.is_dir():
                raise UsageError(f"{results}: there is a run {header.name!r} already") from None
            raise UsageError(f"{results}: is not a folder; choose another --results") from None
        except OSError as error:
            raise UsageError(
                f"{results}: cannot keep results there: {error.strerror}; choose another --results"
            ) from None
        journal.append(
            RunStarted(at=header.created, run=header.name, format=FORMAT, trials=len(trials))
        )
        return cls(folder, journal)

    @property
    def folder(self) -> Path:
        """Where the run lies while it is in progress."""
        return self._folder

    def begin(self, trial: Trial) -> TrialWriter:
        """A writer for `trial`. Raises ArchiveError when its file cannot be written."""
        from campaign.archive.trial_file import TrialFile

        writer = TrialWriter(trial, TrialFile(self._folder, trial), self._journal)
        with self._lock:
            self._writers = [w for w in self._writers if w.is_open] + [writer]
        return writer

    def seal(
        self,
        status: RunStatus,
        reason: str = "",
        safe_state: SafeState = SafeState.CONFIRMED,
        *,
        ended: str,
    ) -> Path:
        """Close the run, however it ended, and make one file of it; returns its path.

        Trials that are still open are abandoned. `ended` is ISO 8601 with a time zone.

        Raises:
            ArchiveError: no file could be made; the folder stays, with all that was finished.
        """
        from campaign.archive.sealing import seal_folder

        with self._lock:
            for writer in self._writers:
                writer.abandon(ended, "the run ended")
        self._journal.append(
            RunEnded(at=ended, status=status, reason=reason, safe_state=safe_state)
        )
        self._journal.close()
        return seal_folder(self._folder)


def _write_header(folder: Path, header: RunHeader, trials: Sequence[Trial]) -> None:
    document = {"format": FORMAT, "header": header.model_dump(mode="json")}
    lines = (canonical_json(PlannedTrial.of(t).model_dump(mode="json")) + "\n" for t in trials)
    write_atomically(folder / PLAN, "".join(lines))
    write_atomically(folder / HEADER, canonical_json(document) + "\n")
