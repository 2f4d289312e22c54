"""Execution of trials by the relay: jobs, samples in SI, endings."""

from __future__ import annotations

import queue
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from campaign.canopen_drive.client import GONE, Answers, Client, checked
from campaign.canopen_drive.drive import DriveError
from campaign.canopen_drive.ends import RESULTS, STOPPED, End
from campaign.canopen_drive.units import Scale
from campaign.channels import info
from campaign.recording import Array, ChannelInfo, Ending, Fault, Outcome, Recorder, SafeState

BLOCK = 0.1
"""s of samples per delivered block."""
KEEP_ALIVE = 0.05
"""s between two signs of life to the relay."""
ENDING = 20.0
"""s; time limit for an answer of the relay, which may be bringing the drive to rest."""
HEARTBEAT_LOST = 0x8130
"""Error code: life guard or heartbeat error (CiA 301)."""
ERRORS = {0x4: Fault.OVER_TEMPERATURE, 0x73: Fault.SENSOR, 0x8130: Fault.HEARTBEAT}
"""Faults by the first digits of error codes of CiA 301 and CiA 402."""


class EndedError(Exception):
    """A motion ended early."""

    def __init__(self, end: Mapping[str, Any]) -> None:
        super().__init__(end["why"] or end["end"])
        self.end = end


def channels(mode: str) -> tuple[ChannelInfo, ...]:
    """Channels of a drive. With the hull at rest the rate in space equals the relative rate."""
    gyro = replace(info("gyro_rate"), label="Rate of the load (drive; hull at rest)")
    names = ("relative_rate", "relative_angle", "motor_current", "drive_torque")
    return (info("command", mode), gyro, *map(info, names))


class Player:
    """Plays one job after another.

    Args:
        base: common fields of all jobs: bounds, patience, whether SYNC is counted.
        stop: whether to end early.
    """

    def __init__(self, client: Client, base: Mapping[str, Any], stop: Callable[[], bool]) -> None:
        self._client, self._base, self._stop = client, base, stop
        self._halted = False

    def rows(
        self, job: Mapping[str, Any], expected: End = End.PLAYED
    ) -> tuple[Array, Mapping[str, Any]]:
        """Play a job; samples (n, 6) in numbers of the drive, and its end.

        Raises EndedError unless it was played completely, or ended as `expected`.
        """
        rows = []
        for item in self._items(job):
            if "sample" in item:
                rows.append(item["sample"][1:])
        end = item["is"]
        if end["end"] not in (End.PLAYED, expected):
            raise EndedError(end)
        return np.array(rows, dtype=float).reshape(-1, 6), end

    def record(
        self, job: Mapping[str, Any], recorder: Recorder, command: Array, scale: Scale
    ) -> Mapping[str, Any]:
        """Play and record a job; its end. `command`: shape (n,), rad/s or N m, at each SYNC."""
        period = job["period"]
        rows: list[list[int]] = []

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
            # Samples after a stop are delivered in one block at the end.
            if (len(rows) * period >= BLOCK and not self._halted) or "sample" not in item:
                flush()
            if "lost" in item:
                recorder.lost(np.array([item["lost"] * period]))
        end: Mapping[str, Any] = item["is"]
        return end

    def _items(self, job: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
        """Messages of the relay; the last contains the job's end as `is`. Raises DriveError.

        Only this loop sends signs of life: none are sent while the recording of a sample hangs.
        """
        client, answers, alive = self._client, Answers(), 0.0
        self._halted = False
        client.tell("play", answers, **{**self._base, **job})
        heard = time.monotonic()
        while True:
            now = time.monotonic()
            if now - alive > KEEP_ALIVE:
                client.tell("alive")
                alive = now
            if not self._halted and self._stop():
                client.tell("halt")
                self._halted = True
            try:
                item = checked(answers.get(timeout=KEEP_ALIVE))
            except queue.Empty:
                if now - heard > ENDING:
                    raise DriveError(GONE, silent=True) from None
                continue
            heard = now
            yield item
            if "is" in item:
                return


def ending_of(end: Mapping[str, Any], telemetry: Mapping[str, Any]) -> Ending:
    """Ending of a trial from the job's end."""
    how, why = End(end["end"]), str(end["why"])
    codes = end["emcy"] or ([end["error"]] if how is End.STATE and end["error"] else [])
    outcome, fault = RESULTS[how]
    if codes and how not in STOPPED:
        outcome, fault = Outcome.FAULT, fault_of(codes[0])
        shown = ", ".join(f"{code:04X}h" for code in codes)
        why = f"the drive reports error {shown}; its manual says what it is ({why or how})"
    elif outcome is Outcome.INTERRUPTED:
        why = why or "stopped by the operator"
    elif outcome is Outcome.LIMIT:
        why = f"{how}: {why} (in numbers of the drive)"
    elif how is End.LOST and not end["safe"]:
        fault, why = Fault.LOST_CONNECTION, f"the drive does not answer any more ({why})"
    elif fault is Fault.HEARTBEAT:
        why = "this program gave no sign of life; the drive was stopped"
    return Ending(outcome, why, safe_state(seen=end["safe"]), fault, dict(telemetry))


def safe_state(*, seen: bool) -> SafeState:
    """Safe state of a drive; `seen`: whether it was observed at rest and off."""
    return SafeState.CONFIRMED if seen else SafeState.NOT_CONFIRMED


def fault_of(code: int) -> Fault:
    """Fault for an error code of a drive."""
    faults = (ERRORS[code >> digits] for digits in (0, 8, 12) if code >> digits in ERRORS)
    return next(faults, Fault.DRIVE)
