"""A device as the Python tables have it: what the reference must answer, state by state."""

from __future__ import annotations

from dataclasses import dataclass, field

from campaign.wire import messages as wire
from campaign.wire.statemachine import (
    SequenceNumbers,
    Turn,
    after,
    after_end,
    after_hello,
    after_silence,
    latches,
)

TIMEOUT = 100_000  # microseconds
BRAKING = 2_000_000
NOBODY = "an unnamed host"
State, NakCode = wire.State, wire.NakCode


@dataclass
class LatchModel:
    """The latch, and what is remembered of it where that works."""

    latched: bool = False
    count: int = 0
    cause: wire.LatchCause = wire.LatchCause.NONE
    by: str = ""
    session: int = 0

    def set(self, session: int, by: str) -> bool:
        """Whether it is another stop."""
        if self.latched and session != 0 and session == self.session:
            return False
        self.latched, self.cause, self.by = True, wire.LatchCause.STOPPED, by
        self.count, self.session = (self.count + 1) % 2**32, session
        return True

    def facts(self) -> tuple[bool, int, wire.LatchCause, str]:
        """What LATCH says, but for the age."""
        return self.latched, self.count, self.cause, self.by


@dataclass
class Model:
    """The axis of the console: it stops at once while `rest`."""

    state: State = State.IDLE
    numbering: SequenceNumbers = field(default_factory=SequenceNumbers)
    last: State | NakCode | None = None
    bodies: list[bytes] = field(default_factory=list)
    trial: int = 0
    records: int = 0
    first: int = 0  # record that is held
    ending: int | None = None  # since when
    session: int | None = None
    host: str = ""
    heard: int | None = None
    counter: int = 0
    latch: LatchModel = field(default_factory=LatchModel)
    kept: tuple[bool, int, wire.LatchCause, str] | None = (False, 0, wire.LatchCause.NONE, "")
    forgetful: bool = False  # it has no lasting memory at all
    memory: bool = True  # remembering works
    unremembered: bool = False  # a stop is to be remembered at the next tick
    boot: int = 7
    rest: bool = True
    persists: bool = False

    def receive(self, now: int, sequence: int, message: wire.Message) -> State | NakCode | None:
        """What ACK (a state) or NAK (a code) must say; None for what is not acknowledged."""
        result = self._receive(now, sequence, message)
        self.tick(now)
        return result

    def held(self, now: int) -> bool:
        """Whether its session is heard."""
        return self.heard is not None and now - self.heard <= TIMEOUT

    def _receive(self, now: int, sequence: int, message: wire.Message) -> State | NakCode | None:
        kind, body = wire.encode(message)
        if isinstance(message, wire.Heartbeat) and message.session == self.session:
            self.heard, self.counter = now, message.counter
            if message.trial == self.trial and self.first < message.next <= self.records:
                self.first = message.next
        if isinstance(message, wire.Bye) and message.session == self.session:
            self.heard = None
        if kind not in wire.COMMANDS:
            return None
        if isinstance(message, wire.Hello):
            return self._hello(now, sequence, message)
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

    def _hello(self, now: int, sequence: int, message: wire.Hello) -> State | NakCode:
        same = message.session == self.session
        result = after_hello(self.state, same, self.held(now))
        if isinstance(result, State):
            self.numbering.begin(message.session, sequence)
            self.session, self.host = message.session, message.host
            if not same:
                self.heard, self.counter = now, 0
            if result is not self.state:
                self._enter(result)
        return result

    def _own_reasons(self, now: int, message: wire.Message) -> NakCode | None:
        """Why a device may refuse what the table allows."""
        if isinstance(message, wire.Arm | wire.Start):
            if self.latch.latched:
                return NakCode.LATCHED
            if not self.held(now):
                return NakCode.NO_HEARTBEAT
        if isinstance(message, wire.Arm):
            if message.crc != wire.configuration_crc(self.bodies):
                return NakCode.CHECKSUM
            if not self.rest:
                return NakCode.NOT_READY
        if isinstance(message, wire.Release) and message.trial != self.trial:
            return NakCode.WRONG_TRIAL
        if isinstance(message, wire.Clear):
            if self.ending is not None:
                return NakCode.NOT_READY
            if self.state is State.FAULT and self.persists:
                return NakCode.CAUSE_PERSISTS
        if isinstance(message, wire.Unlatch):
            return self._unlatched(message)
        return None

    def _unlatched(self, message: wire.Unlatch) -> NakCode | None:
        if not self.latch.latched or message.count != self.latch.count:
            return NakCode.OTHER_STOP
        if not self.memory and not self.forgetful:
            return NakCode.NOT_READY
        self.latch.latched, self.latch.cause = False, wire.LatchCause.NONE
        self.latch.session = 0
        self._keep()
        return None

    def _carry_out(self, now: int, body: bytes, message: wire.Message, state: State) -> None:
        if isinstance(message, wire.Set):
            self.bodies.append(body)
        if isinstance(message, wire.Start):
            self.trial, self.records, self.first = message.trial, 0, 0
        if isinstance(message, wire.Stop | wire.Safe):
            self._begin_ending(now)
        outside = isinstance(message, wire.Safe) and latches(message.session, self.session)
        if outside and self.latch.set(message.session, message.host or NOBODY):
            self._keep()
        self._enter(state)

    def _keep(self) -> None:
        self.unremembered = not self.memory and not self.forgetful
        if self.memory and not self.forgetful:
            self.kept = self.latch.facts()

    def _begin_ending(self, now: int) -> None:
        if self.state is State.RUNNING and self.ending is None:
            self.ending = now

    def _enter(self, state: State) -> None:
        self.state = state
        if state is State.IDLE:
            self.bodies, self.trial, self.records, self.first = [], 0, 0, 0

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
        """Silence, the end of a trial that is ending, a stop that could not be remembered."""
        if not self.held(now):
            if self.state is not after_silence(self.state):
                self._begin_ending(now)
            self.state = after_silence(self.state)
        if self.ending is not None and (self.rest or now - self.ending >= BRAKING):
            self.ending = None
            self.records += 1
            self.state = after_end(self.state, wire.Outcome.INTERRUPTED)
        if self.unremembered and self.state not in (State.ARMED, State.RUNNING):
            self._keep()

    @classmethod
    def new(cls, past: str) -> Model:
        """As the console's `new` makes it."""
        kept = (True, 3, wire.LatchCause.STOPPED, "ada") if past == "latched 3" else cls.kept
        forgetful = past == "forgetful"
        return cls(forgetful=forgetful, kept=None if forgetful else kept, boot=6).reset()

    def reset(self) -> Model:
        """The device after its power was off and on."""
        boot = self.boot + 1
        facts = self.kept or (True, boot, wire.LatchCause.NO_MEMORY, "")
        return Model(
            latch=LatchModel(*facts), kept=self.kept, forgetful=self.forgetful, memory=self.memory,
            boot=boot,
        )  # fmt: skip

    def wiped(self) -> Model:
        """The same, with its memory gone meanwhile."""
        self.kept = None
        return self.reset()
