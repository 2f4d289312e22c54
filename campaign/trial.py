"""The nouns every room shares: Trial, Recording, Channel, Outcome.

A Trial is everything a backend needs to execute one atomic thing. A Recording is what came back.
Neither knows where protocols come from, how samples are made, or where they are kept.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property
from typing import Any, Literal, Protocol, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, JsonValue

from campaign.errors import UsageError
from campaign.estimate import Window
from campaign.options import Options
from campaign.signals import Signal, Zero

Array = NDArray[np.float64]
Tree = dict[str, JsonValue]
"""A normalised, JSON-like description: SI numbers, text, booleans, lists and tables."""


class Role(StrEnum):
    """Why a trial is in the plan. Only measurements are analysed; all are archived."""

    MEASUREMENT = "measurement"
    WARM_UP = "warm-up"
    HOME = "home"  # brings the axis to where the next trial begins
    CHECK = "check"  # one trial again and again: is the bench still the same bench?


class Task(Options):
    """What the bench does during a trial, in SI: no names, no sweep, nothing to look up.

    Attributes:
        mode: `rate` closes the velocity loop on `command` (rad/s); `torque` opens it and commands
            `command` (N m at the load) through the current loop. Two modes exist only where a bench
            is simulated: `prescribed` moves the load relative to the hull exactly at `command`
            (rad/s), with no motor; `spring` pulls it through a spring whose far end stands at the
            angle `command` (rad), with no motor. `recorded` was done elsewhere, by whatever
            controller there was: its recording tells all that is known of it.
        spring_stiffness: of mode `spring` (N m/rad).
        disturbance: torque on the load from outside (N m); only where a bench is simulated.
        command: the commanded rate or torque over the trial's own time.
        base_acceleration: angular acceleration of the hull (rad/s^2); its rate has zero mean when
            it is a sine, and starts from rest otherwise.
        compensation: name of a compensation method that the bench has parameters for, or `none`.
        duration: length of the trial (s).
        window: the part of it that an analysis uses (start, stop) (s). An experiment that measures
            several windows in one trial spans them here and derives them from its options.
        stop_rate: the trial is complete as soon as the relative rate passes this (rad/s); absent:
            it lasts its whole duration.
        sample_rate: of the recording (Hz).
        start_angle: where the load stands relative to the hull when the trial begins (rad).
    """

    mode: Literal["rate", "torque", "prescribed", "spring", "recorded"]
    command: Signal = Zero()
    spring_stiffness: float = Field(default=0.0, ge=0)
    disturbance: Signal = Zero()
    base_acceleration: Signal = Zero()
    compensation: str = "none"
    duration: float = Field(gt=0)
    window: tuple[float, float]
    sample_rate: float = Field(gt=0)
    start_angle: float = 0.0
    stop_rate: float | None = Field(default=None, gt=0)


class Trial(Options):
    """One atomic, fully resolved thing to execute; a backend needs nothing else.

    Attributes:
        number: place in the plan, from 1.
        test, kind: the protocol's test it belongs to, and the experiment of that test.
        point: the swept values that lead to it, dotted path to value, for display and analysis.
        told: how people say a value of `point` that has a unit: in the one the protocol writes.
        options: the test's normalised options at this point (SI).
        repeat: which repetition it is, from 1.
        seed: of everything random in it.
        bench: the normalised bench (SI) with the sweep applied.
        task: what the bench does.
        note: what the plan says about it, e.g. which rule set the measuring window.
        setup: what a person must have done to the bench for it, in order; shown and confirmed
            before the first trial for which it differs from what was confirmed last.
        set_by_operator: the paths of `point` that this sets, e.g. `bench.gear.preload.torque`; all
            other swept values are the controller's business.
        requires: names of the channels without which its analysis finds nothing.
        can_use: names of those without which it only leaves something out.
        windows: parts that its analysis uses, by name; it derives no times from the options.
        truth: SHA-256 of the bench that is simulated in place of `bench`, which nobody who plans or
            analyses the trial is told; empty: it is `bench` itself. See `physics.truth`.
        recording: where its samples come from, when it was executed elsewhere: files with their
            SHA-256, rows, columns and what is made of them; see `campaign.importing.described`.
            Empty for a trial that a backend of its own executes.
    """

    number: int = Field(ge=1)
    test: str
    kind: str
    role: Role = Role.MEASUREMENT
    point: dict[str, JsonValue] = {}
    told: dict[str, str] = {}
    options: Tree = {}
    repeat: int = Field(default=1, ge=1)
    seed: int = Field(ge=0, lt=2**63)
    bench: Tree
    task: Task
    note: str = ""
    setup: tuple[str, ...] = ()
    set_by_operator: tuple[str, ...] = ()
    requires: tuple[str, ...] = ()
    can_use: tuple[str, ...] = ()
    windows: tuple[Window, ...] = ()
    truth: str = ""
    recording: Tree = {}

    @property
    def name(self) -> str:
        """Unique in its run: `trial-00017`. Also the name of its group in the archive."""
        return f"trial-{self.number:05d}"

    @property
    def label(self) -> str:
        """For people: the test, and what is particular about this trial of it."""
        told = {path: self.told.get(path) or _short(value) for path, value in self.point.items()}
        point = ", ".join(f"{path}={value}" for path, value in told.items())
        repeat = f" #{self.repeat}" if self.repeat > 1 else ""
        role = f" ({self.role})" if self.role is not Role.MEASUREMENT else ""
        return f"{self.test}{role}{f' [{point}]' if point else ''}{repeat}"

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256 of what determines the samples: bench, task, seed, truth and files, if any.

        In canonical JSON.
        """
        what = {"bench": self.bench, "task": self.task.model_dump(mode="json"), "seed": self.seed}
        if self.truth:
            what["truth"] = self.truth
        if self.recording:
            what["recording"] = self.recording
        return hashlib.sha256(canonical_json(what).encode()).hexdigest()

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """A copy with some fields changed, which works its fingerprint out anew."""
        copy = super().model_copy(update=update, deep=deep)
        copy.__dict__.pop("fingerprint", None)
        return copy


@dataclass(frozen=True)
class TrialRequest:
    """A trial as an experiment asks for it; the plan adds number, seed, bench and sweep point.

    Attributes:
        point: what distinguishes it within the test, e.g. {"speed": 0.0175}; SI.
        note: what the plan should say about it.
        bench: a whole normalised bench (SI) to execute it on instead of the test's, for an
            experiment that varies the bench itself; see `experiments.common.with_changes`.
        requires, can_use: names of the channels, where they are not all that the experiment
            declares; None: a measurement has all of those, and any other role none.
        windows: parts of the recording that the analysis uses, by name; see `Trial`.
        recording: where the samples of a trial come from that was executed elsewhere; see `Trial`.
        part: of an offered recording that is this trial (s from its beginning); None: all of it.
        options: those of the test's that a recording from elsewhere shows to have been others (SI).
    """

    task: Task
    role: Role = Role.MEASUREMENT
    point: Mapping[str, JsonValue] = field(default_factory=dict)
    note: str = ""
    bench: Tree | None = None
    requires: Collection[str] | None = None
    can_use: Collection[str] | None = None
    windows: tuple[Window, ...] = ()
    recording: Tree = field(default_factory=dict)
    part: tuple[float, float] | None = None
    options: Tree = field(default_factory=dict)


@dataclass(frozen=True)
class Offered:
    """A recording from elsewhere, as an experiment is offered it: it may hold several trials.

    Attributes:
        duration: of it (s), at `sample_rate` (Hz).
        channels: names of those that it has, or that can be made of those that it has.
        conditions: what is known to have been set for it, by name; SI where it has a unit.
        windows: parts of it that whoever recorded it has named; s from its beginning.
        read: the samples of some of its channels.
    """

    duration: float
    sample_rate: float
    channels: frozenset[str]
    conditions: Mapping[str, JsonValue]
    windows: tuple[Window, ...]
    read: Callable[[Collection[str]], Recording]


@dataclass(frozen=True)
class Most:
    """What the trials of a stage take at most, said before anybody knows which they are.

    Attributes:
        trials: how many; 0 where the options ask for none.
        duration: bench time of all of them (s).
        samples: of all of them, per channel.
    """

    trials: int
    duration: float
    samples: int

    def __add__(self, other: Most) -> Most:
        return Most(
            self.trials + other.trials,
            self.duration + other.duration,
            self.samples + other.samples,
        )


NONE_MORE = Most(0, 0.0, 0)


class Outcome(StrEnum):
    """How a trial ended."""

    COMPLETED = "completed"  # it ran to its end; its recording is whole
    LIMIT = "limit"  # a measured limit of the bench ended it
    DIVERGED = "diverged"  # a channel became infinite or undefined
    FAULT = "fault"  # the backend or the bench failed
    INTERRUPTED = "interrupted"  # somebody stopped it


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


def canonical_json(tree: Any) -> str:
    """JSON that is equal for equal content: sorted keys, no spaces, no NaN."""
    return json.dumps(tree, sort_keys=True, separators=(",", ":"), allow_nan=False)


def trial_number(wanted: str) -> int:
    """The number of the trial that is called so: `17`, `trial-00017`. Else UsageError."""
    match = re.fullmatch(r"(?:trial[-_])?([0-9]{1,10})", wanted)
    if match is None:
        raise UsageError(f"{wanted!r} is neither the number nor the name of a trial: trial-00017")
    return int(match[1])


def _short(value: JsonValue) -> str:
    if isinstance(value, dict):  # what a swept table describes; the bench has all of it
        kinds = (value[name] for name in ("model", "method", "kind") if name in value)
        return str(next(kinds, "{...}"))
    return f"{value:.6g}" if isinstance(value, float) else str(value)
