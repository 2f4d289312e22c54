"""The archive as the runner needs it: two small interfaces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

from campaign.archive.layout.header import RunStatus
from campaign.archive.layout.journal import Entry
from campaign.archive.reading.archived_metrics import Measure
from campaign.estimate import Estimate
from campaign.policy import KEEP_ALL, SampleRetention
from campaign.recording import Array, ChannelInfo, Ending, Event, SafeState
from campaign.trial import Trial


class TrialWriter(Protocol):
    """Takes the samples of one trial and keeps them once it has ended.

    As a `Recorder`, but for lost samples: those come as NaN, with their event.
    """

    def start(self, channels: tuple[ChannelInfo, ...]) -> None: ...

    def append(self, time: Array, block: Array) -> None: ...

    def event(self, event: Event) -> None: ...

    def finish(self, ending: Ending, started: str, ended: str) -> None:
        """Keep the trial, whole: no crash can lose it then. Raises ArchiveError."""

    def measure(self, measure: Measure) -> str:
        """Keep what `measure` finds in its samples, once it is kept; why nothing was measured.

        Raises ArchiveError.
        """


class Begins(Protocol):
    """Opens a file for each attempt at a trial."""

    def begin(self, trial: Trial, keeping: SampleRetention = KEEP_ALL) -> TrialWriter:
        """Open the next attempt at a trial for its samples."""


class PlanWriter(Begins, Protocol):
    """Takes the trials of a run; `begin` and what it returns may be used from several threads."""

    @property
    def folder(self) -> Path:
        """Where the run lies until it is sealed."""

    def attempt(self, trial: Trial) -> int:
        """Which one that is, from 1."""

    def metrics(self) -> Mapping[int, Sequence[Estimate]]:
        """What was measured in the last finished attempt at each trial, by number."""

    def note(self, *entries: Entry) -> None:
        """Keep what processes tell of trials that they have written. Raises ArchiveError."""

    def decision(self, decision: str, reason: str, trial: int | None = None) -> None:
        """Note what the run did besides its plan. Raises ArchiveError."""

    def operator_step(self, trial: int, step: str, answer: str) -> None:
        """Note what a person was asked to do, and the answer. Raises ArchiveError."""

    def seal(self, status: RunStatus, reason: str, safe_state: SafeState, *, ended: str) -> Path:
        """Close the run for good and say where it is."""
