"""The `serial` backend: a controller on a port or TCP; docs/developers/serial-protocol.md."""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from dataclasses import replace
from typing import Literal

from pydantic import Field

from campaign.axis_kind import AxisKind, Sides, sides_in
from campaign.backends.interface import BackendKind, Source, StopFlag
from campaign.channels import VOCABULARY, axis_of, info
from campaign.errors import BackendError, UsageError
from campaign.link.collect import Collector
from campaign.link.connection import Connection
from campaign.link.errors import (
    HeldError,
    LinkFaultError,
    RefusedError,
    ResetError,
    SilenceError,
    StoppedError,
)
from campaign.link.identity import identity, new_session
from campaign.link.refusal import Refusal
from campaign.link.session import Session
from campaign.link.settings import settings_of
from campaign.options import Options
from campaign.recording import ChannelInfo, Ending, Fault, Outcome, PanicStop, Recorder, SafeState
from campaign.trial import Trial
from campaign.units import Time
from campaign.wire.channel_features import named_channels
from campaign.wire.messages import Channel, Clear, Release, State, Value, WireError

RETRY = 0.2
"""s between two attempts to reach a lost controller."""
ANSWER = 1.0
"""s; time limit for an answer of a reconnected controller while it is made safe."""
LETTING_GO = 1.0
"""s in which a trial in another thread releases the line, unless it hangs."""
LOOKING = 2.0
"""s between two attempts to reconnect a lost controller while no trial runs."""
REST = 2.0
"""s; time limit to confirm rest after the controller has ended a trial."""


class SerialOptions(Options):
    """Options of a controller on a line."""

    port: str = ""
    """Address: `/dev/ttyUSB0`, `COM3`, or `socket://HOST:PORT`; `--port` sets it too."""
    baud: int = Field(default=2_000_000, ge=1200, le=20_000_000)
    """Bits per second of a serial port."""
    motion: Literal["none", "emulated"] = "none"
    """Source of hull motion: none, or a controller emulator."""
    silence: Time = Field(default=3.0, gt=0, le=10)
    """The connection is lost after this time without data or an answer."""
    safe_time: Time = Field(default=8.0, gt=0, le=9)
    """Longest time until the bench is confirmed at rest with its drive off."""


class SerialBackend:
    """Backend of one controller, reconnected after a loss; executes one trial at a time."""

    def __init__(self, options: SerialOptions) -> None:
        self._options = options
        self._refusal = self._new_refusal()
        self._number = new_session()
        self._host = identity("campaign")
        self._trials = new_session() // 2  # distinguishes trials from those of other hosts
        self._look_for_it = 0.0  # monotonic time of the next attempt to reconnect
        self._connection: Connection | None = None
        self._session: Session | None = None
        self._busy = threading.RLock()
        self._urgent = threading.Event()  # set: the bench is being made safe, all else ends

    def __enter__(self) -> SerialBackend:
        if not self._options.port:
            raise UsageError(
                "the backend 'serial' needs a port: --port /dev/ttyUSB0, or socket://HOST:PORT"
            )
        try:
            self._connect()
        except HeldError as error:
            raise BackendError(f"{self._options.port}: {error}") from None
        except LinkFaultError as error:
            raise BackendError(
                f"no controller answers by the protocol on {self._options.port}: {error}; is it "
                "the right port and baud rate, and is the controller switched on?"
            ) from None
        self._refusal = self._new_refusal()  # all trials are checked again
        return self

    def _new_refusal(self) -> Refusal:
        return Refusal(base_motion=self._options.motion == "emulated")

    def __exit__(self, *exception: object) -> None:
        self._disconnect()

    def stop_command(self) -> tuple[str, ...]:
        """Command `campaign stop`, which needs no session."""
        baud = str(self._options.baud)
        program = (sys.executable, "-P", "-m", "campaign")
        line = ("--port", self._options.port, "--baud", baud)
        return (*program, "stop", *line, "--patience", "5")

    def introduce(self, run: str) -> None:
        """Set this run as the holder that the controller reports to other hosts."""
        self._host = identity(f"run {run}")

    def panic_stop(self) -> PanicStop | None:
        """The external stop that keeps the bench off; None also while the controller is lost."""
        if not self._busy.acquire(timeout=LETTING_GO):
            return None  # a hanging trial has the line, and is abandoned
        try:
            session = self._session or self._found_again()
            return None if session is None else session.panic_stop()
        except (LinkFaultError, BackendError, UsageError):
            return None  # the next trial detects it when it arms
        finally:
            self._busy.release()

    def _found_again(self) -> Session | None:
        """Try to reconnect a lost controller, at most once per `LOOKING`."""
        now = time.monotonic()
        if now < self._look_for_it:
            return None
        self._look_for_it = now + LOOKING
        return self._connect()

    def clear_stop(self, count: int) -> None:
        """Clear the stop number `count`, so that the bench can move again."""
        with self._busy:
            try:
                (self._session or self._reconnect(self._options.silence)).clear_stop(count)
            except LinkFaultError as error:
                raise BackendError(f"the stop was not cleared: {error}") from None

    def refuses(self, trial: Trial) -> str | None:
        """Why no controller can execute `trial`, or, after connecting, why this one cannot.

        Needs no port.
        """
        return self._refusal(trial) or self._refused_by_it(trial)

    def _refused_by_it(self, trial: Trial) -> str | None:
        """Refusal by the controller's capabilities; None before it is connected."""
        session = self._session
        if session is None or session.capabilities is None:
            return None
        try:
            self._settings(session, trial)
        except RefusedError as error:
            return str(error)
        return None

    def channels(self, trial: Trial) -> frozenset[str] | None:
        """Channels in the controller's features; None before connecting, or if they name none."""
        session = self._session
        if session is None or session.capabilities is None:
            return None
        return named_channels(session.capabilities.features)

    def execute(self, trial: Trial, recorder: Recorder, stop: StopFlag) -> Ending:
        """Configure, arm, start and record `trial`; send STOP if `stop()`."""
        with self._busy:
            try:
                session = self._session or self._reconnect(self._options.silence)
            except (LinkFaultError, UsageError) as error:
                reason = f"the controller cannot be reached: {error}"
                return _fault(Fault.LOST_CONNECTION, reason, SafeState.NOT_CONFIRMED)
            try:
                return self._execute(session, trial, recorder, stop)
            except LinkFaultError as error:
                return self._broken_off(session, error)

    def make_safe(self) -> SafeState:
        """Send SAFE until the controller confirms it; connect again if necessary.

        A trial that hangs in another thread, e.g. on a full disk, keeps the line: SAFE is then sent
        over its connection nevertheless.
        """
        self._urgent.set()  # a running trial in another thread releases the line
        deadline = time.monotonic() + self._options.safe_time
        seen = held = False
        try:
            while not seen and time.monotonic() < deadline:
                held = held or self._busy.acquire(timeout=LETTING_GO)
                seen = self._seen_safe(deadline) if held else self._seen_safe_beside(deadline)
        except HeldError:
            seen = False
        finally:
            if held:
                self._busy.release()
            self._urgent.clear()
        return _state(seen)

    # One trial

    def _execute(
        self, session: Session, trial: Trial, recorder: Recorder, stop: StopFlag
    ) -> Ending:
        task = trial.task
        try:
            settings = self._settings(session, trial)
            rate, channels = session.configure(settings)
            if rate != task.sample_rate:
                raise RefusedError(
                    f"the controller records at {rate:g} Hz instead of task.sample_rate = "
                    f"{task.sample_rate:g} Hz"
                )
        except WireError as error:
            raise RefusedError(f"the configuration cannot be sent: {error}") from None
        self._trials += 1
        number = self._trials
        sides = sides_in(trial.bench)
        recorder.start(tuple(_info(channel, task.mode, sides) for channel in channels))
        if stop() or self._urgent.is_set():
            session.command(Clear())
            return Ending(Outcome.INTERRUPTED, "stopped by the operator before it moved")
        collector = Collector(session, number, rate, channels, recorder, task.duration)
        try:
            session.start(number)
            ending = collector.run(lambda: stop() or self._urgent.is_set())
            if ending.outcome is Outcome.INTERRUPTED:
                ending = replace(ending, reason=str(session.panic_stop() or ending.reason))
            ending = self._released(session, number, ending)
        except LinkFaultError as error:
            ending = self._broken_off(session, error)
        return replace(ending, telemetry=collector.telemetry())

    def _settings(self, session: Session, trial: Trial) -> dict[str, Value]:
        emulated = self._options.motion == "emulated"
        return settings_of(trial, session.capabilities, emulated=emulated)

    def _released(self, session: Session, number: int, ending: Ending) -> Ending:
        """Release the trial on the controller; confirm rest if END did not confirm it."""
        status = session.status
        if status is not None and status.state is State.ENDED:
            # Refused after a SAFE from another host: CLEAR before the next trial does the same.
            with contextlib.suppress(RefusedError):
                session.command(Release(number))
        if ending.safe_state is SafeState.CONFIRMED:
            return ending
        rested = session.rested(time.monotonic() + REST)
        return replace(ending, safe_state=_state(rested))

    def _broken_off(self, session: Session, error: LinkFaultError) -> Ending:
        """Ending of a trial after an error of the link."""
        safe, stop = False, None
        try:
            if isinstance(error, SilenceError | HeldError):
                self._disconnect(last_words=False)
            elif isinstance(error, RefusedError | ResetError | StoppedError):
                safe = session.rested(time.monotonic() + REST)
                if isinstance(error, ResetError):
                    session.hello()
                else:
                    stop = session.panic_stop()  # it may have caused the refusal
            else:
                safe = session.safe(time.monotonic() + REST)
        except (LinkFaultError, BackendError):
            safe = False
            self._disconnect()
        if stop is not None or isinstance(error, StoppedError):
            return Ending(Outcome.INTERRUPTED, str(stop or error), _state(safe))
        return _fault(error.fault, str(error), _state(safe))

    # The line

    def _connect(self) -> Session:
        connection = Connection(self._options.port, self._options.baud, self._number)
        session = Session(
            connection, self._options.silence, self._number, self._host, self._urgent.is_set
        )
        try:
            session.hello()
        except BaseException:
            connection.close()
            raise
        self._connection, self._session = connection, session
        return session

    def _reconnect(self, patience: float) -> Session:
        """Retry for `patience` (s). Raises LinkFaultError or UsageError of the last attempt."""
        deadline = time.monotonic() + patience
        while True:
            try:
                return self._connect()
            except (LinkFaultError, UsageError):
                if time.monotonic() > deadline or self._urgent.wait(RETRY):
                    raise

    def _disconnect(self, *, last_words: bool = True) -> None:
        """Release the line. Without `last_words` no SAFE is sent: the end of heartbeats stops the
        bench. A restarted controller would treat the SAFE as a stop from another host.
        """
        connection, self._connection, self._session = self._connection, None, None
        if connection is not None:
            connection.close(last_words=last_words)

    def _seen_safe(self, deadline: float) -> bool:
        """Whether SAFE is confirmed. Raises HeldError if another host holds the bench now."""
        try:
            if self._session is not None:
                return self._session.safe(deadline)
            return self._seen_safe_anew(deadline)
        except HeldError:
            self._disconnect(last_words=False)
            raise
        except ResetError:
            self._disconnect()
        except (LinkFaultError, UsageError):
            self._disconnect()
            time.sleep(RETRY)
        return False

    def _seen_safe_anew(self, deadline: float) -> bool:
        """Send HELLO, then SAFE, over a new connection; SAFE also if HELLO gets no answer.

        In an unknown session SAFE would be an external stop, which a person must clear.
        """
        self._connection = Connection(self._options.port, self._options.baud, self._number)
        session = Session(self._connection, ANSWER, self._number, self._host)
        with contextlib.suppress(SilenceError):
            session.hello()
        seen = session.safe(deadline)
        session.silence, session.given_up = self._options.silence, self._urgent.is_set
        self._session = session
        return seen

    def _seen_safe_beside(self, deadline: float) -> bool:
        """Send SAFE over the connection of a trial that neither releases nor reads it."""
        connection = self._connection
        if connection is None:
            return False  # the trial reconnects, which ends soon
        beside = Session(connection, self._options.silence, self._number, self._host)
        try:
            return beside.safe(min(deadline, time.monotonic() + REST))
        except LinkFaultError:
            return False


def _info(channel: Channel, mode: str, sides: Sides) -> ChannelInfo:
    """Channel as declared by the controller, which may treat a linear axis as rotary."""
    as_declared = ChannelInfo(
        channel.name, channel.unit, channel.label, channel.display_unit, channel.measured
    )
    axis = axis_of(channel.name, sides)
    if axis is AxisKind.ROTARY or channel.name not in VOCABULARY:
        return as_declared
    as_rotary = info(channel.name, mode)
    return (
        info(channel.name, mode, axis=axis) if as_declared.unit == as_rotary.unit else as_declared
    )


def _state(safe: bool) -> SafeState:
    return SafeState.CONFIRMED if safe else SafeState.NOT_CONFIRMED


def _fault(fault: Fault, reason: str, safe_state: SafeState) -> Ending:
    return Ending(Outcome.FAULT, reason, safe_state, fault)


BACKEND = BackendKind(
    name="serial",
    summary="a servo controller on a serial port or TCP",
    options=SerialOptions,
    open=SerialBackend,
    source=Source.HARDWARE,
    live=True,
    needs=("limits",),
    stopped_outside=True,
)
