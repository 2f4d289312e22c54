"""A trial of an archive; its samples are read on request."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from campaign.estimate import Estimate, Window
from campaign.recording import ChannelInfo, Ending, Outcome, Recording
from campaign.trial import Role, Trial

if TYPE_CHECKING:
    from campaign.archive.reading.archived_samples import RecordedSamples


@dataclass(frozen=True)
class ArchivedTrial:
    """A trial in an archive; analyses use it as `TrialData`.

    Attributes:
        trial: the trial as executed.
        ending: how it ended and why.
        started, ended: ISO 8601.
        path: its file: the sealed run, or its own file while the run is in progress.
        entry: its group in the file.
        windows: parts that its analysis uses, if not the window in `trial`.
        estimates: metrics measured during the run.
        measured_by: the code that measured them, with its version.
    """

    trial: Trial
    ending: Ending
    started: str
    ended: str
    path: Path
    entry: str
    samples: RecordedSamples = field(repr=False)
    windows: tuple[Window, ...] = ()
    estimates: tuple[Estimate, ...] = ()
    measured_by: str = ""

    @property
    def is_completed_measurement(self) -> bool:
        return self.ending.outcome is Outcome.COMPLETED and self.trial.role is Role.MEASUREMENT

    @property
    def not_kept(self) -> str:
        """Reason why its samples were left out on purpose; empty if they are present."""
        return self.samples.not_kept

    def recording(self) -> Recording:
        """The samples, SI. Raises ArchiveError if they differ from the archived ones.

        A channel may be read only on access, and raises this error then.
        """
        return self.samples.recording(self.ending)

    def channels(self) -> tuple[ChannelInfo, ...]:
        """The announced channels, without samples; empty if the trial ended before that."""
        return self.samples.channels()

    def channel_names(self) -> frozenset[str]:
        """The names of `channels`."""
        return frozenset(channel.name for channel in self.channels())

    def digests(self) -> Mapping[str, str]:
        """SHA-256 of recorded times and channels, even if their samples were not kept."""
        return self.samples.digests()

    def unmeasured(self) -> ArchivedTrial:
        """The trial without its metrics.

        A trial without samples stays unchanged: it cannot be measured again.
        """
        return self if self.not_kept else replace(self, estimates=(), measured_by="")

    def problems(self) -> Iterator[str]:
        """Damage by trial and channel; reads every sample, in constant memory."""
        return self.samples.problems()
