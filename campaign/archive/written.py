"""The samples of a trial that is about to be closed, read back from its own file.

They come channel by channel, as an analysis asks for them: nothing of a recording, however long, is
kept in memory while it is made, and what is measured is what was written.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import h5py

from campaign.archive.record import SeriesRecord
from campaign.archive.recorded import LazyChannels
from campaign.archive.series import series_at
from campaign.trial import Array, Channel, ChannelInfo, Ending, Event, Recording


@dataclass(frozen=True)
class WrittenSamples:
    """The samples of a trial whose file is still open: the group `data`, and what vouches for it.

    Attributes:
        length: of every series.
        time: digest of the time base.
    """

    data: h5py.Group
    length: int
    time: str
    series: tuple[SeriesRecord, ...]
    events: tuple[Event, ...]

    not_kept = ""

    def recording(self, ending: Ending) -> Recording:
        """Each channel is read when it is asked for. Raises ArchiveError."""
        time = self._samples("time", self.time)
        return Recording(time, LazyChannels(self.series, self.read), self.events, ending)

    def read(self, channels: Iterable[SeriesRecord]) -> Iterator[Channel]:
        for told in channels:
            yield told.info.with_samples(self._samples(told.name, told.sha256))

    def channels(self) -> tuple[ChannelInfo, ...]:
        return tuple(channel.info for channel in self.series)

    def problems(self) -> Iterator[str]:
        return iter(())

    def _samples(self, name: str, digest: str) -> Array:
        return series_at(self.data, name, self.length).read(digest)
