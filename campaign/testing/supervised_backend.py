"""A supervised backend with an archive in memory."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.archived_metrics import Measure
from campaign.backends.interface import Backend, StopFlag
from campaign.execution.attempt import Conditions, execute_once
from campaign.execution.supervision import Supervision
from campaign.physics.limit_watch import WATCHED
from campaign.policy import KEEP_ALL, SampleRetention
from campaign.recording import (
    Array,
    ChannelInfo,
    Ending,
    Event,
    MemoryRecorder,
    Recorder,
    Recording,
    SafeState,
)
from campaign.testing.backend_under_test import BackendUnderTest, CheckFailedError, require
from campaign.trial import Trial

OTHERS = 1e300
"""Value of limits that a check does not test (practically unlimited)."""

Disturb = Callable[[Array, Array], tuple[Array, Array]]
"""Function that changes a block, time (n,) and samples (channels, n), before the recorder."""


@dataclass
class SupervisedEnd:
    """Result of a supervised trial.

    Attributes:
        after: number of blocks that the backend delivered after its trial was stopped.
        made_safe: answers of `make_safe`, in order.
    """

    ending: Ending
    after: int
    made_safe: list[SafeState]


def supervised(
    under_test: BackendUnderTest,
    *,
    watched: Trial | None = None,
    disturb: Disturb = lambda time, block: (time, block),
) -> SupervisedEnd:
    """Execute the possible trial as a run does.

    The supervision receives `watched` instead, with limits that the backend does not know, and the
    samples after `disturb`.
    """
    with under_test.open() as backend:
        between = _Between(backend, under_test.possible, disturb)
        archive = _Memory()
        supervision = Supervision(live=under_test.live)
        conditions = Conditions(between, archive, lambda: False, supervision)
        execute_once(watched or under_test.possible, conditions)
    ending = archive.file.ending
    if ending is None:
        raise CheckFailedError("the trial was not archived")
    return SupervisedEnd(ending, between.after, between.made_safe)


def with_narrow_limit(under_test: BackendUnderTest, recording: Recording) -> tuple[Trial, str]:
    """The possible trial with one limit at half of the recorded maximum, and its channel."""
    for each in WATCHED:
        if each.limit == "rate" or each.channel not in recording.channels:
            continue  # this limit applies to a mean, which may stay below a sample's maximum
        reached = float(np.max(np.abs(recording[each.channel])))
        if reached > 0:
            limits = dict.fromkeys(("angle", "rate", "acceleration", "torque", "current"), OTHERS)
            tree = {**limits, "duration": OTHERS, each.limit: 0.5 * reached}
            bench = {**under_test.possible.bench, "limits": tree}
            return under_test.possible.model_copy(update={"bench": bench}), each.channel
    names = ", ".join(each.channel for each in WATCHED if each.limit != "rate")
    raise CheckFailedError(f"no limit can be watched: it records none of {names}, or zeros only")


def got_through(under_test: BackendUnderTest, patience: float) -> SafeState:
    """Answer of `make_safe` within `patience` (s) while `execute` hangs in its recorder."""
    recorder = _Hanging()
    answers: list[SafeState] = []
    stop = threading.Event()
    with under_test.open() as backend:
        execute = threading.Thread(
            target=lambda: backend.execute(under_test.possible, recorder, stop.is_set), daemon=True
        )
        execute.start()
        try:
            require(recorder.hangs.wait(patience), "no samples came")
            asked = threading.Thread(
                target=lambda: answers.append(backend.make_safe()), daemon=True
            )
            asked.start()
            asked.join(patience)
            require(
                answers, f"make_safe() did not return within {patience:g} s while execute() hung"
            )
        finally:
            stop.set()
            recorder.released.set()
            execute.join(patience)
    return answers[0]


class _Hanging(MemoryRecorder):
    """Recorder that blocks in its first `append` until released."""

    def __init__(self) -> None:
        super().__init__()
        self.hangs = threading.Event()
        self.released = threading.Event()

    def append(self, time: Array, block: Array) -> None:
        super().append(time, block)
        self.hangs.set()
        self.released.wait()


class _Between:
    """Passes the backend its own trial, and the supervision its samples."""

    def __init__(self, backend: Backend, trial: Trial, disturb: Disturb) -> None:
        self._backend, self._trial, self._disturb = backend, trial, disturb
        self._recorder: Recorder
        self._stop: StopFlag
        self.after = 0
        self.made_safe: list[SafeState] = []

    def __enter__(self) -> _Between:
        return self

    def __exit__(self, *exception: object) -> None:
        return None

    def refuses(self, trial: Trial) -> str | None:
        return None

    def channels(self, trial: Trial) -> frozenset[str] | None:
        return self._backend.channels(self._trial)

    def execute(self, trial: Trial, recorder: Recorder, stop: StopFlag) -> Ending:
        self._recorder, self._stop = recorder, stop
        return self._backend.execute(self._trial, self, stop)

    def make_safe(self) -> SafeState:
        self.made_safe.append(self._backend.make_safe())
        return self.made_safe[-1]

    # A recorder

    def start(self, channels: tuple[ChannelInfo, ...]) -> None:
        self._recorder.start(channels)

    def append(self, time: Array, block: Array) -> None:
        self.after += self._stop()
        self._recorder.append(*self._disturb(time, block))

    def lost(self, time: Array) -> None:
        self._recorder.lost(time)

    def event(self, event: Event) -> None:
        self._recorder.event(event)


class _File(MemoryRecorder):
    ending: Ending | None = None

    def finish(self, ending: Ending, started: str, ended: str) -> None:
        self.ending = ending

    def measure(self, measure: Measure) -> str:
        return ""


class _Memory:
    """An archive of one trial."""

    folder = Path("memory")

    def __init__(self) -> None:
        self.file = _File()

    def begin(self, trial: Trial, keeping: SampleRetention = KEEP_ALL) -> _File:
        return self.file

    def decision(self, decision: str, reason: str, trial: int | None = None) -> None:
        return None

    def operator_step(self, trial: int, step: str, answer: str) -> None:
        return None

    def seal(self, status: RunStatus, reason: str, safe_state: SafeState, *, ended: str) -> Path:
        return self.folder
