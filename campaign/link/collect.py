"""Collecting the records of a running trial; lost samples become NaN and are noted."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from pydantic import JsonValue

from campaign.link.errors import RefusedError, SilenceError, ViolationError
from campaign.link.records import MissingRecords, RecordOrder
from campaign.link.session import Session, Traffic
from campaign.plain_text import printable
from campaign.recording import Array, Ending, Fault, Outcome, Recorder, SafeState
from campaign.recording import Event as TrialEvent
from campaign.wire.messages import (
    Channel,
    End,
    Event,
    LostRecords,
    Resend,
    Samples,
    State,
    Stop,
    sample_dtype,
)
from campaign.wire.messages import Fault as FaultCode

ACKNOWLEDGE_EVERY = 64
"""Records after which the acknowledgment is sent at once, before the next heartbeat."""
BRAKING = 5.0
"""Time limit (s) for the end of a trial after STOP; then the drive is switched off."""
ENDING = 3.0
"""Time limit (s) for END after the controller has left the state running."""
STANDSTILL = 60.0
"""Time (s) without any record after which a running trial is aborted."""


class Collector:
    """Writes one running trial into a recorder.

    Attributes:
        lost: number of lost records.
    """

    def __init__(
        self,
        session: Session,
        trial: int,
        rate: float,
        channels: Sequence[Channel],
        recorder: Recorder,
        longest: float,
    ) -> None:
        """`rate` of the recording (Hz); `longest`: its maximum duration (s)."""
        self._session = session
        self._trial = trial
        self._rate = rate
        self._dtype = np.dtype(sample_dtype(channels))
        self._channels = channels
        self._recorder = recorder
        self._most = math.floor(longest * rate + 1e-9) + 1
        self._order = RecordOrder()
        self._blocks: list[Array] = []
        self._first = 0  # number of the first sample in the blocks
        self._samples = 0  # number of samples, written or in the blocks
        self._acknowledged = 0
        self._moved = time.monotonic()  # time of the last record
        self._over: float | None = None  # time at which it stopped running
        self._end: End | None = None
        self._missing = 0
        self.lost = 0
        self._bad = session.bad_frames
        session.traffic = Traffic()
        session.records = self._arrived

    def run(self, stopped: Callable[[], bool]) -> Ending:
        """Collect until the trial ends. Raises LinkFaultError after writing received samples."""
        braking: float | None = None
        try:
            while self._end is None:
                self._session.look()
                self._order_again()
                self._write()
                self._acknowledge()
                now = time.monotonic()
                if braking is None and stopped():
                    braking = now + BRAKING
                    self._brake()
                elif braking is not None and now > braking:
                    self._session.safe(now + BRAKING)
                    braking = now + 2 * BRAKING
                if self._is_over(now):
                    break
        finally:
            self._session.records = lambda record: None
            self._write()
        return self._ending()

    def telemetry(self) -> Mapping[str, JsonValue]:
        """Statistics of the line during the trial."""
        traffic, status = self._session.traffic, self._session.status
        trips = traffic.round_trips
        return {
            "round_trip_ms_p50": round(statistics.median(trips) * 1e3, 3) if trips else None,
            "round_trip_ms_max": round(max(trips) * 1e3, 3) if trips else None,
            "ring_records_max": traffic.ring_used,
            "resend_requests": self._order.resends,
            "repeated_commands": traffic.repeated_commands,
            "lost_records": self.lost,
            "lost_samples": self._missing,
            "bad_frames_host": self._session.bad_frames - self._bad,
            "bad_frames_controller_since_start": status.bad_frames if status else None,
            "bytes_received": traffic.received,
        }

    def _arrived(self, record: Samples | Event | End | LostRecords) -> None:
        if record.trial != self._trial:
            return
        self._moved = time.monotonic()
        if isinstance(record, LostRecords):
            self._order.lost(record.first, record.count)
        else:
            self._order.add(record, self._moved)

    def _order_again(self) -> None:
        now = time.monotonic()
        status = self._session.status
        if status is not None and status.trial == self._trial:
            self._order.exists(status.next_record, now)
        for first, count in self._order.requests(now):
            self._session.send(Resend(self._trial, first, count))

    def _acknowledge(self) -> None:
        if self._order.next != self._acknowledged:
            at_once = self._order.next - self._acknowledged >= ACKNOWLEDGE_EVERY
            if at_once:
                self._acknowledged = self._order.next
            self._session.wanted(self._trial, self._order.next, at_once=at_once)

    def _brake(self) -> None:
        try:
            self._session.command(Stop())
        except RefusedError:
            self._session.safe(time.monotonic() + BRAKING)

    def _is_over(self, now: float) -> bool:
        """Whether the trial has ended and its END is lost."""
        if now - self._moved > STANDSTILL:
            raise SilenceError(f"no record has come for {STANDSTILL:g} s")
        status = self._session.status
        if status is None or status.state is State.RUNNING:
            self._over = None
            return False
        if status.trial == self._trial and self._order.next < status.next_record:
            self._over = None  # further records are expected
            return False
        self._over = self._over or now
        return now - self._over > ENDING

    # What is recorded

    def _write(self) -> None:
        for item in self._order.take():
            if isinstance(item, MissingRecords):
                self.lost += item.count
                self._note(f"{item.count} records of the controller were lost")
            elif isinstance(item, Samples):
                self._take_samples(item)
            elif isinstance(item, Event):
                self._flush()
                self._recorder.event(TrialEvent(item.time, printable(item.text)))
            else:
                self._fill(item.samples)
                self._end = item
        self._flush()

    def _take_samples(self, record: Samples) -> None:
        if record.count * self._dtype.itemsize != len(record.data):
            raise ViolationError(f"record {record.number} has samples of another size")
        self._fill(record.first)
        if self._samples + record.count > self._most:
            raise ViolationError("the controller records longer than the trial can last")
        rows = np.frombuffer(record.data, dtype=self._dtype)
        block = np.empty((len(self._channels), record.count))
        for row, channel in zip(block, self._channels, strict=True):
            np.multiply(rows[channel.name], channel.scale, out=row)
        self._blocks.append(block)
        self._samples += record.count

    def _fill(self, first: int) -> None:
        """Mark the missing samples before number `first`."""
        count = first - self._samples
        if count == 0:
            return
        if count < 0 or first > self._most:
            raise ViolationError(f"sample {first} cannot follow sample {self._samples - 1}")
        self._missing += count
        self._flush()
        self._recorder.lost(np.arange(self._samples, first) / self._rate)
        self._samples = self._first = first

    def _note(self, text: str) -> None:
        self._recorder.event(TrialEvent(self._samples / self._rate, text))

    def _flush(self) -> None:
        if self._blocks:
            time = (self._first + np.arange(self._samples - self._first)) / self._rate
            self._recorder.append(time, np.concatenate(self._blocks, axis=1))
            self._blocks.clear()
            self._first = self._samples

    # How it ended

    def _ending(self) -> Ending:
        end = self._end
        if end is None:
            return Ending(
                Outcome.FAULT,
                f"the record of how the trial ended was lost{self._how_much()}",
                SafeState.NOT_CONFIRMED,
                Fault.LOST_SAMPLES,
            )
        safe = SafeState.CONFIRMED if end.safe else SafeState.NOT_CONFIRMED
        outcome = Outcome(end.outcome.text)
        fault = None if end.fault is FaultCode.NONE else Fault(end.fault.text)
        reason = printable(end.reason)
        if outcome is Outcome.FAULT:
            fault = fault or Fault.OTHER
        if self.lost or self._missing:
            report = f" (the controller: {outcome}{f', {reason}' if reason else ''})"
            if outcome is not Outcome.FAULT:
                outcome, fault = Outcome.FAULT, Fault.LOST_SAMPLES
            reason = f"samples were lost and are marked{self._how_much()}{report}"
        return Ending(outcome, reason, safe, fault)

    def _how_much(self) -> str:
        return f": {self._missing} samples in {self.lost} records"
