"""A trial as an archive holds it; its samples are read only when asked for."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from campaign.trial import ChannelInfo, Ending, Recording, Trial


@dataclass(frozen=True)
class ArchivedTrial:
    """A trial in an archive; what an analysis calls `TrialData`.

    Attributes:
        trial: as it was executed.
        ending: how it ended and why.
        started, ended: ISO 8601.
        path: the file it lies in: the sealed run, or its own while the run is in progress.
        entry: its group there.
    """

    trial: Trial
    ending: Ending
    started: str
    ended: str
    path: Path
    entry: str

    def recording(self) -> Recording:
        """The samples, SI, read now. Raises ArchiveError when one fails its checksum."""
        from campaign.archive.sample_reading import read_recording

        return read_recording(self.path, self.entry, self.ending)

    def channels(self) -> tuple[ChannelInfo, ...]:
        """What was announced, without its samples; nothing when the trial did not come to that."""
        from campaign.archive.sample_reading import read_channels

        return read_channels(self.path, self.entry)

    def channel_names(self) -> frozenset[str]:
        """The names of `channels`."""
        return frozenset(channel.name for channel in self.channels())

    def problems(self) -> Iterator[str]:
        """Reads every sample in flat memory; what is damaged, by trial and channel."""
        from campaign.archive.sample_reading import check_recordings

        return check_recordings(self.path, [self.entry])
