"""The plant of the emulated controller: axis, drive, current trial; and the log of the device."""

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
"""Time from drive off to standstill (s of the trial's time)."""


@dataclass(frozen=True)
class Setup:
    """Settings of a rehearsal controller, from the command line.

    Attributes:
        speed: seconds of a trial per second of the wall clock; infinite: as fast as the host takes
            samples.
        wake: called from a thread when new samples are available.
        busy: whether the line is saturated; used at infinite speed.
        now: a steady clock.
        log: log of switching the drive, stops and connections.
        latch_file: permanent memory of the latch (`new_memory` creates it); None: no permanent
            memory.
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
    """A trial that is ready to start, with its running simulation."""

    trial: Trial
    channels: tuple[Channel, ...]
    producer: Producer


class Machine:
    """The axis with at most one trial.

    Attributes:
        ring: the records of the trial.
        winding: temperature of the motor.
        trials: number of trials started since switching on.
        outcome: outcome of the trial, set at its END.
    """

    def __init__(self, setup: Setup, emit: Callable[[Record], None]) -> None:
        """`emit` is called with every new record."""
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
        return self._motion is not None and self._ending is None

    @property
    def at_rest(self) -> bool:
        return self._motion is None

    @property
    def running(self) -> int | None:
        """Number of the running trial, from 1 since switching on; None without one."""
        return None if self._motion is None else self.trials

    def refuses(self, trial: Trial) -> str | None:
        """Reason why this bench cannot be simulated in `trial`, or None."""
        return self._backend.refuses(trial)

    def arm(self, trial: Trial) -> tuple[Channel, ...]:
        """Prepare `trial`; return its channels."""
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
        """Start the motion; `number` is the host's number of the trial, for its records."""
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
        """Switch the drive off; END follows at standstill. `told`: record an event, too."""
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
        """Discard the trial in any state."""
        if self.drive_on:
            self._setup.log("drive off", why="dropped")
        for producer in (self._armed, self._motion):
            if isinstance(producer, ArmedTrial):
                producer.producer.cancel()
            elif producer is not None:
                producer.stop()
        self._armed = self._motion = self._ending = None

    def tick(self) -> list[Strike]:
        """Execute all due actions; return the faults that the controller must handle."""
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
        """Latest time (steady clock, s) for the next `tick`; infinite if nothing is due."""
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
    """Log of events in their order; without a file, it does nothing."""

    def __init__(self, file: Path | None) -> None:
        self._out: IO[str] | None = None
        if file is not None:
            self._out = file.open("a", encoding="utf-8", buffering=1)  # writes whole lines

    def __call__(self, event: str, **facts: str | int | float | bool | None) -> None:
        """Log `event`, such as `drive on`, with its facts."""
        if self._out is not None:
            self._out.write(json.dumps({"at": time.time(), "event": event, **facts}) + "\n")

    def close(self) -> None:
        if self._out is not None:
            self._out.close()
            self._out = None
