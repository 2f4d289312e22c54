"""A trial of an archive; its samples are read on request."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol

from campaign.estimate import Estimate, Window
from campaign.recording import ChannelInfo, Ending, Recording
from campaign.trial import Trial


class Samples(Protocol):
    """What a trial recorded, as one format of archives keeps it."""

    @property
    def not_kept(self) -> str:
        """Why the samples are not there, and were not lost; empty when they are."""

    def recording(self, ending: Ending) -> Recording:
        """The samples, SI. Raises ArchiveError when one fails its checksum."""

    def channels(self) -> tuple[ChannelInfo, ...]:
        """What was announced. Raises ArchiveError."""

    def digests(self) -> Mapping[str, str]:
        """SHA-256 of every series as it was recorded, by name, also where it was not kept."""

    def problems(self) -> Iterator[str]:
        """What is damaged, by trial and channel; reads every sample in flat memory."""


@dataclass(frozen=True)
class ArchivedTrial:
    """A trial in an archive; what an analysis calls `TrialData`.

    Attributes:
        trial: as it was executed.
        ending: how it ended and why.
        started, ended: ISO 8601.
        path: the file it lies in: the sealed run, or its own while the run is in progress.
        entry: its group there.
        windows: parts that its analysis uses, where they are not the one in `trial`.
        estimates: what was found while it was executed.
        measured_by: which code found that, with its version.
    """

    trial: Trial
    ending: Ending
    started: str
    ended: str
    path: Path
    entry: str
    samples: Samples = field(repr=False)
    windows: tuple[Window, ...] = ()
    estimates: tuple[Estimate, ...] = ()
    measured_by: str = ""

    @property
    def not_kept(self) -> str:
        """Why it has no samples though it recorded some; empty when it has."""
        return self.samples.not_kept

    def recording(self) -> Recording:
        """The samples, SI. Raises ArchiveError when something of them is not what was archived.

        A channel may be read only when it is asked for, and raise that error then.
        """
        return self.samples.recording(self.ending)

    def channels(self) -> tuple[ChannelInfo, ...]:
        """What was announced, without its samples; nothing when the trial did not come to that."""
        return self.samples.channels()

    def channel_names(self) -> frozenset[str]:
        """The names of `channels`."""
        return frozenset(channel.name for channel in self.channels())

    def digests(self) -> Mapping[str, str]:
        """SHA-256 of times and channels as they were recorded, also where they were not kept."""
        return self.samples.digests()

    def unmeasured(self) -> ArchivedTrial:
        """The same trial as if nothing had been measured while it was executed.

        One without samples cannot be measured again, and stays as it is.
        """
        return self if self.not_kept else replace(self, estimates=(), measured_by="")

    def problems(self) -> Iterator[str]:
        """Reads every sample in flat memory; what is damaged, by trial and channel."""
        return self.samples.problems()
