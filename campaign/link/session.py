"""A session with one controller: commands, answers, unsolicited messages."""

from __future__ import annotations

import contextlib
import math
import random
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from campaign.errors import BackendError
from campaign.link.connection import Connection
from campaign.link.errors import HeldError, RefusedError, ResetError, SilenceError, StoppedError
from campaign.link.panic import panic_stop_of
from campaign.link.safe import is_safe
from campaign.plain_text import printable
from campaign.recording import PanicStop
from campaign.wire.codes import VERSION, Kind, NakCode, State, WireError
from campaign.wire.frames import FrameDecoder, encode_frame
from campaign.wire.messages import (
    Ack,
    Arm,
    Capabilities,
    Channel,
    Channels,
    Clear,
    End,
    Event,
    Hello,
    Latch,
    LostRecords,
    Message,
    Nak,
    Query,
    Release,
    Safe,
    Samples,
    Start,
    Status,
    Unlatch,
    Value,
    configuration_crc,
    decode,
    encode,
    framed,
    parameter_messages,
)

FIRST_WAIT = 0.1
"""Time (s) without an answer until a command is repeated; it increases up to LONGEST_WAIT."""
LONGEST_WAIT = 0.5
POLL = 0.02
"""Longest wait (s) of a read from the line."""
SAFE_INTERVAL = 0.03
ASKING = 0.5
"""Time limit (s) for the answer to a query of the latch."""
ASLEEP = 1.0
"""Time (s) between two reads of the line from which this program itself was suspended (SIGSTOP,
machine suspend); that time does not count as silence of the controller."""
LETTING_GO = 0.5
"""Time (s) for which a controller may still report a host that has just left."""
GREETING = 0.3
"""Time limit (s) for the answer to HELLO before an urgent SAFE."""
FRESH = 0.5
"""Time (s) for which an echoed heartbeat shows that this host holds the controller."""
GIVEN_UP = "given up: the bench is being made safe"


@dataclass
class Traffic:
    """Statistics of a session's traffic.

    Attributes:
        round_trips: times from heartbeat to status, through relay, line and controller (s).
        ring_used: largest number of records in the ring buffer of the controller.
    """

    received: int = 0
    repeated_commands: int = 0
    ring_used: int = 0
    round_trips: list[float] = field(default_factory=list)


class Session:
    """Protocol session over an open connection. Use it in one thread at a time.

    Attributes:
        silence, given_up: see `__init__`.
        capabilities: capabilities of the controller, after `hello`.
        status: the newest status, None before the first.
        latch: the newest latch, None before the first.
        records: called with every received record and LOST, in the order of the line.
        traffic: statistics since it was last replaced.
    """

    def __init__(
        self,
        connection: Connection,
        silence: float,
        number: int,
        host: str,
        given_up: Callable[[], bool] = lambda: False,
    ) -> None:
        """`silence` (s) without a message is a lost connection; `given_up` ends every wait.

        `number`: random number of the host, the same after a lost connection. `host`: its identity.
        """
        self._connection = connection
        self.silence = silence
        self.given_up = given_up
        self._decoder = FrameDecoder()
        self._sequence = random.SystemRandom().randrange(2**16)
        self._answers: dict[int, Ack | Nak | Capabilities] = {}
        self._channels: dict[int, dict[int, Channels]] = {}
        self._heard = self._looked = time.monotonic()
        self._number, self._host = number, host
        self.capabilities: Capabilities | None = None
        self.status: Status | None = None
        self.latch: Latch | None = None
        self._echoed = -math.inf  # send time of the latest own heartbeat that was echoed
        self.records: Callable[[Samples | Event | End | LostRecords], None] = lambda record: None
        self.traffic = Traffic()

    @property
    def bad_frames(self) -> int:
        """Frames that arrived damaged since the connection was opened."""
        return self._decoder.counts.bad

    def hello(self, patience: float | None = None) -> Capabilities:
        """Begin the session; with `patience`, within this time (s), regardless of `given_up`.

        Raises BackendError if the two are incompatible, HeldError if another host holds the
        controller, SilenceError without an answer.
        """
        try:
            answer = self._greet(patience)
        except RefusedError as error:
            raise BackendError(f"the controller will not talk: {error}") from None
        except SilenceError:
            if self._decoder.counts.wrong_version:
                raise BackendError(
                    "the controller speaks another version of the protocol than this program's "
                    f"({VERSION}); update its firmware or this program"
                ) from None
            raise
        if not isinstance(answer, Capabilities):
            raise BackendError("the controller broke the protocol: no capabilities")
        if answer.version != VERSION:
            raise BackendError(
                f"the controller {answer.name!r} speaks versions {answer.lowest} to "
                f"{answer.highest} of the protocol, this program version {VERSION}; update its "
                "firmware or this program"
            )
        self.capabilities = answer
        self._channels.clear()
        self._connection.holds(held=True)
        return answer

    def _greet(self, patience: float | None) -> Ack | Capabilities:
        """Send HELLO; repeat it for a short time while a previous host may just have left."""
        letting_go = time.monotonic() + (LETTING_GO if patience is None else 0.0)
        while True:
            try:
                return self.command(Hello(VERSION, VERSION, self._number, self._host), patience)
            except HeldError:
                if time.monotonic() > letting_go:
                    raise
                self.look(POLL)

    def panic_stop(self) -> PanicStop | None:
        """Query the panic stop that latches the controller.

        None without a stop, or without an answer: then a latched controller refuses the next ARM.
        """
        self._drain()
        self.latch = None
        deadline = time.monotonic() + ASKING
        while time.monotonic() < deadline and not self.given_up():
            self._connection.write(framed(Query()))
            again = time.monotonic() + FIRST_WAIT
            while time.monotonic() < again:
                self.look(POLL)
                latch: Latch | None = self.latch
                if latch is not None:
                    return panic_stop_of(latch)
        return None

    def clear_stop(self, count: int) -> None:
        """Unlatch the controller after the stop number `count`. Raises LinkFaultError."""
        self.command(Unlatch(count, self._host))

    def configure(self, parameters: Mapping[str, Value]) -> tuple[float, tuple[Channel, ...]]:
        """Clear, set and arm; return recording rate (Hz) and channels. Raises LinkFaultError."""
        self._check_stopped()
        self._become_idle()
        self._channels.clear()
        bodies = []
        for message in parameter_messages(parameters):
            bodies.append(encode(message)[1])
            self.command(message)
        self.command(Arm(configuration_crc(bodies)))
        first = next(iter(self._channels[self._sequence].values()))
        parts = sorted(self._channels[self._sequence].values(), key=lambda part: part.first)
        return first.sample_rate, tuple(channel for part in parts for channel in part.channels)

    def _check_stopped(self) -> None:
        """Raise StoppedError if the latest latch reports a stop; sends no query."""
        stop = panic_stop_of(self.latch) if self.latch is not None else None
        if stop is not None:
            raise StoppedError(stop)

    def _become_idle(self) -> None:
        """End any state left by an earlier trial or host."""
        deadline = time.monotonic() + self.silence
        while (state := self._fresh_status().state) is not State.IDLE:
            try:
                if state is State.RUNNING:
                    self.safe(deadline)
                elif state is State.ENDED:
                    self.command(Release(self._fresh_status().trial))
                else:
                    self.command(Clear())
            except RefusedError as error:
                passing = (NakCode.WRONG_STATE, NakCode.NOT_READY, NakCode.WRONG_TRIAL)
                if error.code not in passing or time.monotonic() > deadline:
                    raise
            if time.monotonic() > deadline:
                raise RefusedError(f"the controller does not leave the state {state.text}")

    def _fresh_status(self) -> Status:
        """Wait for a new status of the controller."""
        self._drain()
        self.status = None
        while True:
            self.look(POLL)
            status: Status | None = self.status
            if status is not None:
                return status
            if self.given_up():
                raise SilenceError(GIVEN_UP)

    def start(self, trial: int) -> None:
        """Start the trial: the axis moves. Raises LinkFaultError."""
        self._connection.wanted(trial, 0)
        self.command(Start(trial))

    def send(self, message: Message) -> None:
        """Send once, without waiting for an answer. Raises SilenceError if the line is lost."""
        self._connection.write(framed(message))

    def wanted(self, trial: int, record: int, *, at_once: bool) -> None:
        """Set the next wanted record in the heartbeats."""
        self._connection.wanted(trial, record, at_once=at_once)

    def safe(self, deadline: float) -> bool:
        """Send SAFE until the controller reports it; False after `deadline` (steady clock, s).

        If this program was suspended, another host may hold the controller, and SAFE would stop its
        run. Raises HeldError in this case.
        """
        self._drain()
        if self.capabilities is not None and time.monotonic() - self._echoed > FRESH:
            with contextlib.suppress(SilenceError):  # without an answer, SAFE may still arrive
                self.hello(GREETING)
        self.status = None  # only new reports are valid
        while time.monotonic() < deadline:
            self._connection.write(framed(Safe(self._number, self._host)))
            again = time.monotonic() + SAFE_INTERVAL
            while time.monotonic() < again:
                self.look(max(0.0, again - time.monotonic()))
                status: Status | None = self.status
                if status is not None and is_safe(status):
                    return True
        return False

    def rested(self, deadline: float) -> bool:
        """Wait until `deadline` for a status at rest with the drive off; whether it arrived."""
        self._drain()
        self.status = None
        while time.monotonic() < deadline:
            self.look(POLL)
            status: Status | None = self.status
            if status is not None and status.at_rest and not status.drive_on:
                return True
        return False

    def look(self, timeout: float = POLL) -> bool:
        """Process received bytes, waiting up to `timeout` (s); return whether there were any.

        Raises SilenceError after `silence` without a message, ResetError if the controller has
        restarted since `hello`.
        """
        data = self._connection.receive(timeout)
        now = time.monotonic()
        slept, self._looked = now - self._looked > ASLEEP + timeout, now
        if slept:
            self._heard = now
        if not data:
            if now - self._heard > self.silence:
                raise SilenceError(f"the controller has not been heard for {self.silence:g} s")
            return False
        self.traffic.received += len(data)
        for frame in self._decoder.feed(data):
            try:
                message = decode(frame.kind, frame.body)
            except WireError:
                continue  # an intact but unknown message, e.g. of a newer firmware
            self._heard = now
            self._take(message, now)
        return True

    def _take(self, message: Message, now: float) -> None:
        if isinstance(message, Samples | Event | End | LostRecords):
            self.records(message)
        elif isinstance(message, Status):
            self._check_boot(message.boot)
            self.status = message
            self.traffic.ring_used = max(self.traffic.ring_used, message.ring_used)
            sent = self._connection.beats.pop(message.heartbeat, None)
            if sent is not None:
                self._echoed = max(self._echoed, sent)
                self.traffic.round_trips.append(now - sent)
        elif isinstance(message, Latch):
            self.latch = message
        elif isinstance(message, Channels):
            self._channels.setdefault(message.sequence, {})[message.first] = message
        elif isinstance(message, Ack | Nak | Capabilities):
            if isinstance(message, Ack):
                self._check_boot(message.boot)
            self._answers[message.sequence] = message

    def _check_boot(self, boot: int) -> None:
        if self.capabilities is not None and boot != self.capabilities.boot:
            self.capabilities = None  # raise only once; a new `hello` is necessary
            self._connection.holds(held=False)  # the controller has lost this session
            raise ResetError("the controller started anew")

    def command(self, message: Message, patience: float | None = None) -> Ack | Capabilities:
        """Send until answered, at increasing intervals, for `patience` (s; default `silence`).

        Raises LinkFaultError.
        """
        kind, body = encode(message)
        if kind in (Kind.ARM, Kind.START) and self.given_up():
            raise SilenceError(GIVEN_UP)
        self._sequence = (self._sequence + 1) % 2**16
        self._answers.clear()
        frame = encode_frame(kind, self._sequence, body)
        now = time.monotonic()
        deadline = now + (self.silence if patience is None else patience)
        wait = FIRST_WAIT
        while now < deadline:
            self._connection.write(frame)
            again = min(deadline, now + wait)
            while now < again:
                self.look(min(POLL, again - now))
                answer = self._answer(kind)
                if answer is not None:
                    return answer
                if patience is None and self.given_up():
                    raise SilenceError(GIVEN_UP)
                now = time.monotonic()
            wait = min(LONGEST_WAIT, 2 * wait)
            self.traffic.repeated_commands += 1
        raise SilenceError(f"the controller did not answer {kind.name} for {self.silence:g} s")

    def _answer(self, kind: Kind) -> Ack | Capabilities | None:
        answer = self._answers.get(self._sequence)
        if isinstance(answer, Nak):
            name = f"{printable(answer.name)}: " if answer.name else ""
            why = printable(answer.text) or answer.code.text
            if answer.code is NakCode.LATCHED:
                raise StoppedError(self._stop_behind(why))
            if answer.code is NakCode.BUSY:
                raise HeldError(f"the controller is in use: {why}")
            raise RefusedError(f"the controller refused {kind.name}: {name}{why}", answer.code)
        if answer is None or isinstance(answer, Capabilities) != (kind is Kind.HELLO):
            return None
        if kind is Kind.ARM:
            parts = self._channels.get(self._sequence, {}).values()
            listed = sum(len(part.channels) for part in parts)
            if not parts or listed < next(iter(parts)).total:
                return None
        return answer

    def _stop_behind(self, why: str) -> PanicStop:
        """The stop for which a command was refused; queried for details, if possible."""
        return self.panic_stop() or PanicStop(0, f"an unknown host; the controller says: {why}")

    def _drain(self) -> None:
        while self.look(0.0):
            pass
