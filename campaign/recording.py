"""What comes back from a trial: Recording, Channel, Event, Ending, and what takes samples.

It knows neither what was asked (`campaign.trial`), nor how samples are made or kept.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from pydantic import JsonValue

Array = NDArray[np.float64]


class Outcome(StrEnum):
    """How a trial ended."""

    COMPLETED = "completed"  # it ran to its end; its recording is whole
    LIMIT = "limit"  # a measured limit of the bench ended it
    DIVERGED = "diverged"  # a channel became infinite or undefined
    FAULT = "fault"  # the backend or the bench failed
    INTERRUPTED = "interrupted"  # somebody stopped it

    @property
    def failed(self) -> bool:
        """Whether the trial did not complete although nobody stopped it."""
        return self not in (Outcome.COMPLETED, Outcome.INTERRUPTED)


class Fault(StrEnum):
    """What failed, in the words by which a protocol's `[faults]` chooses what to do about it."""

    LOST_CONNECTION = "lost-connection"  # no word from the bench
    LOST_SAMPLES = "lost-samples"  # some could not be had again; they are marked
    HEARTBEAT = "heartbeat"  # the bench stopped because it no longer heard the host
    RESET = "reset"  # the controller started anew in mid-trial
    OVER_TEMPERATURE = "over-temperature"
    LIMIT_SWITCH = "limit-switch"
    SENSOR = "sensor"  # a sensor is stuck or out of its range
    DRIVE = "drive"  # the drive reports a fault of its own
    REFUSED = "refused"  # the bench would not arm
    RECORDING = "recording"  # what the backend recorded is not what it promised
    OTHER = "other"


class SafeState(StrEnum):
    """Whether the bench was seen at rest with its drive off after a trial."""

    CONFIRMED = "confirmed"
    NOT_CONFIRMED = "not confirmed"


@dataclass(frozen=True)
class PanicStop:
    """Somebody switched the bench off from outside; it stays off until a person clears that.

    Attributes:
        count: of the stop, told by the bench; who clears it says which one was seen.
        by: who it was, as far as that was told.
        age: time since then (s); None when the bench does not know.
    """

    count: int
    by: str
    age: float | None = None

    def __str__(self) -> str:
        return f"panic stop by {self.by}"


@dataclass(frozen=True)
class Ending:
    """How a trial ended and why.

    Attributes:
        outcome: see `Outcome`.
        reason: empty when completed; else what happened, with the value and the limit.
        safe_state: whether the bench is known to be safe afterwards.
        fault: what failed, when the outcome is a fault.
        telemetry: what the backend measured of its own work (latency, buffer fill, resends ...),
            JSON-like, units in the names; nothing that an analysis needs.
    """

    outcome: Outcome
    reason: str = ""
    safe_state: SafeState = SafeState.CONFIRMED
    fault: Fault | None = None
    telemetry: Mapping[str, JsonValue] = field(default_factory=dict)


@dataclass(frozen=True)
class Event:
    """Something that happened during a trial, at its own time (s)."""

    time: float
    text: str


@dataclass(frozen=True)
class Channel:
    """One recorded quantity: `unit` is SI, `display_unit` what a reader is shown.

    Attributes:
        samples: shape (n,), float64.
        measured: False for what only a simulator can know (the true friction torque).
        own_rate: how often the value is new (Hz), where that is not with every sample; between,
            it is held: `campaign.channels`.
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
        """All of it but the samples."""
        return ChannelInfo(
            self.name, self.unit, self.label, self.display_unit, self.measured, self.own_rate
        )


@dataclass(frozen=True)
class ChannelInfo:
    """A channel before it has samples: what a backend announces when a trial starts.

    `campaign.channels.info` makes it for the names that analyses know.
    """

    name: str
    unit: str
    label: str
    display_unit: str
    measured: bool = True
    own_rate: float | None = None

    @property
    def long_name(self) -> str:
        """What stands at an axis: label and unit."""
        return f"{self.label} ({self.unit})" if self.unit else self.label

    def with_samples(self, samples: Array) -> Channel:
        return Channel(
            self.name,
            self.unit,
            self.label,
            self.display_unit,
            samples,
            self.measured,
            self.own_rate,
        )


@dataclass(frozen=True)
class Recording:
    """What came back from one trial: channels on one time base, events and how it ended.

    Attributes:
        time: shape (n,), s, float64, from the trial's start.
        channels: by name; each as long as `time`.
    """

    time: Array
    channels: Mapping[str, Channel]
    events: tuple[Event, ...] = ()
    ending: Ending = field(default_factory=lambda: Ending(Outcome.COMPLETED))

    def __getitem__(self, name: str) -> Array:
        """Samples of a channel, SI, shape (n,); KeyError naming what there is."""
        try:
            return self.channels[name].samples
        except KeyError:
            raise KeyError(f"no channel {name!r}; there are {', '.join(self.channels)}") from None

    def window(self, start: float, stop: float) -> Recording:
        """The part with start <= time < stop (s), half a sample tolerant."""
        if len(self.time) < 2:
            return self
        half = 0.5 * (self.time[1] - self.time[0])
        first, last = np.searchsorted(self.time, (start - half, stop - half))
        cut = slice(int(first), int(last))
        return Recording(self.time[cut], _Cut(self.channels, cut), self.events, self.ending)


class _Cut(Mapping[str, Channel]):
    """A part of each channel, which an archive reads when it is asked for."""

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
    """Where a backend puts samples as they come: an archive's trial file, or memory."""

    def start(self, channels: tuple[ChannelInfo, ...]) -> None:
        """Announce the channels, once, before the first block."""

    def append(self, time: Array, block: Array) -> None:
        """Add samples: `time` (n,) in s, `block` (channels, n) in the announced order and units."""

    def lost(self, time: Array) -> None:
        """Add samples that could not be had: NaN in every channel at `time` (n,), and an event."""

    def event(self, event: Event) -> None:
        """Note something that happened."""


class MemoryRecorder:
    """A Recorder that keeps everything, for tests and for work without an archive."""

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
        """Everything recorded, once the trial has ended."""
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
    """The event that marks lost samples: number `first` of the trial, from 0, and following."""
    last = first + len(time) - 1
    return Event(float(time[0]), f"samples {first} to {last} were lost and are NaN")
