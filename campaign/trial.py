"""Task and Trial: the motion of a bench, and its request by an experiment.

A Trial contains all that a backend needs to execute it; its result is a Recording
(`campaign.recording`). Both are independent of protocols, of simulation, and of storage.
"""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property
from typing import Any, Literal, Self

from pydantic import Field, JsonValue

from campaign.errors import UsageError
from campaign.estimate import Window
from campaign.options import Options

# Older plug-ins import the recording classes from here.
from campaign.recording import Array as Array
from campaign.recording import Channel as Channel
from campaign.recording import ChannelInfo as ChannelInfo
from campaign.recording import Ending as Ending
from campaign.recording import Event as Event
from campaign.recording import Fault as Fault
from campaign.recording import MemoryRecorder as MemoryRecorder
from campaign.recording import Outcome as Outcome
from campaign.recording import PanicStop as PanicStop
from campaign.recording import Recorder as Recorder
from campaign.recording import Recording as Recording
from campaign.recording import SafeState as SafeState
from campaign.recording import lost_samples as lost_samples
from campaign.signals import Signal, Zero

Tree = dict[str, JsonValue]
"""A normalized, JSON-like description: SI numbers, text, booleans, lists and tables."""


class Role(StrEnum):
    """Why a trial is in the plan. Only measurements are analysed; all are archived."""

    MEASUREMENT = "measurement"
    WARM_UP = "warm-up"
    HOME = "home"  # brings the axis to the start of the next trial
    CHECK = "check"  # one trial repeated during the run, to detect changes of the bench


class Task(Options):
    """Motion of the bench during a trial, in SI: complete, without references or sweep.

    Attributes:
        mode: `rate` closes the velocity loop on `command` (rad/s); `torque` opens it and commands
            `command` (N m at the load) through the current loop. Two modes exist only on simulated
            benches, without motor: `prescribed` moves the load relative to the hull exactly at
            `command` (rad/s); `spring` pulls it through a spring whose far end has the angle
            `command` (rad). `recorded` was executed by another program; only its recording is
            known.
        spring_stiffness: of mode `spring` (N m/rad).
        disturbance: external torque on the load (N m); only on a simulated bench.
        command: commanded rate or torque over the time of the trial.
        base_acceleration: angular acceleration of the hull (rad/s^2); the rate has zero mean for
            a sine, and starts from rest otherwise.
        compensation: name of a compensation method with parameters in the bench, or `none`.
        duration: length of the trial (s).
        window: part of the trial that an analysis uses (start, stop) (s). An experiment with
            several windows in one trial spans them here and derives them from its options.
        stop_rate: relative rate (rad/s) above which the trial is complete; absent: the trial lasts
            its whole duration.
        sample_rate: of the recording (Hz).
        start_angle: angle of the load relative to the hull at the start of the trial (rad).
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

    @property
    def samples(self) -> int:
        """Number of samples of the whole duration; a last period that is cut short has none."""
        return max(1, math.floor(self.duration * self.sample_rate + 1e-6))


class Trial(Options):
    """One atomic, fully resolved trial; a backend needs nothing else.

    Attributes:
        number: place in the plan, from 1.
        test, kind: its test in the protocol, and the experiment of this test.
        point: its swept values, dotted path to value, for display and analysis.
        told: text of each value of `point` with a unit, in the unit of the protocol.
        options: normalized options of the test at this point (SI).
        repeat: number of the repetition, from 1.
        seed: of all its random numbers.
        bench: normalized bench (SI) with the sweep applied.
        task: motion of the bench.
        note: remark of the plan, e.g. the rule that set the measuring window.
        setup: manual steps that the bench needs for it, in order; shown and confirmed before the
            first trial whose steps differ from those confirmed last.
        set_by_operator: paths of `point` that these steps set, e.g. `bench.gear.preload.torque`;
            the controller sets all other swept values.
        requires: names of the channels without which its analysis has no result.
        can_use: names of the channels without which it has fewer results.
        windows: parts that its analysis uses, by name; it derives no times from the options.
        truth: SHA-256 of the bench that is simulated in place of `bench`; plan and analysis do not
            receive it. Empty: `bench` itself. See `physics.truth`.
        recording: source of the samples of an imported trial: files with their SHA-256, rows,
            columns and derived channels; see `campaign.importing.description`. Empty for a trial
            that a backend executes.
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
        """Label for a reader: the test, its role, point and repeat."""
        values = {path: self.told.get(path) or _short(value) for path, value in self.point.items()}
        point = ", ".join(f"{path}={value}" for path, value in values.items())
        repeat = f" #{self.repeat}" if self.repeat > 1 else ""
        role = f" ({self.role})" if self.role is not Role.MEASUREMENT else ""
        return f"{self.test}{role}{f' [{point}]' if point else ''}{repeat}"

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256 of all that determines the samples: bench, task, seed, truth and files, if any.

        Hashed as canonical JSON.
        """
        others = {"task": self.task.model_dump(mode="json"), "seed": self.seed}
        if self.truth:
            others["truth"] = self.truth
        if self.recording:
            others["recording"] = self.recording
        return fingerprint(self.bench, others)

    @property
    def apart_from_seed(self) -> tuple[str, str, Task]:
        """All that determines simulated samples except the seed: equal for repeats."""
        return tree_text(self.bench), self.truth, self.task

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """A copy with some fields changed and a new fingerprint."""
        copy = super().model_copy(update=update, deep=deep)
        copy.__dict__.pop("fingerprint", None)
        return copy


@dataclass(frozen=True)
class TrialRequest:
    """Request of an experiment for a trial; the plan adds number, seed, bench and sweep point.

    Attributes:
        point: values that identify the trial within the test, e.g. {"speed": 0.0175}; SI.
        note: remark of the plan about the trial.
        bench: complete normalised bench (SI) that replaces the test's, for an experiment that
            varies the bench; see `experiments.shared.common.with_changes`.
        requires, can_use: channel names; None: all channels that the experiment declares for a
            measurement, none for other roles.
        windows: parts of the recording that the analysis uses, by name; see `Trial`.
        recording: origin of the samples of an imported trial; see `Trial`.
        part: (start, stop) of this trial in an offered recording (s); None: all of it.
        options: options of the test that an imported recording shows to have other values (SI).
        planned: whether the test's options determined the execution. For an unplanned recording
            only the options written in the test are kept: defaults were never executed.
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
    """An imported recording that is offered to an experiment; it may contain several trials.

    Attributes:
        duration: its length (s), at `sample_rate` (Hz).
        channels: names of recorded channels and of channels that can be derived from them.
        conditions: known settings of the recording, by name; SI if they have a unit.
        windows: named parts of the recording; s from its beginning.
        read: returns the samples of the given channels.
    """

    duration: float
    sample_rate: float
    channels: frozenset[str]
    conditions: Mapping[str, JsonValue]
    windows: tuple[Window, ...]
    read: Callable[[Collection[str]], Recording]


@dataclass(frozen=True)
class Most:
    """Upper bounds for the trials of a stage, before they are known.

    Attributes:
        trials: number of trials; 0 if the options request none.
        duration: bench time of all of them (s).
        samples: samples of all of them, per channel.
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
    """JSON text that is identical for equal content: sorted keys, no spaces, no NaN."""
    return json.dumps(tree, sort_keys=True, separators=(",", ":"), allow_nan=False)


def fingerprint(bench: Tree, others: Mapping[str, Any]) -> str:
    """SHA-256 of a bench and of the other fields that determine samples, as one canonical JSON.

    The keys of `others` follow `bench` in the alphabet.
    """
    text = f'{{"bench":{tree_text(bench)},{canonical_json(others)[1:]}'
    return hashlib.sha256(text.encode()).hexdigest()


def leaves(tree: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted path and value of all entries that are no tables."""
    for key, value in tree.items():
        if isinstance(value, Mapping):
            yield from leaves(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


_MOST_TEXTS = 64
_TEXTS: dict[int, tuple[Tree, str]] = {}
"""Trees and their texts, by the id of the tree."""


def tree_text(tree: Tree) -> str:
    """`canonical_json` of a tree that trials share and that must not change; texts are cached."""
    kept = _TEXTS.get(id(tree))  # the cached tree keeps its id
    if kept is None:
        if len(_TEXTS) >= _MOST_TEXTS:
            _TEXTS.clear()
        kept = _TEXTS[id(tree)] = tree, canonical_json(tree)
    return kept[1]


def trial_number(wanted: str) -> int:
    """Number of a trial from `17` or `trial-00017`. Raises UsageError otherwise."""
    match = re.fullmatch(r"(?:trial[-_])?([0-9]{1,10})", wanted)
    if match is None:
        raise UsageError(f"{wanted!r} is neither the number nor the name of a trial: trial-00017")
    return int(match[1])


def _short(value: JsonValue) -> str:
    if isinstance(value, dict):  # a swept table; the bench contains all of it
        kinds = (value[name] for name in ("model", "method", "kind") if name in value)
        return str(next(kinds, "{...}"))
    return f"{value:.6g}" if isinstance(value, float) else str(value)
