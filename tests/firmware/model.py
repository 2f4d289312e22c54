"""A device as the Python tables have it: what the reference must answer, state by state."""

from __future__ import annotations

from dataclasses import dataclass, field

from campaign.wire import messages as wire
from campaign.wire.statemachine import (
    Numbering,
    Turn,
    after,
    after_end,
    after_hello,
    after_silence,
)

TIMEOUT = 100_000  # microseconds
BRAKING = 2_000_000
State, NakCode = wire.State, wire.NakCode


@dataclass
class Model:
    """The axis of the console: it stops at once while `rest`."""

    state: State = State.IDLE
    numbering: Numbering = field(default_factory=Numbering)
    last: State | NakCode | None = None
    bodies: list[bytes] = field(default_factory=list)
    trial: int = 0
    records: int = 0
    ending: int | None = None  # since when
    heard: int | None = None
    rest: bool = True
    persists: bool = False

    def receive(self, now: int, sequence: int, message: wire.Message) -> State | NakCode | None:
        """What ACK (a state) or NAK (a code) must say; None for what is not acknowledged."""
        result = self._receive(now, sequence, message)
        self.tick(now)
        return result

    def _receive(self, now: int, sequence: int, message: wire.Message) -> State | NakCode | None:
        kind, body = wire.encode(message)
        if isinstance(message, wire.Heartbeat):
            self.heard = now
        if kind not in wire.COMMANDS:
            return None
        if isinstance(message, wire.Hello):
            result = after_hello(self.state, self.numbering.same_session(message.session))
            if isinstance(result, State):
                self.numbering.begin(message.session, sequence)
                self._enter(result)
            return result
        turn = self.numbering.turn(kind, sequence, body)
        if turn is Turn.OUT_OF_ORDER:
            return NakCode.OUT_OF_ORDER
        if turn is Turn.REPEATED:
            return self.last if isinstance(self.last, NakCode) else self.state
        result = after(self.state, kind)
        if isinstance(result, State):
            result = self._own_reasons(now, message) or result
        if isinstance(result, State):
            self._carry_out(now, body, message, result)
        if kind != wire.Kind.SAFE:
            self.last = result
        return result

    def _own_reasons(self, now: int, message: wire.Message) -> NakCode | None:
        """Why a device may refuse what the table allows."""
        fresh = self.heard is not None and now - self.heard <= TIMEOUT
        if isinstance(message, wire.Arm):
            if message.crc != wire.configuration_crc(self.bodies):
                return NakCode.CHECKSUM
            if fresh and not self.rest:
                return NakCode.NOT_READY
        if isinstance(message, wire.Arm | wire.Start) and not fresh:
            return NakCode.NO_HEARTBEAT
        if isinstance(message, wire.Release) and message.trial != self.trial:
            return NakCode.WRONG_TRIAL
        if isinstance(message, wire.Clear):
            if self.ending is not None:
                return NakCode.NOT_READY
            if self.state is State.FAULT and self.persists:
                return NakCode.CAUSE_PERSISTS
        return None

    def _carry_out(self, now: int, body: bytes, message: wire.Message, state: State) -> None:
        if isinstance(message, wire.Set):
            self.bodies.append(body)
        if isinstance(message, wire.Start):
            self.trial, self.records = message.trial, 0
        if isinstance(message, wire.Stop | wire.Safe):
            self._begin_ending(now)
        self._enter(state)

    def _begin_ending(self, now: int) -> None:
        if self.state is State.RUNNING and self.ending is None:
            self.ending = now

    def _enter(self, state: State) -> None:
        self.state = state
        if state is State.IDLE:
            self.bodies, self.trial, self.records = [], 0, 0

    def samples(self) -> bool:
        """Whether samples are taken."""
        taken = self.state is State.RUNNING and self.ending is None
        self.records += taken
        return taken

    def finish(self, now: int, outcome: wire.Outcome) -> None:
        """The trial's own end, or a fault."""
        self._begin_ending(now)
        if outcome is wire.Outcome.FAULT:
            self.state = State.FAULT
        self.tick(now)

    def tick(self, now: int) -> None:
        """Silence, and the end of a trial that is ending."""
        if self.heard is None or now - self.heard > TIMEOUT:
            if self.state is not after_silence(self.state):
                self._begin_ending(now)
            self.state = after_silence(self.state)
        if self.ending is not None and (self.rest or now - self.ending >= BRAKING):
            self.ending = None
            self.records += 1
            self.state = after_end(self.state, wire.Outcome.INTERRUPTED)
