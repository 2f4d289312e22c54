"""Between every backend and the archive: what a trial's samples have to pass."""

from __future__ import annotations

import numpy as np

from campaign.execution.writer import TrialWriter
from campaign.trial import Array, ChannelInfo, Event, lost_samples


class SupervisingRecorder:
    """The Recorder that a backend is given for one trial."""

    def __init__(self, file: TrialWriter) -> None:
        self._file = file
        self._channels = 0
        self._samples = 0

    def start(self, channels: tuple[ChannelInfo, ...]) -> None:
        self._channels = len(channels)
        self._file.start(channels)

    def append(self, time: Array, block: Array) -> None:
        self._file.append(time, block)
        self._samples += len(time)

    def lost(self, time: Array) -> None:
        self._file.event(lost_samples(self._samples, time))
        self.append(time, np.full((self._channels, len(time)), np.nan))

    def event(self, event: Event) -> None:
        self._file.event(event)
