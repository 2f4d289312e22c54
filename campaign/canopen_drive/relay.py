"""The process that owns the bus: `python -m campaign.canopen_drive.relay ADDRESS`.

Only this process commands the drive. Only `Relay._play` enables the drive, and it always ends by
bringing the drive to rest. Requests and answers are lines of JSON.

Threads of this process send heartbeat and SYNC, never an adapter or the kernel: these would
continue while this process hangs.
"""

from __future__ import annotations

import contextlib
import json
import os
import queue
import signal
import sys
import threading
import time
from collections.abc import Callable
from functools import partial
from typing import Any, BinaryIO

from campaign.canopen_drive import objects as od
from campaign.canopen_drive.address import address_of
from campaign.canopen_drive.drive import (
    INTERVAL,
    OPERATIONAL,
    PREOPERATIONAL,
    Drive,
    DriveError,
    RestWatch,
)
from campaign.canopen_drive.ends import End
from campaign.canopen_drive.line import Counter, Desk, Latch
from campaign.canopen_drive.objects import Item
from campaign.canopen_drive.state import (
    ENABLING,
    INTERNAL_LIMIT,
    QUICK_STOP,
    State,
    reset_words,
    state_of,
)
from campaign.errors import UsageError

BEATS = 4
"""Number of heartbeats, and of checks for a silent host, within their time limits."""
ENABLE = 3.0
"""s; time limit of a change of state or mode."""
REST = 8.0
"""s; time limit to come to rest after a trial."""
LAST_WORDS = 3.0
"""s; time limit to come to rest after the loss of the host."""
LEAD = 0.02
"""s from the last preparation to the first SYNC."""
Why = tuple[End, str]
"""End of a trial, and its explanation as text."""
PLAYED: Why = (End.PLAYED, "")


class Halt(Exception):  # noqa: N818 - no error: a requested stop
    """Stop of a trial: no more commands that enable the drive are permitted."""


class Relay:
    """Relay between one host and one drive."""

    def __init__(self, drive: Drive, out: BinaryIO) -> None:
        self.drive, self._out = drive, out
        self._unsent: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        self.latch = Latch(drive.address.file("latch"))
        self._commanding = threading.RLock()
        # If not None, no command may enable the drive; None during a trial.
        self._halted: Why | None = (End.STOPPED, "")
        self._armed = False
        self._cancelled = -1.0  # number of the last stop request; earlier trials do not begin
        self._alive = time.monotonic()
        self._beat = 0.0  # s between two heartbeats; 0: none
        self._silence = 1.0
        self._quiet = self._muted = self._closed = False
        self._who = ""
        self._jobs: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
        self.counter: Counter | None = None

    def serve(self, commands: BinaryIO) -> bool:
        """Serve until the host is gone; whether the drive was then observed at rest and off."""
        self.counter = Counter(self.drive.address, self._desk)
        for work in (self._heartbeats, self._work, self._send):
            threading.Thread(target=work, daemon=True).start()
        self._tell({"id": 0, "is": "open"})
        with contextlib.suppress(OSError, ValueError):
            for line in commands:
                self._alive = time.monotonic()
                self._take(json.loads(line))
        return self.leave()

    def leave(self) -> bool:
        """Make the drive safe after the loss of the host; only then end heartbeat and SYNC."""
        enabled = self._armed
        self._cancelled = float("inf")  # no waiting trial begins
        self.halt(End.HOST_GONE)
        used = enabled or self.drive.mapped
        safe = self.drive.bring_to_rest(LAST_WORDS) if used else True
        self._closed = True
        if self.counter is not None:
            self.counter.close()
        self.drive.close()
        return safe

    def halt(self, end: End, text: str = "") -> None:
        """Block commands that enable the drive; send a quick stop without waiting for an answer."""
        with self._commanding:
            self._halted = self._halted or (end, text)
            if self._armed:
                with contextlib.suppress(DriveError):
                    self.drive.command(QUICK_STOP)

    def _halt_if_latched(self) -> None:
        """Halt after `campaign stop`, also if another process stopped the drive."""
        if (latched := self.latch.now()) is not None:
            self._panic_stop(latched[1])

    def _desk(self) -> Desk:
        return Desk(self.drive, self.latch, lambda: self._armed, self._panic_stop, self._who)

    def _panic_stop(self, by: str) -> None:
        self.halt(End.PANIC_STOP, f"panic stop by {by}")

    # Requests

    def _take(self, job: dict[str, Any]) -> None:
        """Execute urgent requests; queue all others."""
        match job["do"]:
            case "alive":
                return
            case "halt" | "rest" as what:
                self._cancelled = job["id"]
                self.halt(End.STOPPED)
                rest = partial(self._do, job, lambda job: self.drive.bring_to_rest(job["patience"]))
                if what == "rest":
                    threading.Thread(target=rest, daemon=True).start()
            case "latch":
                self._do(job, lambda job: self.latch.now())
            case _:
                self._jobs.put(job)

    def _work(self) -> None:
        tasks: dict[str, Callable[[dict[str, Any]], Any]] = {
            "hello": self._hello,
            "read": lambda job: self.drive.read(Item(*job["item"])),
            "write": self._write,
            "boots": lambda job: self.drive.boots,
            "reset": self._reset,
            "jitter": self._jitter,
            "play": self._play,
            "clear": lambda job: self.latch.clear(job["count"]),
        }
        while True:
            job = self._jobs.get()
            self._do(job, tasks[job["do"]])

    def _do(self, job: dict[str, Any], task: Callable[[dict[str, Any]], Any]) -> None:
        try:
            self._tell({"id": job["id"], "is": task(job)})
        except DriveError as error:
            self._tell({"id": job["id"], "error": str(error), "silent": error.silent})
        except Exception as error:  # noqa: BLE001 - a bug is also reported to the host
            self._tell({"id": job["id"], "error": f"{type(error).__name__}: {error}"})

    def _tell(self, answer: dict[str, Any]) -> None:
        self._unsent.put(json.dumps(answer).encode() + b"\n")

    def _send(self) -> None:
        """Send answers in a separate thread: a blocked host must not delay a trial or its stop."""
        with contextlib.suppress(OSError, ValueError):
            while True:
                self._out.write(self._unsent.get())
                self._out.flush()

    def _hello(self, job: dict[str, Any]) -> None:
        self._beat = job["heartbeat"] / BEATS
        self._silence, self._who = job["silence"], job["who"]

    def _write(self, job: dict[str, Any]) -> None:
        item = Item(*job["item"])
        if item.index == od.CONTROLWORD.index:
            raise DriveError("the controlword is sent by the relay alone")
        self.drive.write(item, job["value"])

    def _reset(self, job: dict[str, Any]) -> str:
        """Clear a fault; returns the state afterwards."""
        for word in reset_words(self.drive.look()[0]):
            self.drive.write(od.CONTROLWORD, word)
        self.drive.emergencies.clear()
        state = self.drive.look()[0]
        return state.text if state is not None else "unknown"

    def _jitter(self, job: dict[str, Any]) -> float:
        """Largest delay (s) of `count` SYNC; the drive is pre-operational and does not answer."""
        self.drive.nmt(PREOPERATIONAL)
        worst, start = 0.0, time.monotonic() + LEAD
        for number in range(job["count"]):
            due = start + number * job["period"]
            time.sleep(max(0.0, due - time.monotonic()))
            self.drive.sync(1 if job["counted"] else None)
            worst = max(worst, time.monotonic() - due)
        return worst

    # Heartbeat

    def _heartbeats(self) -> None:
        host, due = self.drive.address.host, 0.0
        while not self._closed:
            now = time.monotonic()
            if self._armed and now - self._alive > self._silence:
                self.halt(End.HOST_SILENT)
            if self._beat and now >= due and not self._quiet and not self._muted:
                due = now + self._beat
                with contextlib.suppress(DriveError):
                    self.drive.send(0x700 + host, b"\x05")
            time.sleep(min(self._beat or LEAD, self._silence / BEATS))

    # A trial

    def _play(self, job: dict[str, Any]) -> dict[str, Any]:
        """Enable the drive, play the targets, bring it to rest; returns the end."""
        drive, fault = self.drive, 0
        why: Why = (End.DRIVE, "a bug of the relay")
        with self._commanding:
            self._halted = (End.STOPPED, "") if job["id"] <= self._cancelled else None
            self._halt_if_latched()
            if self._halted:
                end, text = self._halted
                return {"end": end, "why": text, "safe": False, "error": 0, "emcy": []}
            self._armed, self._quiet = True, False
            self._alive = time.monotonic()
            drive.mapped = True
        drive.emergencies.clear()
        boots, seen = drive.boots, {"state": "", "reacted": False, "samples": 0, "late": 0.0}
        try:
            self._enable(job)
            why = self._run(job, seen)
        except Halt:
            why = self._halted or why
        except DriveError as error:
            why = self._halted or (End.SILENT if error.silent else End.DRIVE, str(error))
        finally:
            self.halt(*why)
            self._muted = False
            silent = (self._halted or why)[0] is End.HOST_SILENT
            safe = drive.bring_to_rest(LAST_WORDS if silent else REST)
            self._quiet = silent  # at rest: no more heartbeats
            self._armed = False
        with contextlib.suppress(DriveError):
            fault = drive.read(od.ERROR_CODE)
        if drive.boots != boots:
            why = (End.RESET, "the drive has started anew")
        status = {"safe": safe, "error": fault, "emcy": drive.emergencies[:]}
        return {"end": why[0], "why": why[1], **status, **seen}

    def _enable(self, job: dict[str, Any]) -> None:
        drive = self.drive
        drive.nmt(OPERATIONAL)
        drive.write(od.TARGETS[job["mode"]][0], 0)
        drive.write(od.MODE, job["mode"])
        self._until(lambda: drive.read(od.MODE_DISPLAY) == job["mode"], f"mode {job['mode']}")
        remaining = list(ENABLING)
        while (state := state_of(drive.read(od.STATUSWORD))) is not State.ENABLED:
            if (
                state not in remaining
            ):  # also for a return to an earlier state: another device stops it
                raise DriveError(f"the state is {state.text if state else 'unknown'}")
            remaining = remaining[remaining.index(state) + 1 :]
            with self._commanding:
                self._halt_if_latched()
                if self._halted:
                    raise Halt
                drive.command(ENABLING[state])
            word, last = od.STATUSWORD, state
            self._until(lambda: state_of(drive.read(word)) is not last, "state")  # noqa: B023

    def _until(self, condition: Callable[[], bool], what: str) -> None:
        deadline = time.monotonic() + ENABLE
        while not condition():
            if self._halted:
                raise Halt
            if time.monotonic() > deadline:
                raise DriveError(f"no other {what} within {ENABLE:g} s")
            time.sleep(0.002)

    def _run(self, job: dict[str, Any], seen: dict[str, Any]) -> Why:
        drive, period, patience = self.drive, job["period"], job["patience"]
        target, cob = od.TARGETS[job["mode"]]
        start = time.monotonic() + LEAD
        for number, value in enumerate(job["targets"]):
            due = start + number * period
            time.sleep(max(0.0, due - time.monotonic()))
            with self._commanding:
                if self._halted:
                    raise Halt
                drive.send(cob + drive.address.node, target.pack(value))
                single = drive.sync(number % od.COUNTED + 1 if job["counted"] else None)
            late = time.monotonic() - due
            seen["late"] = max(seen["late"], late)
            while (sample := drive.sample(INTERVAL)) is None:
                if time.monotonic() > due + period + patience or self._halted:
                    break
            if self._halted:
                raise Halt
            if sample is None or not single:
                self._tell({"id": job["id"], "lost": number})
                return End.LOST, "an answer to SYNC is " + ("missing" if single else "doubled")
            seen["samples"] += 1
            self._tell({"id": job["id"], "sample": [number, *sample]})
            if late > patience:
                return End.LATE, f"SYNC {number} was {late * 1e3:.1f} ms late"
            if why := self._judged(sample, job, seen):
                return why
            if job.get("mute") == number:
                seen["reacted"] = self._muted_until_rest(job["mute_patience"])
                break
        return PLAYED

    def _judged(
        self, sample: tuple[int, ...], job: dict[str, Any], seen: dict[str, Any]
    ) -> Why | None:
        """End of the trial by this sample; None if it continues."""
        status, velocity, torque, position, _, mode = sample
        state = state_of(status)
        seen["state"] = state.text if state is not None else f"{status:04X}h"
        if state is not State.ENABLED:
            return End.STATE, f"the drive left operation enabled: {seen['state']}"
        if self.drive.emergencies:
            return End.STATE, "emergency message"
        if mode != job["mode"]:
            return End.STATE, f"the drive changed its mode to {mode}"
        for end, name, value, most in (
            (End.POSITION_LIMIT, "position", position, job["farthest"]),
            (End.RATE_LIMIT, "velocity", velocity, job["fastest"]),
            (End.TORQUE_LIMIT, "torque", torque, job["strongest"]),
        ):
            if abs(value) > most:
                return end, f"{name} {value} is outside {-most:.0f} to {most:.0f}"
        if status & INTERNAL_LIMIT and job["mode"] == od.PROFILE_VELOCITY:
            return End.DRIVE_LIMIT, "the drive reports that an internal limit acts"
        return PLAYED if abs(velocity) >= job.get("stop", 2**31) else None

    def _muted_until_rest(self, patience: float) -> bool:
        """Wait without heartbeat, SYNC and commands; whether the drive stopped by itself."""
        self._muted = True
        watch, deadline = RestWatch(self.drive.address.rest), time.monotonic() + patience
        while time.monotonic() < deadline and not self._halted:
            with contextlib.suppress(DriveError):
                state, position = self.drive.look()
                at_rest = watch.seen(position)
                stopped = state is not None and (state.off or state is State.QUICK_STOP)
                if stopped and at_rest:
                    return True
        return False


def main(text: str) -> int:
    """Serve one host until its end; 0 if the drive was then observed safe, else 5 (2: no bus)."""
    # The host handles Ctrl-C and a closed terminal: it needs the relay for an orderly stop.
    for stop in ("SIGINT", "SIGHUP"):
        if hasattr(signal, stop):
            signal.signal(getattr(signal, stop), signal.SIG_IGN)
    try:
        address = address_of(text)
        if address.served_at() is not None:
            raise UsageError(f"port {text!r}: another process of this computer has the drive")
        drive = Drive(address)
    except UsageError as error:
        sys.stdout.buffer.write(json.dumps({"id": 0, "error": str(error)}).encode() + b"\n")
        sys.stdout.flush()
        return 2
    relay = Relay(drive, sys.stdout.buffer)
    signal.signal(signal.SIGTERM, lambda *_: os._exit(0 if relay.leave() else 5))
    return 0 if relay.serve(sys.stdin.buffer) else 5


if __name__ == "__main__":
    # Not sys.exit: a thread that waits for a bus or a pipe must not prevent the exit.
    os._exit(main(sys.argv[1]))
