"""A backend that does as told and an archive in memory."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from campaign.archive.layout.journal import TrialsFollowed
from campaign.archive.reading.archived_metrics import Measure
from campaign.errors import ArchiveError
from campaign.estimate import Estimate
from campaign.execution.operator_prompts import AbsentOperator, Attendance, Operator
from campaign.execution.outcome import RunOutcome
from campaign.execution.progress import Progress
from campaign.execution.runner import run_plan
from campaign.execution.stop import StopSwitch
from campaign.policy import Policy
from campaign.recording import (
    ChannelInfo,
    Ending,
    MemoryRecorder,
    Outcome,
    PanicStop,
    Recorder,
    Recording,
    SafeState,
)
from campaign.trial import Task, Trial

COMPLETED = Ending(Outcome.COMPLETED)
RATE = ChannelInfo("gyro_rate", "rad/s", "gyro rate", "deg/s")


def make_trials(count: int, *, duration: float = 2.0) -> list[Trial]:
    task = Task(mode="rate", duration=duration, window=(0.0, duration), sample_rate=10.0)
    return [
        Trial(number=number, test="test", kind="kind", seed=0, bench={}, task=task)
        for number in range(1, count + 1)
    ]


@dataclass
class FakeBackend:
    """Does `behaviour[number]` for a trial, or completes it; remembers what happened, in order."""

    behaviour: dict[int, Callable[[Callable[[], bool]], Ending]] = field(default_factory=dict)
    rest: Callable[[], SafeState] = lambda: SafeState.CONFIRMED
    log: list[str] = field(default_factory=list)

    def __enter__(self) -> FakeBackend:
        return self

    def __exit__(self, *exception: object) -> None:
        self.log.append("left")

    def refuses(self, trial: Trial) -> str | None:
        return None

    def channels(self, trial: Trial) -> frozenset[str] | None:
        return frozenset({RATE.name})

    def execute(self, trial: Trial, recorder: Recorder, stopped: Callable[[], bool]) -> Ending:
        self.log.append(trial.name)
        recorder.start((RATE,))
        time = np.arange(round(trial.task.duration * 10)) / 10
        recorder.append(time, np.ones((1, len(time))))
        behave = self.behaviour.get(trial.number, lambda stopped: COMPLETED)
        return behave(stopped)

    def make_safe(self) -> SafeState:
        self.log.append("made safe")
        return self.rest()


class OwnBackend(FakeBackend):
    """As one of the program's own: what it raises is a bug."""

    __module__ = "campaign.backends.own"


@dataclass
class SwitchedBench(FakeBackend):
    """A bench that others can switch off, as `stop` says; it may not be asked while it moves.

    Switched off it refuses to arm; `broken`: it cannot be asked.
    """

    stop: PanicStop | None = None
    broken: bool = False
    asked: int = 0
    moving: set[int] = field(default_factory=set)

    def execute(self, trial: Trial, recorder: Recorder, stopped: Callable[[], bool]) -> Ending:
        if self.stop is not None:
            return Ending(Outcome.INTERRUPTED, str(self.stop))
        self.moving.add(trial.number)
        try:
            return super().execute(trial, recorder, stopped)
        finally:
            self.moving.remove(trial.number)

    def introduce(self, run: str) -> None: ...

    def panic_stop(self) -> PanicStop | None:
        assert not self.moving
        self.asked += 1
        if self.broken:
            raise RuntimeError("a bug")
        return self.stop

    def clear_stop(self, count: int) -> None:
        self.log.append("cleared")


class MemoryTrial(MemoryRecorder):
    def __init__(self, archive: MemoryArchive, trial: Trial) -> None:
        super().__init__()
        self.archive, self.trial = archive, trial

    def finish(self, ending: Ending, started: str, ended: str) -> None:
        assert datetime.fromisoformat(started) <= datetime.fromisoformat(ended)
        with self.archive.lock:
            self.archive.trials[self.trial.number] = self.trial
            self.archive.endings[self.trial.number] = ending
            self.archive.attempts.append((self.trial.number, ending.outcome))
            self.archive.recordings[self.trial.number] = self.recording(ending)
            self.archive.samples[self.trial.number] = len(self.recording(ending).time)

    def measure(self, measure: Measure) -> str:
        found = measure(self.archive.archived(self.trial.number))  # type: ignore[arg-type]
        return found.problem


@dataclass(frozen=True)
class MemoryTrialData:
    """An archived trial, as an experiment sees it."""

    trial: Trial
    ending: Ending
    samples: Recording
    estimates: tuple[Estimate, ...] = ()
    not_kept: str = ""

    def recording(self) -> Recording:
        return self.samples

    def channel_names(self) -> frozenset[str]:
        return frozenset(self.samples.channels)


@dataclass
class MemoryArchive:
    endings: dict[int, Ending] = field(default_factory=dict)
    samples: dict[int, int] = field(default_factory=dict)
    recordings: dict[int, Recording] = field(default_factory=dict)
    decisions: list[tuple[str, int | None]] = field(default_factory=list)
    reasons: list[str] = field(default_factory=list)
    steps: list[tuple[int, str, str]] = field(default_factory=list)
    attempts: list[tuple[int, Outcome]] = field(default_factory=list)
    sealed: tuple[str, str, SafeState] | None = None
    lock: threading.Lock = field(default_factory=threading.Lock)
    trials: dict[int, Trial] = field(default_factory=dict)
    stages: list[TrialsFollowed] = field(default_factory=list)
    measured: dict[int, tuple[Estimate, ...]] = field(default_factory=dict)
    copied: int = 0
    on_seal_next: Callable[[], object] = lambda: None

    def seal_next(self, fewest: int = 1) -> bool:
        self.on_seal_next()
        waiting = len(self.attempts) - self.copied >= fewest
        self.copied += waiting
        return waiting

    def archived(self, number: int) -> MemoryTrialData:
        with self.lock:
            ended, samples = self.endings[number], self.recordings[number]
            return MemoryTrialData(self.trials[number], ended, samples)

    def note(self, *entries: TrialsFollowed) -> None:
        assert self.sealed is None
        self.stages.extend(entries)

    @property
    def folder(self) -> Path:
        return Path("run.partial")

    def attempt(self, trial: Trial) -> int:
        return sum(number == trial.number for number, _ in self.attempts) + 1

    def metrics(self) -> dict[int, tuple[Estimate, ...]]:
        return self.measured

    def begin(self, trial: Trial, keeping: object = None) -> MemoryTrial:
        return MemoryTrial(self, trial)

    def decision(self, decision: str, reason: str, trial: int | None = None) -> None:
        assert self.sealed is None
        self.decisions.append((decision, trial))
        self.reasons.append(reason)

    def operator_step(self, trial: int, step: str, answer: str) -> None:
        self.steps.append((trial, step, answer))

    def seal(self, status: str, reason: str, safe_state: SafeState, *, ended: str) -> Path:
        assert self.sealed is None, "sealed twice"
        self.sealed = (str(status), reason, safe_state)
        return Path("run.nxs")


class Lab:
    """A run of a few trials, with everything around it in memory; pauses are noted, not waited for.

    What a trial does stands for a backend that does it.
    """

    def __init__(self, trials: int | list[Trial], backend: Any, **policy: object) -> None:
        self.trials = make_trials(trials) if isinstance(trials, int) else trials
        self.backend = FakeBackend(backend) if isinstance(backend, dict) else backend
        self.archive = MemoryArchive()
        self.stop = StopSwitch()
        self.progress: list[Progress] = []
        self.display: Callable[[Progress], object] = self.progress.append
        self.pauses: list[float] = []
        self.pause: Callable[[float], object] = self.pauses.append
        self.operator: Operator = AbsentOperator()
        self.policy = Policy.model_validate(policy, context={"si": True})

    def run(self, workers: int = 1, **more: Any) -> RunOutcome:
        waits = Attendance(self.operator, lambda seconds, stop: self.pause(seconds) and None)
        settings = {"policy": self.policy, "attendance": waits, **more}
        return run_plan(
            self.trials, self.backend, self.archive, workers=workers, display=self.display,
            stop=self.stop, **settings,
        )  # fmt: skip

    @property
    def remarks(self) -> list[str]:
        return [progress.remark for progress in self.progress if progress.remark]

    @property
    def executed(self) -> list[str]:
        return [name for name in self.backend.log if name != "made safe"]


def no_space(*arguments: object) -> NoReturn:
    """In place of something that writes to the archive."""
    raise ArchiveError("no space left")
