"""One trial in motion: puts due samples into the ring, applies faults at their time."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from campaign.channels import MOTOR_CURRENT
from campaign.device.clock import Pace
from campaign.device.faults import RATES, FaultSpec
from campaign.device.producer import Producer
from campaign.device.ring import Ring
from campaign.device.temperature import Winding
from campaign.recording import Array, Ending, Fault, Outcome
from campaign.wire.device import Channel, End, Event, Samples
from campaign.wire.fields import clipped
from campaign.wire.messages import Fault as FaultCode
from campaign.wire.messages import Outcome as OutcomeCode
from campaign.wire.messages import Record, samples_per_record

WINDOW = 1024
"""Largest number of unacknowledged records if the messages of the host drive the clock."""
RECORD_INTERVAL = 0.02
"""Interval of records (s of the wall clock); shorter if a frame is full earlier."""
STUCK_AFTER = 0.1
"""Time to detect a frozen sensor (s)."""
LONGEST_REASON = 900
"""bytes; a reason must fit into a frame."""


@dataclass(frozen=True)
class Strike:
    """A fault that occurs before sample number `sample` (from 0) is taken.

    Attributes:
        noticed: whether a sensor has been frozen long enough for the controller to detect it.
    """

    sample: int
    fault: FaultSpec
    noticed: bool = False


class Motion:
    """A trial from START to its END."""

    def __init__(
        self,
        rate: float,
        channels: Sequence[Channel],
        producer: Producer,
        pace: Pace,
        ring: Ring,
        winding: Winding,
        faults: Sequence[FaultSpec],
        emit: Callable[[Record], None],
        busy: Callable[[], bool],
    ) -> None:
        """`rate` of the recording (Hz); `emit` is called with every new record of the ring; `busy`
        returns whether the line is saturated.
        """
        self._busy = busy
        self._rate = rate
        self._names = [channel.name for channel in channels]
        self._producer = producer
        self._pace = pace
        self._ring = ring
        self._winding = winding
        self._emit = emit
        self._began = False
        self._frozen: dict[int, float | None] = {}
        timely = [fault for fault in faults if fault.name not in RATES]
        strikes = [Strike(math.ceil(fault.time * rate - 1e-9), fault) for fault in timely]
        self._strikes = sorted(strikes, key=lambda strike: strike.sample)
        whole = samples_per_record(channels)
        if not pace.unlimited:
            whole = min(whole, max(1, round(rate * pace.speed * RECORD_INTERVAL)))
        self._batch = whole
        self.released = 0
        """Total number of released samples."""

    @property
    def time(self) -> float:
        """Time of the next sample (s)."""
        return self.released / self._rate

    def advance(self) -> list[Strike]:
        """Release due records up to the next fault; return the faults that occurred."""
        if not self._began:
            if not self._producer.ready:
                return []
            self._began = True
            self._pace.begin()
        struck: list[Strike] = []
        while not struck and self._release(self._pace.due(self._rate)):
            struck = self._struck()
        return struck or self._struck()

    def ending(self) -> Ending | None:
        """Ending of the simulation, after all its samples are released; None before."""
        ending = self._producer.ending if self._began else None
        if ending is not None:  # events may follow the last samples
            self._take_events()
        return ending

    def deadline(self) -> float | None:
        """Due time of the next record (steady clock, s); None if it depends on other events."""
        if not self._began or self._pace.unlimited:
            return None
        ready = self._ready()
        if ready == 0 and self._until_strike() > 0:
            return None
        return self._pace.deadline(self.released + max(ready, 1) - 1, self._rate)

    def stop(self) -> None:
        """Stop the simulation."""
        self._producer.cancel()

    def event(self, time: float, text: str) -> None:
        """Put an event into the ring."""
        self._add(Event(self._ring.trial, self._ring.next, time, clipped(text, LONGEST_REASON)))

    def end(self, ending: Ending, *, safe: bool) -> None:
        """Put the END into the ring."""
        fault = ending.fault or (Fault.OTHER if ending.outcome is Outcome.FAULT else None)
        code = FaultCode[fault.name] if fault else FaultCode.NONE
        reason = clipped(ending.reason, LONGEST_REASON)
        outcome = OutcomeCode[ending.outcome.name]
        trial, number = self._ring.trial, self._ring.next
        self._add(End(trial, number, outcome, code, self.released, safe, reason))

    def freeze(self, strike: Strike) -> None:
        """Freeze the channel at its next value; schedule the detection."""
        self._frozen[self._names.index(strike.fault.channel)] = None
        notice = strike.sample + math.ceil(STUCK_AFTER * self._rate)
        self._strikes.append(replace(strike, sample=notice, noticed=True))
        self._strikes.sort(key=lambda each: each.sample)

    def _release(self, due: float) -> bool:
        """Release one record if it is due; return whether it was."""
        if self._pace.unlimited and (self._ring.used >= WINDOW or self._busy()):
            return False
        ready = self._ready()
        if ready == 0 or self.released + ready > due:
            return False
        block = self._producer.take(ready)
        self._freeze(block)
        self._winding.heat(block[self._names.index(MOTOR_CURRENT)], ready / self._rate)
        data = np.ascontiguousarray(block.T, dtype="<f8").tobytes()
        ring = self._ring
        self._add(Samples(ring.trial, ring.next, self.released, ready, data))
        self.released += ready
        self._take_events()
        return True

    def _take_events(self) -> None:
        for event in self._producer.take_events():
            self.event(event.time, event.text)

    def _ready(self) -> int:
        """Number of samples of the next record; 0 until the simulation has all of them."""
        whole = min(self._batch, self._until_strike())
        finished = self._producer.finished  # read first: then `available` is final
        ready = min(whole, self._producer.available)
        return ready if ready == whole or finished else 0

    def _freeze(self, block: Array) -> None:
        for row, value in self._frozen.items():
            if value is None:
                self._frozen[row] = value = float(block[row, 0])
            block[row] = value

    def _until_strike(self) -> int:
        if not self._strikes:
            return 2**62
        return max(0, self._strikes[0].sample - self.released)

    def _struck(self) -> list[Strike]:
        """Take the due faults: all samples before them are released, and their sample is due."""
        struck = []
        while self._strikes and self._strikes[0].sample <= self.released:
            if self._pace.due(self._rate) <= self._strikes[0].sample:
                break
            struck.append(self._strikes.pop(0))
        return struck

    def _add(self, record: Record) -> None:
        self._ring.add(record)
        self._emit(record)
