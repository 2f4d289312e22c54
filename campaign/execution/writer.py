"""Interfaces of the archive that the runner uses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

from campaign.archive.layout.header import RunStatus
from campaign.archive.layout.journal import Entry
from campaign.archive.reading.archived_metrics import Measure
from campaign.estimate import Estimate
from campaign.experiments.interface import TrialData
from campaign.policy import KEEP_ALL, SampleRetention
from campaign.recording import Array, ChannelInfo, Ending, Event, SafeState
from campaign.trial import Trial


class TrialWriter(Protocol):
    """Receives the samples of one trial, and archives them at its end.

    Like a `Recorder`, except that lost samples come as NaN, with their event.
    """

    def start(self, channels: tuple[ChannelInfo, ...]) -> None: ...

    def append(self, time: Array, block: Array) -> None: ...

    def event(self, event: Event) -> None: ...

    def finish(self, ending: Ending, started: str, ended: str) -> None:
        """Archive the whole trial; afterwards a crash cannot lose it. Raises ArchiveError."""

    def measure(self, measure: Measure) -> str:
        """Archive the metrics that `measure` computes, after `finish`. Raises ArchiveError.

        Returns why metrics are missing, or an empty text.
        """


class Begins(Protocol):
    """Opens a file for each attempt at a trial."""

    def begin(self, trial: Trial, keeping: SampleRetention = KEEP_ALL) -> TrialWriter:
        """Open the next attempt at a trial for its samples."""


class PlanWriter(Begins, Protocol):
    """Writes the trials of a run; several threads may use `begin` and its results."""

    @property
    def folder(self) -> Path:
        """Folder of the run until it is sealed."""

    def attempt(self, trial: Trial) -> int:
        """Number of the next attempt at `trial`, from 1."""

    def metrics(self) -> Mapping[int, Sequence[Estimate]]:
        """Metrics of the last finished attempt at each trial, by number."""

    def archived(self, number: int) -> TrialData:
        """A finished trial of this run. Raises ArchiveError, LookupError."""

    def note(self, *entries: Entry) -> None:
        """Journal a stage, or entries of trials that other processes have written.

        Raises ArchiveError.
        """

    def decision(self, decision: str, reason: str, trial: int | None = None) -> None:
        """Journal an action of the run outside its plan. Raises ArchiveError."""

    def operator_step(self, trial: int, step: str, answer: str) -> None:
        """Journal an operator step and the answer. Raises ArchiveError."""

    def seal(self, status: RunStatus, reason: str, safe_state: SafeState, *, ended: str) -> Path:
        """Seal the run and return its path."""
