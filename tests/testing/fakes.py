"""A backend that does all the interface asks for, and one broken copy for each thing it asks."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from campaign.errors import BackendError
from campaign.recording import (
    ChannelInfo,
    Ending,
    Event,
    Fault,
    Outcome,
    PanicStop,
    Recorder,
    SafeState,
)
from campaign.testing import BackendUnderTest
from campaign.trial import Task, Trial

RATE = 100.0
BLOCK = 20
CHANNELS = (
    ChannelInfo("gyro_rate", "rad/s", "Rate of the load", "deg/s"),
    ChannelInfo("motor_current", "A", "Motor current", "A"),
)


def trial(**task: Any) -> Trial:
    told = {"mode": "rate", "duration": 5.0, "window": (0.0, 5.0), "sample_rate": RATE, **task}
    return Trial(number=1, test="t", kind="move", seed=1, bench={}, task=Task.model_validate(told))


COMPLETED = Ending(Outcome.COMPLETED)
STOPPED = Ending(Outcome.INTERRUPTED, "stopped by the operator")
UNDER_WAY = Event(0.1, "under way")


@dataclass
class Quirks:
    """What a fake does; as it stands, all is well."""

    refuses: Callable[[Trial], str | None] = lambda trial: (
        "task.mode: it has no spring" if trial.task.mode == "spring" else None
    )
    channels: tuple[ChannelInfo, ...] = CHANNELS
    names: Callable[[tuple[str, ...]], frozenset[str] | None] = frozenset
    announced: int = 1
    announced_first: bool = True
    block: Callable[[np.ndarray], np.ndarray] = lambda block: block
    time: Callable[[np.ndarray], np.ndarray] = lambda time: time
    samples: int = 500
    event: Event = UNDER_WAY
    ending: Ending = COMPLETED
    stopped_ending: Ending = STOPPED
    heeds_stop: bool = True
    safe: Callable[[int], SafeState] = lambda asked: SafeState.CONFIRMED
    once: bool = False
    keeps_the_line: bool = False
    hides_exceptions: bool = False
    raises: Exception | None = None
    block_size: int = BLOCK
    first_flag_only: bool = False
    gets_through: bool = True
    stopped_by: str = "ada"
    tells: bool = True
    clears_anything: bool = False
    stays_off: bool = False
    safe_clears: bool = False
    heeds_latch: bool = True
    live: bool = True


class Fake:
    """Sines, as many as there are channels."""

    def __init__(self, quirks: Quirks, line: list[object]) -> None:
        self._quirks = quirks
        self._line = line  # whoever holds it is in it
        self._executed = self._asked = 0
        self._busy = threading.Lock()
        self._stopped: Callable[[], bool] | None = None

    def __enter__(self) -> Fake:
        if self._line:
            raise OSError("the line is taken")
        self._line.append(self)
        return self

    def __exit__(self, *exception: object) -> bool:
        if not self._quirks.keeps_the_line:
            self._line.clear()
        return self._quirks.hides_exceptions

    def refuses(self, trial: Trial) -> str | None:
        return self._quirks.refuses(trial)

    def channels(self, trial: Trial) -> frozenset[str] | None:
        return self._quirks.names(tuple(info.name for info in self._quirks.channels))

    def execute(self, trial: Trial, recorder: Recorder, stopped: Callable[[], bool]) -> Ending:
        with self._busy:
            return self._execute(trial, recorder, stopped)

    def _execute(self, trial: Trial, recorder: Recorder, stopped: Callable[[], bool]) -> Ending:
        quirks = self._quirks
        if quirks.raises is not None:
            raise quirks.raises
        self._executed += 1
        self._stopped = self._stopped if self._stopped and quirks.first_flag_only else stopped
        stopped = self._stopped
        samples = 0 if quirks.once and self._executed > 1 else quirks.samples
        for _ in range(quirks.announced if quirks.announced_first else 0):
            recorder.start(quirks.channels)
        recorder.event(quirks.event)
        for first in range(0, samples, quirks.block_size):
            if quirks.heeds_stop and stopped():
                return quirks.stopped_ending
            time = np.arange(first, min(first + quirks.block_size, samples)) / RATE
            block = np.stack([np.sin(time + row) for row in range(len(quirks.channels))])
            recorder.append(quirks.time(time), quirks.block(block))
            if not quirks.announced_first and not first:
                recorder.start(quirks.channels)
        return quirks.ending

    def make_safe(self) -> SafeState:
        self._asked += 1
        if not self._quirks.gets_through:
            with self._busy:
                return SafeState.CONFIRMED
        return self._quirks.safe(self._asked)


@dataclass
class Latch:
    """What a bench that can be stopped from outside remembers."""

    count: int = 0
    latched: bool = False

    def stop(self) -> None:
        self.count, self.latched = self.count + 1, True


class StoppableFake(Fake):
    """A Fake that somebody else can stop."""

    def __init__(self, quirks: Quirks, line: list[object], latch: Latch) -> None:
        super().__init__(quirks, line)
        self._latch = latch

    def introduce(self, run: str) -> None: ...

    def panic_stop(self) -> PanicStop | None:
        stop = PanicStop(self._latch.count, self._quirks.stopped_by)
        return stop if self._latch.latched and self._quirks.tells else None

    def clear_stop(self, count: int) -> None:
        if count != self._latch.count and not self._quirks.clears_anything:
            raise BackendError("another stop")
        self._latch.latched = self._quirks.stays_off

    def make_safe(self) -> SafeState:
        self._latch.latched = self._latch.latched and not self._quirks.safe_clears
        return super().make_safe()

    def execute(self, trial: Trial, recorder: Recorder, stopped: Callable[[], bool]) -> Ending:
        latch = self._latch
        if latch.latched and self._quirks.heeds_latch:
            return self._quirks.stopped_ending
        return super().execute(
            trial, recorder, lambda: stopped() or (latch.latched and self._quirks.heeds_latch)
        )


def stoppable(**quirks: Any) -> BackendUnderTest:
    latch, line = Latch(), list[object]()
    return replace(
        under_test(**quirks),
        open=lambda: StoppableFake(Quirks(**quirks), line, latch),
        stop_outside=latch.stop,
    )


def under_test(**quirks: Any) -> BackendUnderTest:
    if quirks.pop("stoppable", False):
        return stoppable(**quirks)
    line: list[object] = []
    failing = Quirks(ending=quirks.pop("failing", Ending(Outcome.FAULT, "hot", fault=Fault.DRIVE)))
    failing.raises = quirks.pop("failing_raises", None)
    return BackendUnderTest(
        open=lambda: Fake(Quirks(**quirks), line),
        possible=trial(),
        impossible=trial(mode="spring"),
        names="task.mode",
        live=Quirks(**quirks).live,
        failing=lambda: Fake(failing, []),
    )


def renamed(*names: str) -> tuple[ChannelInfo, ...]:
    return tuple(replace(CHANNELS[0], name=name) for name in names)


def nan_at_the_end(block: np.ndarray) -> np.ndarray:
    block[0, -1] = math.nan
    return block
