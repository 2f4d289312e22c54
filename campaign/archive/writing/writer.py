"""Writing a run: a folder in progress, one file once sealed."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Self

from campaign.archive.layout.header import PARTIAL, SEALED, RunHeader, RunStatus
from campaign.archive.layout.journal import (
    Decision,
    Entry,
    Journal,
    OperatorStep,
    RunEnded,
    RunResumed,
    TrialFinished,
    TrialMeasured,
    TrialsFollowed,
    utc_now,
)
from campaign.archive.reading.archived_metrics import with_metrics
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.writing.new_run_folder import make_folder
from campaign.archive.writing.resume_run import reopen
from campaign.archive.writing.run_lock import RunLock
from campaign.archive.writing.trial_writer import TrialWriter
from campaign.errors import UsageError
from campaign.estimate import Estimate
from campaign.policy import KEEP_ALL, SampleRetention
from campaign.recording import Outcome, SafeState
from campaign.stopwatch import UNTIMED, Timing, Work
from campaign.trial import Trial

__all__ = ["RunWriter", "TrialWriter"]


class RunWriter:
    """Writes one run: `create` or `resume` it, `begin` each trial, `seal` it.

    Threads may share it. No other process can write the run meanwhile.

    Attributes:
        timing: told what is done for trial files and journal, and for the sealed file.
    """

    def __init__(self, folder: Path, journal: Journal, lock: RunLock) -> None:
        from campaign.archive.writing.seal_run import Sealer

        self.timing: Timing = UNTIMED
        self._shown = folder  # as it was typed
        self._folder = folder.absolute()  # whatever folder a plug-in goes to
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
        """Begin a run in `results`, which is made if need be.

        `lock` is the right to write it, where the caller has it already (`naming.reserved_name`).

        Raises:
            UsageError: the folder cannot be made or written, or has a run of that name.
        """
        folder = results / f"{header.name}{PARTIAL}"
        try:
            results.mkdir(parents=True, exist_ok=True)
            lock = lock or RunLock.acquire(results, header.name)
            try:
                if folder.exists() or folder.with_suffix(SEALED).exists():
                    raise UsageError(f"{results}: there is a run {header.name!r} already")
                journal = make_folder(folder, header, trials)
            except BaseException:
                lock.release()
                raise
        except (FileExistsError, NotADirectoryError):
            raise UsageError(f"{results}: is not a folder; choose another --results") from None
        except OSError as error:
            raise UsageError(
                f"{results}: cannot keep results there: {error.strerror}; choose another --results"
            ) from None
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
        """Go on with a run that was interrupted, killed or ended by a fault.

        A sealed run is opened up again: its folder takes its place. What was finished, `finished`
        tells; a trial that is begun again gets a further attempt, and the last one counts.

        Args:
            path: the folder, or the sealed file.
            at, host, versions, command, changes: for the journal; see `journal.RunResumed`.

        Raises:
            UsageError: there is nothing to go on with, or another process writes the run.
            ArchiveError: the run is damaged, named by file, or cannot be written. It is as it was.
        """
        folder, story, journal, lock = reopen(path)
        writer = cls(folder, journal, lock)
        writer._last = dict(story.finished)
        for finished in story.files:
            writer._sealer.add(finished)
        writer._measured = story.measured
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
        """Where the run lies while it is in progress."""
        return self._shown

    @property
    def finished(self) -> Mapping[int, Outcome]:
        """How the last attempt at each trial ended, by number; those of before a resume, too."""
        with self._lock:
            return {number: self._last[number].outcome for number in sorted(self._last)}

    def begin(self, trial: Trial, keeping: SampleRetention = KEEP_ALL) -> TrialWriter:
        """A writer for `trial`, the next attempt at it. Raises ArchiveError when there is no room.

        A trial is executed by one thread at a time. `keeping` says whether its samples are
        kept: their digests are, and all else that there is to say of it.
        """
        attempt, note = self.attempt(trial), self.note
        not_kept = keeping.rule(trial, attempt)
        writer = TrialWriter.open(self._folder, trial, attempt, note, self.timing, not_kept)
        with self._lock:
            self._writers = [w for w in self._writers if w.is_open] + [writer]
        return writer

    def attempt(self, trial: Trial) -> int:
        """Which one the next attempt at `trial` is, from 1."""
        with self._lock:
            last = self._last.get(trial.number)
        return last.attempt + 1 if last else 1

    def decision(
        self, decision: str, reason: str, trial: int | None = None, *, at: str = ""
    ) -> None:
        """Note what the run does besides its plan; `at` is now unless it is given."""
        self.note(Decision(at=at or utc_now(), trial=trial, decision=decision, reason=reason))

    def trials_followed(self, followed: TrialsFollowed) -> None:
        """Note which trials follow from others, before the first of them is begun."""
        self.note(followed)

    def archived(self, number: int) -> ArchivedTrial:
        """The last finished attempt at a trial of this run, read from its file, with its metrics.

        Raises ArchiveError when it cannot be read, LookupError when there is none.
        """
        from campaign.archive.reading.folder import read_trial_file

        with self._lock:
            finished = self._last[number]
            place = self._measured.get(finished.record)
        archived = read_trial_file(self._folder / finished.file, finished)
        return with_metrics(archived, self._told(place))

    def metrics(self) -> dict[int, tuple[Estimate, ...]]:
        """What was measured in the last finished attempt at each trial, by number."""
        with self._lock:
            places = {
                number: self._measured.get(last.record) for number, last in self._last.items()
            }
        told = ((number, self._told(place)) for number, place in places.items())
        return {number: each.estimates for number, each in told if each is not None}

    def _told(self, place: int | None) -> TrialMeasured | None:
        """What was measured, from the journal: of all trials it would fill the memory."""
        entry = None if place is None else self._journal.entry(place)
        return entry if isinstance(entry, TrialMeasured) else None

    def operator_step(self, trial: int, step: str, answer: str, *, at: str = "") -> None:
        """Note what a person was asked to do before `trial`, and the answer."""
        self.note(OperatorStep(at=at or utc_now(), trial=trial, step=step, answer=answer))

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
        try:
            self._abandon_open(ended)
            self.note(RunEnded(at=ended, status=status, reason=reason, safe_state=safe_state))
            self._journal.close()
            with self.timing.span(Work.SEALING):
                return self._shown.with_name(self._sealer.seal().name)
        finally:
            self.close()

    def close(self) -> None:
        """Let go of the run as it is, unsealed: another process may go on with it."""
        self._sealer.discard()
        self._journal.close()
        self._run_lock.release()

    def _abandon_open(self, at: str) -> None:
        with self._lock:
            writers, self._writers = self._writers, []
        for writer in writers:
            writer.abandon(at, "the run ended")

    def note(self, *entries: Entry) -> None:
        """Put lines into the journal, all or none; of a finished trial its file is on the disk."""
        places = self._journal.append(*entries)
        for entry, place in zip(entries, places, strict=True):
            if isinstance(entry, TrialFinished):
                with self._lock:
                    self._last[entry.trial] = entry
                    self._sealer.add(entry)
                with self.timing.span(Work.SEALING):
                    self._sealer.advance()
            elif isinstance(entry, TrialMeasured):
                with self._lock:
                    self._measured[entry.record] = place
