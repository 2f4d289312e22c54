"""Writing a run: a folder while in progress, one file after sealing."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Self

from campaign.archive.layout.header import RunHeader
from campaign.archive.layout.journal import (
    Decision,
    Entry,
    Journal,
    OperatorStep,
    RunEnded,
    RunResumed,
    TrialFinished,
    TrialMeasured,
    utc_now,
)
from campaign.archive.layout.names import PARTIAL, SEALED
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.archived_metrics import with_metrics
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.writing.new_run_folder import make_folder
from campaign.archive.writing.resume_run import reopen
from campaign.archive.writing.run_lock import RunLock
from campaign.archive.writing.run_names import writable
from campaign.archive.writing.trial_writer import TrialWriter
from campaign.errors import UsageError
from campaign.estimate import Estimate
from campaign.policy import KEEP_ALL, SampleRetention
from campaign.recording import Outcome, SafeState
from campaign.stopwatch import UNTIMED, Timing, Work
from campaign.trial import Trial

__all__ = ["RunWriter", "TrialWriter"]


class RunWriter:
    """Writer of one run: `create` or `resume` it, `begin` each trial, `seal` it.

    Thread-safe. Its lock excludes other processes.

    Attributes:
        timing: sink of the time spent on trial files and journal, and on the sealed file.
    """

    def __init__(self, folder: Path, journal: Journal, lock: RunLock) -> None:
        from campaign.archive.writing.seal_run import Sealer

        self.timing: Timing = UNTIMED
        self._shown = folder  # as typed by the user
        self._folder = folder.absolute()  # a plug-in may change the working directory
        self._journal = journal
        self._run_lock = lock
        self._lock = threading.Lock()
        self._writers: list[TrialWriter] = []
        self._last: dict[int, TrialFinished] = {}
        self._measured: dict[str, int] = {}  # places in the journal, by the record's digest
        self._sealer = Sealer(self._folder)

    @classmethod
    def create(
        cls, results: Path, header: RunHeader, trials: Sequence[Trial], lock: RunLock | None = None
    ) -> Self:
        """Begin a run in `results`, which is created if missing.

        `lock` is the run's lock, if the caller has it already (`run_names.reserved_name`).

        Raises:
            UsageError: the folder cannot be made or written, or has a run of that name.
        """
        folder = results / f"{header.name}{PARTIAL}"
        with writable(results):
            lock = lock or RunLock.acquire(results, header.name)
            try:
                if folder.exists() or folder.with_suffix(SEALED).exists():
                    raise UsageError(f"{results}: there is a run {header.name!r} already")
                journal = make_folder(folder, header, trials)
            except BaseException:
                lock.release()
                raise
        return cls(folder, journal, lock)

    @classmethod
    def resume(
        cls,
        path: Path,
        *,
        at: str,
        host: Mapping[str, str],
        versions: Mapping[str, str],
        command: Sequence[str],
        changes: Sequence[str] = (),
    ) -> Self:
        """Resume a run that was interrupted, killed or ended by a fault.

        A sealed run is replaced by its folder. `finished` lists the finished trials. A repeated
        trial gets a new attempt; the last one is used.

        Args:
            path: the folder, or the sealed file.
            at, host, versions, command, changes: for the journal; see `journal.RunResumed`.

        Raises:
            UsageError: the run cannot be resumed, or another process writes it.
            ArchiveError: the run is damaged (with the file) or cannot be written; it is unchanged.
        """
        folder, story, journal, lock = reopen(path)
        writer = cls(folder, journal, lock)
        writer._last = dict(story.finished)
        for finished in story.attempts:
            writer._sealer.add(finished)
        writer._measured = {digest: line.start for digest, line in story.measured.items()}
        try:
            journal.append(
                RunResumed(
                    at=at,
                    host=dict(host),
                    versions=dict(versions),
                    command=tuple(command),
                    changes=tuple(changes),
                )
            )
        except BaseException:
            writer.close()
            raise
        return writer

    @property
    def folder(self) -> Path:
        """Folder of the run while it is in progress."""
        return self._shown

    @property
    def finished(self) -> Mapping[int, Outcome]:
        """Outcome of the last attempt at each trial, by number, also from before a resume."""
        with self._lock:
            return {number: self._last[number].outcome for number in sorted(self._last)}

    def begin(self, trial: Trial, keeping: SampleRetention = KEEP_ALL) -> TrialWriter:
        """A writer for the next attempt at `trial`. Raises ArchiveError if it cannot be written.

        Execute a trial in one thread at a time. `keeping` decides whether its samples are kept;
        their digests and all other data always are.
        """
        attempt, note = self.attempt(trial), self.note
        not_kept = keeping.rule(trial, attempt)
        writer = TrialWriter(self._folder, trial, attempt, note, self.timing, not_kept)
        with self._lock:
            self._writers = [w for w in self._writers if w.is_open] + [writer]
        return writer

    def attempt(self, trial: Trial) -> int:
        """Number of the next attempt at `trial`, from 1."""
        with self._lock:
            last = self._last.get(trial.number)
        return last.attempt + 1 if last else 1

    def decision(self, decision: str, reason: str, trial: int | None = None) -> None:
        """Note a decision outside the plan."""
        self.note(Decision(at=utc_now(), trial=trial, decision=decision, reason=reason))

    def archived(self, number: int) -> ArchivedTrial:
        """The last finished attempt at a trial of this run, read from its file, with its metrics.

        Raises ArchiveError if it is unreadable, LookupError if there is none.
        """
        from campaign.archive.reading.folder import read_trial_file

        with self._lock:
            finished = self._last[number]
            place = self._measured.get(finished.record)
        archived = read_trial_file(self._folder / finished.file, finished)
        return with_metrics(archived, self._metrics_at(place))

    def metrics(self) -> dict[int, tuple[Estimate, ...]]:
        """Metrics of the last finished attempt at each trial, by number."""
        with self._lock:
            places = {
                number: self._measured.get(last.record) for number, last in self._last.items()
            }
        lines = ((number, self._metrics_at(place)) for number, place in places.items())
        return {number: each.estimates for number, each in lines if each is not None}

    def _metrics_at(self, place: int | None) -> TrialMeasured | None:
        """Metrics at an offset of the journal; not cached, because all would fill the memory."""
        entry = None if place is None else self._journal.entry(place)
        return entry if isinstance(entry, TrialMeasured) else None

    def operator_step(self, trial: int, step: str, answer: str) -> None:
        """Note a step requested from the operator before `trial`, and the answer."""
        self.note(OperatorStep(at=utc_now(), trial=trial, step=step, answer=answer))

    def seal(
        self,
        status: RunStatus,
        reason: str = "",
        safe_state: SafeState = SafeState.CONFIRMED,
        *,
        ended: str,
    ) -> Path:
        """Close the run with any status, and make one file of it; return its path.

        Open trials are abandoned. `ended` is ISO 8601 with a time zone.

        Raises:
            ArchiveError: sealing failed; the folder stays, with all finished trials.
        """
        try:
            self._abandon_open(ended)
            self.note(RunEnded(at=ended, status=status, reason=reason, safe_state=safe_state))
            self._journal.close()
            with self.timing.span(Work.SEALING):
                return self._shown.with_name(self._sealer.seal().name)
        finally:
            self.close()

    def close(self) -> None:
        """Release the run unsealed: another process may resume it."""
        self._sealer.discard()
        self._journal.close()
        self._run_lock.release()

    def _abandon_open(self, at: str) -> None:
        with self._lock:
            writers, self._writers = self._writers, []
        for writer in writers:
            writer.abandon(at, "the run ended")

    def note(self, *entries: Entry) -> None:
        """Add lines to the journal, all or none; the file of a finished trial must be on disk."""
        places = self._journal.append(*entries)
        for entry, place in zip(entries, places, strict=True):
            if isinstance(entry, TrialFinished):
                with self._lock:
                    self._last[entry.trial] = entry
                    self._sealer.add(entry)
            elif isinstance(entry, TrialMeasured):
                with self._lock:
                    self._measured[entry.record] = place

    def seal_next(self, fewest: int = 1) -> bool:
        """Copy the next finished trial into the sealed file if at least `fewest` wait.

        A copy takes 5 ms, and 6 ms per MB. Call it from one thread, while no bench moves.
        Returns whether a copy was tried.
        """
        with self.timing.span(Work.SEALING):
            return self._sealer.advance(fewest)
