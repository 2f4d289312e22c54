"""The `canopen` backend: one CiA 402 drive on a CAN bus; docs/canopen.md."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Mapping
from typing import Any

import numpy as np
from pydantic import Field

from campaign.axis_kind import AxisKind, sides_in
from campaign.backends.interface import BackendKind, Source, StopFlag
from campaign.canopen_drive import objects as od
from campaign.canopen_drive.address import BITRATE, address_of
from campaign.canopen_drive.client import Client, Start, start_process
from campaign.canopen_drive.drive import DriveError
from campaign.canopen_drive.ends import End
from campaign.canopen_drive.player import (
    HEARTBEAT_LOST,
    EndedError,
    Player,
    channels,
    ending_of,
    safe_state,
)
from campaign.canopen_drive.proof import RATE as PROOF_RATE
from campaign.canopen_drive.proof import Proof
from campaign.canopen_drive.settings import (
    PROMISED,
    beyond_bus,
    bus_load,
    compare_eds,
    present,
    set_limits,
    set_pdos,
    set_reactions,
    set_times,
    written,
)
from campaign.canopen_drive.state import State, state_of
from campaign.canopen_drive.targets import targets_of
from campaign.canopen_drive.units import Scale, scale_of
from campaign.errors import BackendError, UsageError
from campaign.link.identity import identity
from campaign.link.refusal import Refusal
from campaign.options import Options
from campaign.physics.bench import LimitsOptions
from campaign.recording import Ending, Event, Fault, Outcome, PanicStop, Recorder, SafeState
from campaign.trial import Trial
from campaign.units import Current, Time, Torque

RETRY = 0.2
"""s between two attempts to connect again."""
OVERSHOOT = 1.2
"""Permitted rate of one sample as a multiple of the rate limit, which applies to a mean."""
JITTER_TIME = 0.5
"""s; duration of the jitter measurement before a rate above the promised one."""


class CanopenOptions(Options):
    """Options of a drive."""

    port: str = ""
    """Address: `can://INTERFACE/CHANNEL?node=N`, such as `can://socketcan/can0?node=5`."""
    heartbeat: Time = Field(default=0.2, ge=0.05, le=5)
    """The drive stops after this time without a heartbeat."""
    silence: Time = Field(default=2.0, ge=0.1, le=60)
    """A trial stops after this time without a sign of life of this program."""
    late: Time | None = Field(default=None, gt=0, le=60)
    """Largest delay of a SYNC and of its answer; absent: half of the sample period."""
    safe_time: Time = Field(default=8.0, gt=0, le=9)
    """Longest time until the drive is confirmed at rest and off."""
    eds: str = ""
    """Path of the drive's EDS, to compare vendor, product and data types."""
    reverse: bool = False
    """Whether the drive counts in the opposite direction."""
    units_per_turn: float | None = Field(default=None, gt=0)
    """Units of 6064h per turn of the load; absent: by the drive's own factors."""
    rate_units: float | None = Field(default=None, gt=0)
    """Units of 606Ch at one turn of the load per second; absent: by the drive's own factors."""
    rated_torque: Torque | None = Field(default=None, gt=0)
    """Rated torque of the motor, to convert per mille; absent: 6076h."""
    rated_current: Current | None = Field(default=None, gt=0)
    """Rated current of the motor; absent: 6075h."""
    clear_fault: bool = False
    """Clear a fault of the drive when connecting. Find its cause first."""


class CanopenBackend:
    """Backend of one drive; executes one trial at a time."""

    def __init__(self, options: CanopenOptions, start: Start = start_process) -> None:
        self._options, self._start = options, start
        self._refusal = self._new_refusal()
        self._host = identity("campaign")
        self._client: Client | None = None
        self._own: dict[od.Item, int] = {}  # original limits of the drive
        self._proved: set[tuple[str, Scale]] = set()  # passed proofs: motion, scale
        self._found = (0, 0)  # boots and 1016h, after its reactions were set
        self._busy = threading.RLock()
        self._urgent = threading.Event()  # set: the drive is made safe, a running trial ends

    def __enter__(self) -> CanopenBackend:
        try:
            self._connect()
        except BaseException as error:
            self._disconnect()
            if not isinstance(error, DriveError):
                raise
            summary = "no drive answers" if error.silent else "the drive cannot be used"
            raise BackendError(f"{self._options.port}: {summary}: {error}") from None
        self._refusal = self._new_refusal()  # all trials are checked again
        return self

    def __exit__(self, *exception: object) -> None:
        client = self._client
        # Do not restore the drive's limits while a trial hangs.
        if client is not None and self._busy.acquire(blocking=False):
            for item, value in {**self._own, od.CONSUMER: 0}.items():  # the heartbeat ends last
                try:
                    client.write(item, value)
                except DriveError as error:  # restore the others nevertheless
                    if error.silent:
                        break
            self._busy.release()
        self._disconnect()

    def introduce(self, run: str) -> None:
        """Set this run as the holder that `campaign status` shows."""
        self._host = identity(f"run {run}")

    def stop_command(self) -> tuple[str, ...]:
        """Command `campaign stop`: through the process that owns the bus, or on the bus."""
        program = (sys.executable, "-P", "-m", "campaign")
        return (*program, "stop", "--port", self._options.port, "--patience", "5")

    def panic_stop(self) -> PanicStop | None:
        """The external stop, from this computer's latch; the drive has none."""
        try:
            latched = self._client.ask("latch") if self._client is not None else None
        except DriveError:
            return None  # the next trial detects it
        return None if latched is None else PanicStop(*latched)

    def clear_stop(self, count: int) -> None:
        """Clear the stop number `count`, so that the drive can move again."""
        try:
            if self._client is not None and self._client.ask("clear", count=count):
                return
        except DriveError as error:
            raise BackendError(f"the stop was not cleared: {error}") from None
        raise BackendError(f"{count} is not the latest stop")

    # Refusals

    def _new_refusal(self) -> Refusal:
        return Refusal(base_motion=False, remedy="a drive moves its own axis alone")

    def refuses(self, trial: Trial) -> str | None:
        """Why the drive, or its bus, cannot execute `trial`."""
        return self._refusal(trial) or self._beyond_drive(trial) or self._beyond_bus(trial)

    def _beyond_drive(self, trial: Trial) -> str | None:
        task = trial.task
        if task.mode not in ("rate", "torque"):
            return f"task.mode = {task.mode!r}: a drive has the modes rate and torque"
        if task.compensation != "none":
            return (
                "task.compensation: a loop through CAN and this computer is slower than the "
                "drive's own; a compensation belongs into the drive"
            )
        for path in trial.point:
            if path.startswith(("bench.controller", "bench.compensation")):
                return f"{path}: the loops are the drive's own, and set with its vendor's tool"
        if sides_in(trial.bench).load is AxisKind.LINEAR:
            return "bench.axis.kind = 'linear': this backend has rotary axes only"
        return None

    def _beyond_bus(self, trial: Trial) -> str | None:
        rate = trial.task.sample_rate
        reason = beyond_bus(rate, self._bitrate, self._options.heartbeat)
        if reason is not None or rate <= PROMISED or self._client is None:
            return reason
        try:
            count = round(JITTER_TIME * rate)
            counted = present(self._client, od.COUNTER) is not None
            jitter = self._client.ask("jitter", period=1 / rate, count=count, counted=counted)
        except DriveError as error:
            return f"task.sample_rate = {rate:g} Hz: the jitter cannot be measured: {error}"
        if jitter > self._late(1 / rate):
            return (
                f"task.sample_rate = {rate:g} Hz: SYNC was up to {jitter * 1e3:.2g} ms late, at "
                f"most {self._late(1 / rate) * 1e3:.2g} ms is allowed; take {PROMISED:g} Hz"
            )
        return None

    @property
    def _bitrate(self) -> int:
        return address_of(self._options.port).bitrate if self._options.port else BITRATE

    def _late(self, period: float) -> float:
        return self._options.late or 0.5 * period

    def channels(self, trial: Trial) -> frozenset[str]:
        return frozenset(each.name for each in channels(trial.task.mode))

    # A trial

    def execute(self, trial: Trial, recorder: Recorder, stop: StopFlag) -> Ending:
        """Set limits and ramps, prove the drive (once per scale), play the targets."""
        with self._busy:
            self._urgent.clear()
            try:
                client = self._still_set() or self._connect()
                recorder.start(channels(trial.task.mode))
                return self._execute(client, trial, recorder, stop)
            except (BackendError, UsageError) as error:
                reason, fault = f"the drive cannot be reached: {error}", Fault.LOST_CONNECTION
            except DriveError as error:
                reason = str(error)
                fault = Fault.LOST_CONNECTION if error.silent else Fault.REFUSED
            safe = self._seen_safe(time.monotonic() + RETRY)
            if fault is Fault.LOST_CONNECTION:
                self._disconnect()
            return Ending(Outcome.FAULT, reason, safe_state(seen=safe), fault)

    def _execute(self, client: Client, trial: Trial, recorder: Recorder, stop: StopFlag) -> Ending:
        task = trial.task
        limits = LimitsOptions.model_validate(trial.bench["limits"], context={"si": True})
        panic_stop = self.panic_stop()
        if panic_stop is not None or stop() or self._urgent.is_set():
            return Ending(Outcome.INTERRUPTED, str(panic_stop or "stopped by the operator"))
        if (fault := self._in_fault(client)) is not None:
            return fault
        scale = self._scale_for(client, trial)
        if lacking := set_limits(client, limits, scale, self._own):
            remark = f"limits that the drive lacks, and this program alone watches: {lacking}"
            recorder.event(Event(0.0, remark))
        counted, here = set_times(client, 1 / PROOF_RATE), client.read(od.POSITION)
        angle = here / scale.position
        if abs(angle) > limits.angle:
            raise DriveError(f"the load stands at {angle:.4g} rad, beyond limits.angle; set zero")
        base = {
            "farthest": limits.angle * abs(scale.position),
            "fastest": OVERSHOOT * limits.rate * abs(scale.rate),
            "strongest": limits.torque * abs(scale.torque) + 1,
            "counted": counted,
            "patience": self._late(1 / task.sample_rate),
        }
        player = Player(client, base, lambda: stop() or self._urgent.is_set())
        proof = Proof(client, player.rows, scale, limits)
        try:
            self._prove(client, trial, proof)
            proof.goes_to(round(task.start_angle * scale.position), fast=True)
        except EndedError as error:
            return ending_of(error.end, {})
        targets = targets_of(task)
        rate = task.mode == "rate"
        factor = scale.rate if rate else scale.torque
        slope = min(max(1, round(targets.slope * abs(factor))), 2**32 - 1)
        for ramp in (od.ACCELERATION, od.DECELERATION) if rate else (od.TORQUE_SLOPE,):
            written(client, ramp, slope)
        set_times(client, 1 / task.sample_rate)
        job: dict[str, Any] = {
            "mode": od.PROFILE_VELOCITY if rate else od.PROFILE_TORQUE,
            "targets": [int(each) for each in np.rint(targets.values * factor)],
            "period": 1 / task.sample_rate,
        }
        if task.stop_rate is not None:
            job["stop"] = task.stop_rate * abs(scale.rate)
        command = task.command.sample(np.arange(len(job["targets"])) / task.sample_rate)
        end = player.record(job, recorder, command, scale)
        load = bus_load(task.sample_rate, self._bitrate, self._options.heartbeat)
        telemetry = {
            "sync_late_ms_max": round(end.get("late", 0.0) * 1e3, 3),
            "bus_load": round(load, 4),
            "emergencies": [f"{code:04X}h" for code in end["emcy"]],
        }
        return ending_of(end, telemetry)

    def _in_fault(self, client: Client) -> Ending | None:
        """Ending of a trial if the drive is in fault; a fault by a lost heartbeat is cleared."""
        if state_of(client.read(od.STATUSWORD)) is not State.FAULT:
            return None
        code = present(client, od.ERROR_CODE) or 0
        if code == HEARTBEAT_LOST and client.ask("reset") != State.FAULT.text:
            return None
        why = "before the trial; see backend.clear_fault"
        return ending_of({"end": End.STATE, "why": why, "emcy": [code], "safe": True}, {})

    def _scale_for(self, client: Client, trial: Trial) -> Scale:
        gear = trial.bench.get("gear")
        ratio = float(gear["ratio"]) if isinstance(gear, Mapping) else 1.0  # type: ignore[arg-type]
        given = self._options.model_dump(
            include={"reverse", "units_per_turn", "rate_units", "rated_torque", "rated_current"}
        )
        return scale_of(lambda item: present(client, item), ratio=ratio, **given)

    def _prove(self, client: Client, trial: Trial, proof: Proof) -> None:
        """Prove the drive once per connection and scale, before the motion. Raises DriveError."""
        ramp = max(1, round(proof.limits.acceleration * abs(proof.scale.rate)))
        for item in (od.ACCELERATION, od.DECELERATION):
            written(client, item, ramp)
        if ("moves", proof.scale) not in self._proved:
            proof.moves_as_commanded()
            proof.stops_in_silence(self._options.heartbeat)
            self._in_fault(client)  # clears the fault that the proof caused
            self._proved.add(("moves", proof.scale))
        if trial.task.mode == "torque" and ("speed limit", proof.scale) not in self._proved:
            peak = float(np.max(np.abs(targets_of(trial.task).values)))
            proof.keeps_speed_limit(min(peak, proof.limits.torque))
            self._proved.add(("speed limit", proof.scale))

    # Rest

    def make_safe(self) -> SafeState:
        """Bring the drive to rest and switch it off; connect again if necessary."""
        self._urgent.set()  # ends a trial in another thread, also between two motions
        deadline = time.monotonic() + self._options.safe_time
        seen = self._seen_safe(deadline)
        while not seen and time.monotonic() < deadline:
            self._disconnect()
            time.sleep(RETRY)
            seen = self._seen_safe(deadline)
        return safe_state(seen=seen)

    def _seen_safe(self, deadline: float) -> bool:
        try:
            client = self._client or self._opened()
            patience = max(0.5, deadline - time.monotonic())
            return bool(client.ask("rest", patience + 1, patience=patience))
        except (DriveError, UsageError):
            return False

    # The bus

    def _opened(self) -> Client:
        if not self._options.port:
            raise UsageError(
                "the backend 'canopen' needs a drive: --port can://socketcan/can0?node=5"
            )
        client, options = Client(self._options.port, self._start), self._options
        client.ask("hello", heartbeat=options.heartbeat, silence=options.silence, who=self._host)
        self._client = client
        return client

    def _connect(self) -> Client:
        """Open the bus, check the drive, set its reactions. Raises DriveError, UsageError."""
        client, options = self._client or self._opened(), self._options
        address = address_of(options.port)
        self._proved.clear()
        self._found = (-1, -1)
        if options.eds:
            compare_eds(client, options.eds)
        if state_of(client.read(od.STATUSWORD)) is State.ENABLED:
            raise DriveError("it is enabled: another program moves it")
        if options.clear_fault:
            client.ask("reset")
        set_pdos(client, address.node)
        set_reactions(client, address.host, options.heartbeat)
        self._found = client.ask("boots"), client.read(od.CONSUMER)
        return client

    def _still_set(self) -> Client | None:
        """The connection, or None if the drive has restarted and lost its reactions."""
        client = self._client
        if client is not None and (client.ask("boots"), client.read(od.CONSUMER)) != self._found:
            self._disconnect()
        return self._client

    def _disconnect(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            client.close()


BACKEND = BackendKind(
    name="canopen",
    summary="a CiA 402 servo drive on a CAN bus (CANopen)",
    options=CanopenOptions,
    open=CanopenBackend,
    source=Source.HARDWARE,
    live=True,
    needs=("limits",),
    stopped_outside=True,
)
