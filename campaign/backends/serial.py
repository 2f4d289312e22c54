"""A servo controller on a serial port or a TCP connection, by `docs/serial-protocol.md`."""

from __future__ import annotations

import contextlib
import random
import threading
import time
from dataclasses import replace
from typing import Literal

from pydantic import Field

from campaign.backends.interface import BackendKind, Source, StopFlag
from campaign.backends.motion import BaseMotion, EmulatedMotion
from campaign.errors import BackendError, UsageError
from campaign.link.collect import Collector
from campaign.link.connection import Connection
from campaign.link.errors import LinkFaultError, RefusedError, ResetError, SilenceError
from campaign.link.refusal import Refusal
from campaign.link.session import Session
from campaign.options import Options
from campaign.trial import (
    ChannelInfo,
    Ending,
    Fault,
    Outcome,
    Recorder,
    SafeState,
    Trial,
)
from campaign.units import Time
from campaign.wire.configuration import REHEARSAL, configuration_of
from campaign.wire.messages import Channel, Release, State, Value, WireError

RETRY = 0.2
"""s between two attempts to reach a controller that has gone."""
LETTING_GO = 1.0
"""s in which a trial in another thread lets go of the line, unless it hangs elsewhere."""
REST = 2.0
"""s in which a controller that has ended a trial is seen at rest."""


class SerialOptions(Options):
    """Options of a controller on a line."""

    port: str = ""
    """Where it is: `/dev/ttyUSB0`, `COM3`, or `socket://HOST:PORT`; `--port` is short for it."""
    baud: int = Field(default=2_000_000, ge=1200, le=20_000_000)
    """Bits per second of a serial port."""
    motion: Literal["none", "emulated"] = "none"
    """What moves the hull: nothing, or a rehearsal controller that emulates it."""
    silence: Time = Field(default=3.0, gt=0, le=60)
    """Without a word or an answer for so long, the connection is lost."""
    safe_time: Time = Field(default=10.0, gt=0, le=600)
    """How long the bench may take to be seen at rest with its drive off."""


class SerialBackend:
    """One controller; it is found again when it was lost. One trial at a time."""

    def __init__(self, options: SerialOptions) -> None:
        self._options = options
        self._motion: BaseMotion | None = EmulatedMotion() if options.motion != "none" else None
        self._refusal = Refusal(base_motion=self._motion is not None)
        self._name = random.SystemRandom().randrange(1, 2**32)
        self._trials = 0
        self._connection: Connection | None = None
        self._session: Session | None = None
        self._busy = threading.RLock()
        self._urgent = threading.Event()  # set: the bench is being made safe, everything else ends

    def __enter__(self) -> SerialBackend:
        if not self._options.port:
            raise UsageError(
                "the backend 'serial' needs a port: --port /dev/ttyUSB0, or socket://HOST:PORT"
            )
        try:
            self._connect()
        except LinkFaultError as error:
            raise BackendError(
                f"nobody speaks the protocol on {self._options.port}: {error}; is it the right "
                "port and baud rate, and is the controller switched on?"
            ) from None
        return self

    def __exit__(self, *exception: object) -> None:
        self._disconnect()

    def refuses(self, trial: Trial) -> str | None:
        """Why no controller could execute `trial`, or None; needs no port."""
        return self._refusal(trial)

    def channels(self, trial: Trial) -> frozenset[str] | None:
        """Not known before a controller has said so."""
        return None

    def execute(self, trial: Trial, recorder: Recorder, stop: StopFlag) -> Ending:
        """Configure, arm, start and record `trial`; STOP when `stop()`."""
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
            finally:
                if self._motion is not None:
                    self._motion.stop()

    def make_safe(self) -> SafeState:
        """SAFE until the controller says that it is, over a new connection when there is none.

        A trial that hangs in another thread, on a full disk perhaps, keeps the line: it is then
        spoken on over its head.
        """
        self._urgent.set()  # a trial that still runs in another thread lets go of the line
        deadline = time.monotonic() + self._options.safe_time
        seen = held = False
        try:
            while not seen and time.monotonic() < deadline:
                held = held or self._busy.acquire(timeout=LETTING_GO)
                seen = self._seen_safe(deadline) if held else self._seen_safe_beside(deadline)
        finally:
            if held:
                self._busy.release()
            self._urgent.clear()
        if self._motion is not None and self._motion.make_safe() is not SafeState.CONFIRMED:
            seen = False
        return SafeState.CONFIRMED if seen else SafeState.NOT_CONFIRMED

    # One trial

    def _execute(
        self, session: Session, trial: Trial, recorder: Recorder, stop: StopFlag
    ) -> Ending:
        task = trial.task
        try:
            rate, channels = session.configure(self._parameters(session, trial))
            if rate != task.sample_rate:
                raise RefusedError(
                    f"the controller records at {rate:g} Hz instead of task.sample_rate = "
                    f"{task.sample_rate:g} Hz"
                )
        except WireError as error:
            raise RefusedError(f"the configuration cannot be sent: {error}") from None
        if self._motion is not None:
            self._motion.load(task.base_acceleration, task.duration)
        self._trials += 1
        number = self._trials
        recorder.start(tuple(map(_info, channels)))
        collector = Collector(session, number, rate, channels, recorder, task.duration)
        if self._motion is not None:
            self._motion.trigger()
        try:
            session.start(number)
            ending = collector.run(lambda: stop() or self._urgent.is_set())
            ending = self._released(session, number, ending)
        except LinkFaultError as error:
            ending = self._broken_off(session, error)
        return replace(ending, telemetry=collector.telemetry())

    def _parameters(self, session: Session, trial: Trial) -> dict[str, Value]:
        parameters = configuration_of(trial)
        capabilities = session.capabilities
        if capabilities is not None and REHEARSAL in capabilities.features:
            return parameters
        if trial.task.base_acceleration.shape != "zero" and self._options.motion == "emulated":
            raise RefusedError(
                "task.base_acceleration: only a rehearsal controller can emulate the hull"
            )
        return {
            name: value
            for name, value in parameters.items()
            if not name.startswith(f"{REHEARSAL}.")
        }

    def _released(self, session: Session, number: int, ending: Ending) -> Ending:
        """Let the controller forget the trial; see it at rest where its END did not say so."""
        status = session.status
        if status is not None and status.state is State.ENDED:
            # Refused when somebody sent SAFE meanwhile: CLEAR before the next trial does the same.
            with contextlib.suppress(RefusedError):
                session.command(Release(number))
        if ending.safe_state is SafeState.CONFIRMED:
            return ending
        rested = session.rested(time.monotonic() + REST)
        return replace(ending, safe_state=_state(rested))

    def _broken_off(self, session: Session, error: LinkFaultError) -> Ending:
        """How a trial ended that the session could not bring to its end."""
        safe = False
        try:
            if isinstance(error, SilenceError):
                self._disconnect()
            elif isinstance(error, RefusedError | ResetError):
                safe = session.rested(time.monotonic() + REST)
                if isinstance(error, ResetError):
                    session.hello()
            else:
                safe = session.safe(time.monotonic() + REST)
        except (LinkFaultError, BackendError):
            safe = False
            self._disconnect()
        return _fault(error.fault, str(error), _state(safe))

    # The line

    def _connect(self) -> Session:
        connection = Connection(self._options.port, self._options.baud)
        session = Session(connection, self._options.silence, self._urgent.is_set, self._name)
        try:
            session.hello()
        except BaseException:
            connection.close()
            raise
        self._connection, self._session = connection, session
        return session

    def _reconnect(self, patience: float) -> Session:
        """Try again and again for `patience` (s). LinkFaultError or UsageError of the last try."""
        deadline = time.monotonic() + patience
        while True:
            try:
                return self._connect()
            except (LinkFaultError, UsageError):
                if time.monotonic() > deadline or self._urgent.wait(RETRY):
                    raise

    def _disconnect(self) -> None:
        connection, self._connection, self._session = self._connection, None, None
        if connection is not None:
            connection.close()

    def _seen_safe(self, deadline: float) -> bool:
        try:
            session = self._session
            if session is None:
                # No `hello`: SAFE is obeyed without, even while another host has the line.
                self._connection = Connection(self._options.port, self._options.baud)
                session = Session(self._connection, self._options.silence, name=self._name)
                seen = session.safe(deadline)
                self._disconnect()  # the next trial says hello
                return seen
            return session.safe(deadline)
        except ResetError:
            self._disconnect()
        except (LinkFaultError, UsageError):
            self._disconnect()
            time.sleep(RETRY)
        return False

    def _seen_safe_beside(self, deadline: float) -> bool:
        """Over the connection of a trial that does not let go of it, and does not read it."""
        connection = self._connection
        if connection is None:
            return False  # it is being looked for, which ends soon
        beside = Session(connection, self._options.silence, name=self._name)
        try:
            return beside.safe(min(deadline, time.monotonic() + REST))
        except LinkFaultError:
            return False


def _info(channel: Channel) -> ChannelInfo:
    return ChannelInfo(
        channel.name, channel.unit, channel.label, channel.display_unit, channel.measured
    )


def _state(safe: bool) -> SafeState:
    return SafeState.CONFIRMED if safe else SafeState.NOT_CONFIRMED


def _fault(fault: Fault, reason: str, safe_state: SafeState) -> Ending:
    return Ending(Outcome.FAULT, reason, safe_state, fault)


def _open(options: Options) -> SerialBackend:
    return SerialBackend(SerialOptions.model_validate(options.model_dump(), context={"si": True}))


BACKEND = BackendKind(
    name="serial",
    summary="a servo controller on a serial port or TCP",
    options=SerialOptions,
    open=_open,
    source=Source.HARDWARE,
    live=True,
)
