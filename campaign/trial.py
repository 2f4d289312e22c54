"""Task and Trial: what a bench is to do, and how an experiment requests it.

A Trial is everything a backend needs to execute one atomic thing; what comes back is a Recording
(`campaign.recording`). Neither knows where protocols come from, how samples are made, or where
they are kept.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property
from typing import Any, Literal, Self

from pydantic import Field, JsonValue

from campaign.errors import UsageError
from campaign.estimate import Window
from campaign.options import Options
from campaign.recording import (
    Array,
    Channel,
    ChannelInfo,
    Ending,
    Event,
    Fault,
    MemoryRecorder,
    Outcome,
    PanicStop,
    Recorder,
    Recording,
    SafeState,
    lost_samples,
)
from campaign.signals import Signal, Zero

__all__ = [
    "NONE_MORE",
    "Array",
    "Channel",
    "ChannelInfo",
    "Ending",
    "Event",
    "Fault",
    "MemoryRecorder",
    "Most",
    "OfferedRecording",
    "Outcome",
    "PanicStop",
    "Recorder",
    "Recording",
    "Role",
    "SafeState",
    "Task",
    "Tree",
    "Trial",
    "TrialRequest",
    "canonical_json",
    "lost_samples",
    "trial_number",
]
# Plug-ins that were written when recordings stood here import them from here.

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
            SHA-256, rows, columns and what is made of them; see `campaign.importing.description`.
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
        what = {"task": self.task.model_dump(mode="json"), "seed": self.seed}
        if self.truth:
            what["truth"] = self.truth
        if self.recording:
            what["recording"] = self.recording
        text = f'{{"bench":{tree_text(self.bench)},{canonical_json(what)[1:]}'  # keys are sorted
        return hashlib.sha256(text.encode()).hexdigest()

    @property
    def apart_from_seed(self) -> tuple[str, str, Task]:
        """What determines the samples of a simulation but its seed: equal for repeats."""
        return tree_text(self.bench), self.truth, self.task

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
        planned: whether the test's options say how it is executed; of a recording that nobody
            planned only those that the test writes are kept: defaults were never executed.
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
    planned: bool = True


@dataclass(frozen=True)
class OfferedRecording:
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


def canonical_json(tree: Any) -> str:
    """JSON that is equal for equal content: sorted keys, no spaces, no NaN."""
    return json.dumps(tree, sort_keys=True, separators=(",", ":"), allow_nan=False)


_MOST_TEXTS = 64
_TEXTS: dict[int, tuple[Tree, str]] = {}
"""Trees and their texts, by the id of the tree."""


def tree_text(tree: Tree) -> str:
    """`canonical_json` of a tree that trials share and nothing changes; the last ones are kept."""
    kept = _TEXTS.get(id(tree))  # the tree is kept, and so is its id
    if kept is None:
        if len(_TEXTS) >= _MOST_TEXTS:
            _TEXTS.clear()
        kept = _TEXTS[id(tree)] = tree, canonical_json(tree)
    return kept[1]


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
