"""What an attempt at a trial needs of the archive; `campaign.testing` has one in memory."""

from __future__ import annotations

from typing import Protocol

from campaign.archive.reading.archived_metrics import Measure
from campaign.policy import KEEP_ALL, SampleRetention
from campaign.recording import Array, ChannelInfo, Ending, Event
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
    """Opens a file for each attempt at a trial; several threads may use `begin` and its results."""

    def begin(self, trial: Trial, keeping: SampleRetention = KEEP_ALL) -> TrialWriter:
        """Open the next attempt at a trial for its samples."""
