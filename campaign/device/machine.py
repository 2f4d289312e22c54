"""The plant of the emulated controller: axis, drive, current trial; and the log of the drive."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic
from typing import IO

from campaign.axis_kind import sides_in
from campaign.backends.sim import CHANNELS, SimBackend, SimOptions, announced
from campaign.device.clock import Now, Pace
from campaign.device.faults import FaultName, FaultSpec
from campaign.device.motion import Motion, Strike
from campaign.device.producer import Producer
from campaign.device.ring import Ring
from campaign.device.temperature import Winding
from campaign.physics.complete import CompleteBench
from campaign.recording import Ending, Outcome
from campaign.trial import Trial
from campaign.wire.device import Channel
from campaign.wire.messages import Record

RING_RECORDS = 4096
COAST = 0.05
"""s of the trial's time from drive off to standstill."""


@dataclass(frozen=True)
class Setup:
    """What a rehearsal stands for, as the command line says.

    Attributes:
        speed: seconds of a trial per second of the wall clock; infinite: as fast as the host takes
            them.
        wake: called from a thread when samples are there that were waited for.
        busy: whether the line has enough to do for now; asked where the speed is infinite.
        now: a steady clock.
        log: is told whenever the drive goes on or off.
        latch_file: where the latch is remembered (`new_memory` makes it); None: nowhere, as
            without lasting memory.
    """

    bench: CompleteBench
    speed: float = 1.0
    faults: Sequence[FaultSpec] = ()
    wake: Callable[[], None] = lambda: None
    busy: Callable[[], bool] = lambda: False
    now: Now = field(default=monotonic)
    log: DeviceLog = field(default_factory=lambda: DeviceLog(None))
    latch_file: Path | None = None


@dataclass(frozen=True)
class ArmedTrial:
    """A trial that is ready to start, with its simulation under way."""

    trial: Trial
    channels: tuple[Channel, ...]
    producer: Producer


class Machine:
    """The axis with at most one trial.

    Attributes:
        ring: the records of the trial.
        winding: how warm the motor is.
        trials: started since it was switched on.
        outcome: how the trial ended, from its END on.
    """

    def __init__(self, setup: Setup, emit: Callable[[Record], None]) -> None:
        """`emit` is told of every new record."""
        self._setup = setup
        self._emit = emit
        self._backend = SimBackend(SimOptions())
        self.ring = Ring(RING_RECORDS)
        self.winding = Winding(setup.bench.motor.resistance)
        self.trials = 0
        self.outcome: Outcome | None = None
        self._armed: ArmedTrial | None = None
        self._motion: Motion | None = None
        self._ending: Ending | None = None
        self._rest_at = -math.inf

    @property
    def drive_on(self) -> bool:
        """Whether the drive is on."""
        return self._motion is not None and self._ending is None

    @property
    def at_rest(self) -> bool:
        """Whether the axis stands still."""
        return self._motion is None

    @property
    def running(self) -> int | None:
        """Which trial it is in, from 1 since it was switched on; None while it is in none."""
        return None if self._motion is None else self.trials

    def refuses(self, trial: Trial) -> str | None:
        """Why this bench cannot be simulated in `trial`, or None."""
        return self._backend.refuses(trial)

    def arm(self, trial: Trial) -> tuple[Channel, ...]:
        """Get ready for `trial`; what it will record."""
        self.drop()
        names = [channel.name for channel in CHANNELS]
        channels = tuple(
            Channel(info.name, info.unit, info.display_unit, info.label, info.measured)
            for info in announced(names, trial.task.mode, sides_in(trial.bench))
        )
        producer = Producer(self._backend, trial, self._setup.wake)
        producer.begin()
        self._armed = ArmedTrial(trial, channels, producer)
        return channels

    def start(self, number: int) -> None:
        """Set the axis in motion; `number` is the host's for its records."""
        armed = self._armed
        if armed is None:
            raise RuntimeError("not armed")
        self._armed, self.outcome = None, None
        self.trials += 1
        self.ring.begin(number)
        self._setup.log("drive on", trial=number)
        self._motion = Motion(
            armed.trial.task.sample_rate,
            armed.channels,
            armed.producer,
            Pace(self._setup.speed, self._setup.now),
            self.ring,
            self.winding,
            [fault for fault in self._setup.faults if fault.meets(self.trials)],
            self._emit,
            self._setup.busy,
        )

    def switch_off(self, ending: Ending, *, told: bool = False) -> None:
        """Drive off; END follows at standstill. `told`: the reason becomes an event as well."""
        if self._armed is not None:
            self.drop()
        if self._motion is None or self._ending is not None:
            return
        self._setup.log("drive off", why=ending.reason or str(ending.outcome))
        self._motion.stop()
        if told:
            self._motion.event(self._motion.time, ending.reason)
        self._ending = ending
        self._rest_at = self._setup.now() + COAST / self._setup.speed

    def drop(self) -> None:
        """Forget the trial, whatever has become of it."""
        if self.drive_on:
            self._setup.log("drive off", why="dropped")
        for producer in (self._armed, self._motion):
            if isinstance(producer, ArmedTrial):
                producer.producer.cancel()
            elif producer is not None:
                producer.stop()
        self._armed = self._motion = self._ending = None

    def tick(self) -> list[Strike]:
        """Do what is due; returns the faults that the controller has to deal with."""
        struck = []
        if self._motion is not None and self._ending is None:
            for strike in self._motion.advance():
                if strike.fault.name is FaultName.SENSOR and not strike.noticed:
                    self._motion.freeze(strike)
                else:
                    struck.append(strike)
            if not struck and (ending := self._motion.ending()) is not None:
                self.switch_off(ending)
        if self._ending is not None and self._setup.now() >= self._rest_at:
            self._finish(self._ending)
        return struck

    def deadline(self) -> float:
        """When (of the steady clock) `tick` is due at the latest; infinite when nothing is."""
        if self._ending is not None:
            return self._rest_at
        due = self._motion.deadline() if self._motion is not None else None
        return math.inf if due is None else due

    def _finish(self, ending: Ending) -> None:
        if self._motion is None:
            raise RuntimeError("an ending without a motion")
        self._motion.end(ending, safe=True)
        self.outcome = ending.outcome
        self._motion = self._ending = None


class DeviceLog:
    """Appends what happens, in the order in which it happened; without a file, nothing."""

    def __init__(self, file: Path | None) -> None:
        self._out: IO[str] | None = None
        if file is not None:
            self._out = file.open("a", encoding="utf-8", buffering=1)  # a line is never torn

    def __call__(self, event: str, **facts: str | int | float | bool | None) -> None:
        """Note `event`, such as `drive on`, with what belongs to it."""
        if self._out is not None:
            self._out.write(json.dumps({"at": time.time(), "event": event, **facts}) + "\n")

    def close(self) -> None:
        """Nothing more happens."""
        if self._out is not None:
            self._out.close()
            self._out = None
