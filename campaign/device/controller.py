"""The emulated controller: commands in, answers and records out, no I/O.

`campaign.wire.statemachine` defines the state changes of commands; this module their other effects.
"""

from __future__ import annotations

import math
import secrets
from collections.abc import Callable
from dataclasses import dataclass

from campaign.backends.sim import CHANNELS
from campaign.device.configuration import ConfigurationRefusal, make_trial
from campaign.device.faults import FaultName
from campaign.device.latch import LatchMemory
from campaign.device.machine import Machine, Setup
from campaign.device.motion import Strike
from campaign.device.session import LONGEST_ARRAY, Configuration, Session
from campaign.physics.compensation import compensation_methods
from campaign.recording import Ending, Fault, Outcome
from campaign.wire import codes
from campaign.wire.channel_features import channel_features
from campaign.wire.codes import VERSION, Kind, NakCode, State, WireError
from campaign.wire.device import Ack, Capabilities, Holder, Latch, LostRecords, Nak, Status
from campaign.wire.fields import clipped
from campaign.wire.frames import Frame
from campaign.wire.host import (
    Arm,
    Bye,
    Clear,
    Heartbeat,
    Hello,
    Query,
    Release,
    Resend,
    Safe,
    Set,
    Start,
    Stop,
    Unlatch,
)
from campaign.wire.messages import Item, Message, Record, channels_messages, decode
from campaign.wire.statemachine import (
    WATCHED,
    Turn,
    after,
    after_end,
    after_hello,
    after_silence,
    latches,
)

HEARTBEAT_TIMEOUT = 0.1
"""s of the wall clock."""
PATIENCE = 3.0
"""Heartbeat timeout (s) if the messages of the host drive the clock."""
FASTEST_RECORDING = 1e5
"""Hz."""
STOPPED = Ending(Outcome.INTERRUPTED, "stopped by the operator")
FEATURES = (
    *("rate", "torque", "prescribed", "spring", "base-motion", "rehearsal"),
    *channel_features(channel.name for channel in CHANNELS),
)

Send = Callable[[int | None, Message], None]
"""Sends a message to one client, or to all clients (None)."""


@dataclass(frozen=True)
class Interruption:
    """Interruption of the line by a fault, until a time of the steady clock.

    Attributes:
        unplugged: the line is cut, and the controller continues; else the controller hangs.
    """

    until: float = -math.inf
    unplugged: bool = False


class Controller:
    """One controller with its bench, for all clients.

    Attributes:
        machine: the axis.
        state: as in STATUS.
        interruption: of the line; the owner of the line must apply it.
        bad_frames: number of discarded frames, set by the decoder's owner.
    """

    def __init__(self, setup: Setup, send: Send, timeout: float = HEARTBEAT_TIMEOUT) -> None:
        """`timeout`: largest interval of heartbeats (s of the wall clock)."""
        self._setup = setup
        self._now = setup.now
        self._timeout = timeout
        self._send = send
        self.machine = Machine(setup, self._emit)
        self.interruption = Interruption()
        self.bad_frames = 0
        self._boot = 0
        self._hot_until = -math.inf
        self.state = State.IDLE
        self._switch_on()

    def handle(self, client: int, frame: Frame) -> None:
        """Execute a frame from `client`, and answer."""
        if frame.kind & 0x80:
            return  # an echo of a device's message
        try:
            if frame.kind == Kind.SAFE:
                self._safe(client, frame)
            elif frame.kind == Kind.HELLO:
                self._hello(client, frame)
            elif frame.kind in (Kind.HEARTBEAT, Kind.RESEND, Kind.QUERY, Kind.BYE):
                self._unnumbered(client, frame)
            elif self._session.client not in (None, client):
                raise ConfigurationRefusal(NakCode.BUSY, "", self._held_by())
            else:
                self._command(client, frame)
        except ConfigurationRefusal as why:
            self._refuse(client, frame, why)

    def tick(self) -> None:
        """Execute all due actions."""
        self._latch.remember()
        if self.state in WATCHED and self._now() >= self._silent_at():
            self._silence()
        for strike in self.machine.tick():
            self._strike(strike)
        if self.machine.outcome is not None and self.state is State.RUNNING:
            if self.machine.outcome is Outcome.FAULT:
                self._fault = codes.Fault.OTHER
            self._enter(after_end(self.state, codes.Outcome[self.machine.outcome.name]))

    def deadline(self) -> float:
        """Latest time (steady clock, s) for the next `tick`; infinite if nothing is due."""
        silent_at = self._silent_at() if self.state in WATCHED else math.inf
        return min(silent_at, self.machine.deadline())

    # Answers

    def status(self) -> Status:
        """Present STATUS."""
        ring, now = self.machine.ring, self._now()
        heard = self._session.heard_at
        return Status(
            state=self.state,
            fault=self._fault,
            at_rest=self.machine.at_rest,
            drive_on=self.machine.drive_on,
            boot=self._boot,
            clock=now - self._on_since,
            heartbeat=self._session.heartbeat,
            heartbeat_age=now - max(heard, self._on_since),
            trial=ring.trial,
            first_record=ring.first,
            next_record=ring.next,
            ring_used=ring.used,
            bad_frames=self.bad_frames,
            temperature=self.machine.winding.celsius,
        )

    def _is_held(self) -> bool:
        return self._session.client is not None and self._now() < self._silent_at()

    def _held_by(self) -> str:
        return f"it is held by {self._session.host or 'a host that did not say its name'}"

    def _holder(self) -> Holder:
        heard = self._session.heard_at
        age = self._now() - heard if math.isfinite(heard) else None
        return Holder(self._is_held(), age, clipped(self._session.host))

    def _capabilities(self, sequence: int, version: int) -> Capabilities:
        clock = ("message-clock",) if math.isinf(self._setup.speed) else ()
        return Capabilities(
            sequence=sequence,
            version=version,
            lowest=VERSION,
            highest=VERSION,
            boot=self._boot,
            state=self.state,
            heartbeat_timeout=self._timeout,
            ring_records=self.machine.ring.capacity,
            longest_array=LONGEST_ARRAY,
            sample_rate=FASTEST_RECORDING,
            name=clipped(f"rehearsal of {self._setup.bench.name}"),
            firmware="campaign device",
            features=(*FEATURES, *clock),
            compensations=tuple(compensation_methods()),
            limits=tuple(
                Item(f"limits.{name}", bound)
                for name, bound in self._setup.bench.limits
                if math.isfinite(bound)
            ),
        )

    def _refuse(self, client: int, frame: Frame, why: ConfigurationRefusal) -> Nak:
        name, text = clipped(why.name), clipped(why.text)
        nak = Nak(frame.sequence, frame.kind, why.code, self.state, name, text)
        self._send(client, nak)
        return nak

    def _emit(self, record: Record) -> None:
        if self._session.client is not None:
            self._send(self._session.client, record)

    def _enter(self, state: State) -> None:
        if state is State.IDLE:
            self._configuration = Configuration()
            self._fault = codes.Fault.NONE
        if state is not self.state:
            self.state = state
            self._send(None, self.status())

    # Messages that are not numbered

    def _safe(self, client: int, frame: Frame) -> None:
        message = decode(frame.kind, frame.body)
        if not isinstance(message, Safe):
            raise TypeError("every SAFE is one")
        from_outside = latches(message.session, self._session.number)
        by = message.host or "an unnamed host"
        why = f"panic stop by {by}" if from_outside else "switched off by SAFE"
        self.machine.switch_off(Ending(Outcome.INTERRUPTED, clipped(why)))  # before anything else
        news = from_outside and self._latch.set(message.session, clipped(by))
        if news:
            self._setup.log("latched", count=self._latch.stop.count, by=by)
        state = after(self.state, Kind.SAFE)
        if isinstance(state, State):
            self._enter(state)
        self._send(client, Ack(frame.sequence, Kind.SAFE, self.state, self._boot))
        self._send(client, self.status())
        if from_outside:
            self._send(None if news else client, self._latch.message())

    def _hello(self, client: int, frame: Frame) -> None:
        message = _decoded(frame)
        if not isinstance(message, Hello):
            raise TypeError("every HELLO is one")
        same = self._session.numbering.same_session(message.session)
        if not message.lowest <= VERSION <= message.highest:
            self._send(client, self._capabilities(frame.sequence, 0))
            return
        state = after_hello(self.state, same, self._is_held())
        if isinstance(state, NakCode):
            raise ConfigurationRefusal(state, "", self._held_by())
        self._session.begin(client, message.session, frame.sequence, message.host, self._now())
        self._setup.log("hello", host=message.host)
        self._enter(state)
        self._send(client, self._capabilities(frame.sequence, VERSION))
        self._send(client, self._latch.message())

    def _unnumbered(self, client: int, frame: Frame) -> None:
        try:
            message = decode(frame.kind, frame.body)
        except WireError:
            return  # these messages are not acknowledged; the host repeats important ones
        ring = self.machine.ring
        if isinstance(message, Heartbeat):
            if message.session == self._session.number:
                self._session.heard_at = self._now()
                self._session.heartbeat = message.counter
                if message.trial == ring.trial:
                    ring.free(message.next)
            self._send(client, self.status())
        elif isinstance(message, Bye):
            if message.session == self._session.number:
                self._session.heard_at = -math.inf
        elif isinstance(message, Query):
            for answer in (self.status(), self._latch.message(), self._holder()):
                self._send(client, answer)
        elif isinstance(message, Resend):
            held = message.trial == ring.trial != 0
            lost = (LostRecords(message.trial, message.first, message.count),)
            for record in ring.again(message.first, message.count) if held else lost:
                self._send(client, record)

    # Commands

    def _command(self, client: int, frame: Frame) -> None:
        turn = self._session.numbering.turn(frame.kind, frame.sequence, frame.body)
        if turn is Turn.OUT_OF_ORDER:
            text = "neither the next command nor the last one again"
            raise ConfigurationRefusal(NakCode.OUT_OF_ORDER, "", text)
        if turn is Turn.REPEATED:
            for answer in self._session.answers:
                # A stop may have occurred since.
                self._send(client, self._latch.message() if isinstance(answer, Latch) else answer)
            return
        try:
            self._session.answers = self._carried_out(client, frame, _decoded(frame))
        except ConfigurationRefusal as why:
            self._session.answers = (self._refuse(client, frame, why),)

    def _carried_out(self, client: int, frame: Frame, message: Message) -> tuple[Message, ...]:
        """Execute a new command; return the answers. Raises ConfigurationRefusal."""
        state = after(self.state, Kind(frame.kind))
        if isinstance(state, NakCode):
            raise ConfigurationRefusal(state, "", f"not in state {self.state.text}")
        further = self._do(message, frame)
        # STOP does not change the state; the end of the trial does.
        ack = Ack(frame.sequence, Kind(frame.kind), state, self._boot)
        for answer in (ack, *further):
            self._send(client, answer)
        self._enter(state)
        return (ack, *further)

    def _do(self, message: Message, frame: Frame) -> tuple[Message, ...]:
        """Effect of a command other than the state change. Raises ConfigurationRefusal."""
        match message:
            case Set():
                self._configuration.add(frame.body, message.items)
            case Arm():
                self._check_latch()
                return self._arm(message, frame)
            case Unlatch():
                return self._unlatch(message)
            case Start():
                self._check_latch()
                self._check_heard()
                self.machine.start(message.trial)
            case Stop():
                self.machine.switch_off(STOPPED)
            case Release():
                if message.trial != self.machine.ring.trial:
                    text = f"the records are of trial {self.machine.ring.trial}"
                    raise ConfigurationRefusal(NakCode.WRONG_TRIAL, "", text)
                self.machine.ring.begin(0)
            case Clear():
                self._clear()
        return ()

    def _arm(self, message: Arm, frame: Frame) -> tuple[Message, ...]:
        self._check_heard()
        trial = make_trial(self._setup.bench, self._configuration.whole(message.crc))
        why = self.machine.refuses(trial)
        if why is not None:
            raise ConfigurationRefusal(NakCode.OUT_OF_RANGE, "", why)
        channels = self.machine.arm(trial)
        return tuple(channels_messages(frame.sequence, trial.task.sample_rate, channels))

    def _clear(self) -> None:
        if not self.machine.at_rest:
            raise ConfigurationRefusal(NakCode.NOT_READY, "", "the axis is not yet at rest")
        if self._now() < self._hot_until:
            raise ConfigurationRefusal(NakCode.CAUSE_PERSISTS, "", "the motor is still too hot")
        self.machine.drop()
        self.machine.ring.begin(0)

    def _check_latch(self) -> None:
        if self._latch.latched:
            text = f"stopped by {self._latch.stop.by or 'an unknown host'}"
            raise ConfigurationRefusal(NakCode.LATCHED, "", text)

    def _unlatch(self, message: Unlatch) -> tuple[Message, ...]:
        try:
            cleared = self._latch.clear(message.count)
        except OSError as error:
            text = f"it could not be remembered: {error.strerror}"
            raise ConfigurationRefusal(NakCode.NOT_READY, "", text) from None
        if not cleared:
            text = f"its latest stop is number {self._latch.stop.count}"
            raise ConfigurationRefusal(NakCode.OTHER_STOP, "", text)
        self._setup.log("cleared", count=message.count, by=message.host)
        return (self._latch.message(),)

    def _check_heard(self) -> None:
        if self._now() >= self._silent_at():
            raise ConfigurationRefusal(
                NakCode.NO_HEARTBEAT, "", "no heartbeat has been heard lately"
            )

    # Actions of the controller without a command

    def _silent_at(self) -> float:
        return self._session.heard_at + self._timeout

    def _silence(self) -> None:
        reason = f"no heartbeat for {self._timeout * 1e3:g} ms"
        self._fail(Fault.HEARTBEAT, reason)
        self._enter(after_silence(self.state))

    def _fail(self, fault: Fault, reason: str) -> None:
        self._fault = codes.Fault[fault.name]
        self.machine.switch_off(Ending(Outcome.FAULT, reason, fault=fault), told=True)
        self._enter(State.FAULT)

    def _strike(self, strike: Strike) -> None:
        """Apply a requested fault."""
        fault = strike.fault
        until = self._now() + fault.seconds
        match fault.name:
            case FaultName.STALL:
                self.interruption = Interruption(until)
            case FaultName.UNPLUG:
                self.interruption = Interruption(until, unplugged=True)
            case FaultName.REBOOT:
                self._switch_on()
                self.interruption = Interruption(until)
            case FaultName.SENSOR:
                self._fail(Fault.SENSOR, f"{fault.channel} is stuck")
            case FaultName.OVER_TEMPERATURE:
                self._hot_until = until
                celsius = self.machine.winding.overheat()
                self._fail(Fault.OVER_TEMPERATURE, f"the motor is too hot: {celsius:.0f} degC")
            case FaultName.LIMIT_SWITCH:
                self._fail(Fault.LIMIT_SWITCH, "the axis has run into a limit switch")

    def _switch_on(self) -> None:
        """Start as after a reset: with an empty memory except the latch, and a new boot number."""
        self.machine.drop()
        self.machine.ring.begin(0)
        self.machine.outcome = None
        before = self._boot
        while self._boot == before:
            self._boot = secrets.randbits(32)
        self._on_since = self._now()
        self._latch = LatchMemory(self._setup.latch_file, self._boot)
        self._setup.log("switched on", boot=self._boot, latched=self._latch.latched)
        self._session = Session()
        self._configuration = Configuration()
        self._fault = codes.Fault.NONE
        self.state = State.IDLE


def _decoded(frame: Frame) -> Message:
    """The message. Raises ConfigurationRefusal for a malformed one."""
    try:
        return decode(frame.kind, frame.body)
    except WireError as error:
        known = frame.kind in set(Kind)
        code = NakCode.MALFORMED if known else NakCode.UNKNOWN_MESSAGE
        raise ConfigurationRefusal(code, "", str(error)) from None
