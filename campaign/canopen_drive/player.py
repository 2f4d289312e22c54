"""Trials as the relay plays them: jobs, samples in SI, endings."""

from __future__ import annotations

import contextlib
import queue
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from campaign.canopen_drive.client import GONE, Client
from campaign.canopen_drive.drive import DriveError
from campaign.canopen_drive.ends import FAULTS as END_FAULTS
from campaign.canopen_drive.ends import LIMITS, STOPPED, End
from campaign.canopen_drive.units import Scale
from campaign.channels import info
from campaign.recording import Array, ChannelInfo, Ending, Fault, Outcome, Recorder, SafeState

BLOCK = 0.1
"""s of samples that are handed over at a time."""
KEEP_ALIVE = 0.05
"""s between two signs of life to the relay."""
ENDING = 20.0
"""s without a word from the relay, which brings the drive to rest meanwhile."""
HEARTBEAT_LOST = 0x8130
"""Error code: life guard or heartbeat error (CiA 301)."""
ERRORS = {0x4: Fault.OVER_TEMPERATURE, 0x73: Fault.SENSOR, 0x8130: Fault.HEARTBEAT}
"""Of error codes of CiA 301 and CiA 402, by their first digits."""


class EndedError(Exception):
    """A motion ended before it was over."""

    def __init__(self, end: Mapping[str, Any]) -> None:
        super().__init__(end["why"] or end["end"])
        self.end = end


def channels(mode: str) -> tuple[ChannelInfo, ...]:
    """What a drive records. On a hull at rest the rate in space is the relative one."""
    gyro = replace(info("gyro_rate"), label="Rate of the load (drive; hull at rest)")
    names = ("relative_rate", "relative_angle", "motor_current", "drive_torque")
    return (info("command", mode), gyro, *map(info, names))


class Player:
    """Plays one job after another.

    Args:
        base: what all jobs have: bounds, patience, whether SYNC is counted.
        stop: whether to end early.
    """

    def __init__(self, client: Client, base: Mapping[str, Any], stop: Callable[[], bool]) -> None:
        self._client, self._base, self._stop = client, base, stop
        self._halted = False

    def rows(
        self, job: Mapping[str, Any], expected: End = End.PLAYED
    ) -> tuple[Array, Mapping[str, Any]]:
        """Samples (n, 6) in numbers of the drive, and how it ended.

        Raises EndedError unless it was played to its end, or ended as `expected`.
        """
        rows, end = [], None
        for item in self._items(job):
            if "sample" in item:
                rows.append(item["sample"][1:])
            end = item.get("is", end)
        if end is None:
            raise DriveError(GONE, silent=True)
        if end["end"] not in (End.PLAYED, expected):
            raise EndedError(end)
        return np.array(rows, dtype=float).reshape(-1, 6), end

    def record(
        self, job: Mapping[str, Any], recorder: Recorder, command: Array, scale: Scale
    ) -> Mapping[str, Any]:
        """How it ended. `command`: shape (n,), rad/s or N m, of each SYNC."""
        period = job["period"]
        rows: list[list[int]] = []
        end: Mapping[str, Any] | None = None

        def flush() -> None:
            if rows:
                first, raw = rows[0][0], np.array(rows, dtype=float).T
                time = (first + np.arange(len(rows))) * period
                rate = raw[2] / scale.rate
                recorder.append(time, np.vstack((
                    command[first : first + len(rows)], rate, rate, raw[4] / scale.position,
                    raw[5] / scale.current, raw[3] / scale.torque,
                )))  # fmt: skip
                rows.clear()

        for item in self._items(job):
            if "sample" in item:
                rows.append(item["sample"])
            # What comes after a stop is handed over at once, at the end.
            if (len(rows) * period >= BLOCK and not self._halted) or "sample" not in item:
                flush()
            if "lost" in item:
                recorder.lost(np.array([item["lost"] * period]))
            end = item.get("is", end)
        if end is None:
            raise DriveError(GONE, silent=True)
        return end

    def _items(self, job: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
        """What the relay says, until it has said how the job ended.

        Signs of life are sent from here alone: who hangs with a sample in hand sends none.
        """
        client, alive = self._client, 0.0
        self._halted = False
        client.play({**self._base, **job})
        heard = time.monotonic()
        while True:
            now = time.monotonic()
            if now - alive > KEEP_ALIVE:
                client.tell("alive")
                alive = now
            if not self._halted and self._stop():
                client.tell("halt")
                self._halted = True
            item: dict[str, Any] | None = {}
            with contextlib.suppress(queue.Empty):
                item = client.played.get(timeout=KEEP_ALIVE)
                heard = now
            if item is None or now - heard > ENDING:
                raise DriveError(GONE, silent=True)
            if "error" in item:
                raise DriveError(item["error"], silent=bool(item.get("silent")))
            if item:
                yield item
            if "is" in item:
                return


def ending_of(end: Mapping[str, Any], telemetry: Mapping[str, Any]) -> Ending:
    """The ending of a trial, from what the relay says of it."""
    how, why = End(end["end"]), str(end["why"])
    safe = SafeState.CONFIRMED if end["safe"] else SafeState.NOT_CONFIRMED
    codes = [code for code, _ in end["emcy"]]
    if not codes and end.get("error") and how is End.STATE:
        codes = [end["error"]]
    outcome, fault = Outcome.FAULT, None
    if codes and how not in STOPPED:
        fault, shown = fault_of(codes[0]), ", ".join(f"{code:04X}h" for code in codes)
        why = f"the drive reports error {shown}; its manual says what it is ({why or how})"
    elif how is End.PLAYED:
        outcome = Outcome.COMPLETED
    elif how in (End.STOPPED, End.PANIC_STOP):
        outcome, why = Outcome.INTERRUPTED, why or "stopped by the operator"
    elif how in LIMITS:
        outcome, why = Outcome.LIMIT, f"{how}: {why} (in numbers of the drive)"
    elif how is End.LOST and not end["safe"]:
        fault, why = Fault.LOST_CONNECTION, f"the drive does not answer any more ({why})"
    else:
        fault = END_FAULTS[how]
        if fault is Fault.HEARTBEAT:
            why = "this program gave no sign of life; the drive was stopped"
    return Ending(outcome, why, safe, fault, dict(telemetry))


def fault_of(code: int) -> Fault:
    """The fault that an error code of a drive tells of."""
    for digits in (0, 8, 12):
        if (found := ERRORS.get(code >> digits)) is not None:
            return found
    return Fault.DRIVE
