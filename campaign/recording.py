"""Data of an executed trial: Recording, Channel, Event, Ending, and recorders of samples.

Independent of the requested motion (`campaign.trial`), of simulation, and of storage.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from itertools import pairwise
from typing import Protocol

import numpy as np
from pydantic import JsonValue

from campaign.arrays import Array as Array
from campaign.arrays import Flags


class Outcome(StrEnum):
    """How a trial ended."""

    COMPLETED = "completed"  # executed to its end; its recording is complete
    LIMIT = "limit"  # a measured limit of the bench ended it
    DIVERGED = "diverged"  # a channel became infinite or undefined
    FAULT = "fault"  # the backend or the bench failed
    INTERRUPTED = "interrupted"  # stopped on request

    @property
    def failed(self) -> bool:
        """Whether the trial did not complete, without a stop request."""
        return self not in (Outcome.COMPLETED, Outcome.INTERRUPTED)


class Fault(StrEnum):
    """Kind of a fault; a protocol's `[faults]` uses these names to select the response."""

    LOST_CONNECTION = "lost-connection"  # no answer from the bench
    LOST_SAMPLES = "lost-samples"  # some samples could not be recovered; they are marked
    HEARTBEAT = "heartbeat"  # the bench stopped because it received no sign of life from the host
    RESET = "reset"  # the controller restarted during the trial
    OVER_TEMPERATURE = "over-temperature"
    LIMIT_SWITCH = "limit-switch"
    SENSOR = "sensor"  # a sensor is stuck or out of range
    DRIVE = "drive"  # the drive reports a fault
    REFUSED = "refused"  # the bench refused to arm
    RECORDING = "recording"  # the recording violates a condition of the trial
    OTHER = "other"


class SafeState(StrEnum):
    """Whether the bench is confirmed at rest with its drive off after a trial."""

    CONFIRMED = "confirmed"
    NOT_CONFIRMED = "not confirmed"


@dataclass(frozen=True)
class PanicStop:
    """A stop of the bench from outside the program; the bench stays off until a person clears it.

    Attributes:
        count: number of the stop, from the bench; clearing a stop requires this number.
        by: source of the stop, as reported.
        age: time since the stop (s); None if unknown to the bench.
    """

    count: int
    by: str
    age: float | None = None

    def __str__(self) -> str:
        return f"panic stop by {self.by}"


@dataclass(frozen=True)
class Ending:
    """Outcome of a trial and its cause.

    Attributes:
        outcome: see `Outcome`.
        reason: empty if completed; else the cause, with the value and the limit.
        safe_state: whether the safe state is confirmed afterwards.
        fault: kind of the fault, if the outcome is a fault.
        telemetry: the backend's measurements of its own work (latency, buffer fill, resends ...),
            JSON-like, units in the names; not used by analyses.
    """

    outcome: Outcome
    reason: str = ""
    safe_state: SafeState = SafeState.CONFIRMED
    fault: Fault | None = None
    telemetry: Mapping[str, JsonValue] = field(default_factory=dict)


@dataclass(frozen=True)
class Event:
    """An event of a trial; `time` in s from the trial's start."""

    time: float
    text: str


@dataclass(frozen=True)
class Channel:
    """One recorded quantity; `unit` is SI, `display_unit` is for output.

    Attributes:
        samples: shape (n,), float64.
        measured: False for a quantity that only a simulation provides (the true friction torque).
        own_rate: update rate of the value (Hz), if lower than the sample rate; in between the value
            is held: `campaign.channels`.
    """

    name: str
    unit: str
    label: str
    display_unit: str
    samples: Array
    measured: bool = True
    own_rate: float | None = None

    @property
    def info(self) -> ChannelInfo:
        """The channel without its samples."""
        return ChannelInfo(
            self.name, self.unit, self.label, self.display_unit, self.measured, self.own_rate
        )


@dataclass(frozen=True)
class ChannelInfo:
    """A channel without samples, as a backend announces it at the start of a trial.

    `campaign.channels.info` creates it for the names of the vocabulary.
    """

    name: str
    unit: str
    label: str
    display_unit: str
    measured: bool = True
    own_rate: float | None = None

    @property
    def long_name(self) -> str:
        """Label and unit, e.g. for an axis of a figure."""
        return f"{self.label} ({self.unit})" if self.unit else self.label

    def with_samples(self, samples: Array) -> Channel:
        return Channel(**vars(self), samples=samples)


@dataclass(frozen=True)
class Recording:
    """Recording of one trial: channels on one time base, events and the ending.

    Attributes:
        time: shape (n,), s, float64, from the trial's start.
        channels: channels by name; each with n samples.
    """

    time: Array
    channels: Mapping[str, Channel]
    events: tuple[Event, ...] = ()
    ending: Ending = field(default_factory=lambda: Ending(Outcome.COMPLETED))

    def __getitem__(self, name: str) -> Array:
        """Samples of a channel, SI, shape (n,). Raises KeyError that lists the channels."""
        try:
            return self.channels[name].samples
        except KeyError:
            raise KeyError(f"no channel {name!r}; there are {', '.join(self.channels)}") from None

    def window(self, start: float, stop: float) -> Recording:
        """The part with start <= time < stop (s), with a tolerance of half a sample."""
        if len(self.time) < 2:
            return self
        half = 0.5 * (self.time[1] - self.time[0])
        first, last = np.searchsorted(self.time, (start - half, stop - half))
        cut = slice(int(first), int(last))
        return Recording(self.time[cut], _Cut(self.channels, cut), self.events, self.ending)


class _Cut(Mapping[str, Channel]):
    """A part of each channel; an archive reads it on access."""

    def __init__(self, whole: Mapping[str, Channel], cut: slice) -> None:
        self._whole = whole
        self._cut = cut

    def __getitem__(self, name: str) -> Channel:
        channel = self._whole[name]
        return channel.info.with_samples(channel.samples[self._cut])

    def __contains__(self, name: object) -> bool:
        return name in self._whole

    def __iter__(self) -> Iterator[str]:
        return iter(self._whole)

    def __len__(self) -> int:
        return len(self._whole)


class Recorder(Protocol):
    """Receiver of a backend's samples: an archive's trial file, or memory."""

    def start(self, channels: tuple[ChannelInfo, ...]) -> None:
        """Announce the channels, once, before the first block."""

    def append(self, time: Array, block: Array) -> None:
        """Add samples: `time` (n,) in s, `block` (channels, n) in the announced order and units."""

    def lost(self, time: Array) -> None:
        """Add lost samples: NaN in every channel at `time` (n,), and an event."""

    def event(self, event: Event) -> None:
        """Add an event."""


def record(recorder: Recorder, time: Array, samples: Array, lost: Flags) -> None:
    """Add `samples` (channels, n) at `time` (n,); those marked in `lost` (n,) as lost samples."""
    edges = np.unique([0, *(np.flatnonzero(np.diff(lost)) + 1), len(lost)])
    for first, end in pairwise(edges):
        if lost[first]:
            recorder.lost(time[first:end])
        else:
            recorder.append(time[first:end], samples[:, first:end])


class MemoryRecorder:
    """Recorder that keeps everything in memory, for tests and for work without an archive."""

    def __init__(self) -> None:
        self._channels: tuple[ChannelInfo, ...] = ()
        self._times: list[Array] = []
        self._blocks: list[Array] = []
        self._events: list[Event] = []

    def start(self, channels: tuple[ChannelInfo, ...]) -> None:
        self._channels = channels

    def append(self, time: Array, block: Array) -> None:
        self._times.append(time)
        self._blocks.append(block)

    def lost(self, time: Array) -> None:
        first = sum(map(len, self._times))
        self.event(lost_samples(first, time))
        self.append(time, np.full((len(self._channels), len(time)), np.nan))

    def event(self, event: Event) -> None:
        self._events.append(event)

    def recording(self, ending: Ending) -> Recording:
        """The recording, after the end of the trial."""
        time = np.concatenate(self._times) if self._times else np.empty(0)
        samples = (
            np.concatenate(self._blocks, axis=1)
            if self._blocks
            else np.empty((len(self._channels), 0))
        )
        channels = {
            info.name: info.with_samples(row)
            for info, row in zip(self._channels, samples, strict=True)
        }
        return Recording(time, channels, tuple(self._events), ending)


def lost_samples(first: int, time: Array) -> Event:
    """Event that marks lost samples; `first` is the number of the first one, from 0."""
    last = first + len(time) - 1
    return Event(float(time[0]), f"samples {first} to {last} were lost and are NaN")
