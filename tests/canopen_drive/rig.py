"""Backends and trials for tests, with a relay as a thread of this process."""

from __future__ import annotations

import os
import threading
import time
import uuid
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, BinaryIO

from campaign.backends.canopen import CanopenBackend, CanopenOptions
from campaign.canopen_drive import drive, proof, relay
from campaign.canopen_drive.address import address_of
from campaign.canopen_drive.drive import Drive
from campaign.canopen_drive.relay import Relay
from campaign.recording import Ending, MemoryRecorder, Recording
from campaign.trial import Task, Trial

LIMITS = {
    "angle": 1.0, "rate": 1.0, "rate_time": 0.05, "acceleration": 5.0, "torque": 6.0,
    "current": 3.0, "duration": 100.0,
}  # fmt: skip
BENCH = {
    "name": "desk", "axis": {"name": "desk", "inertia": 0.1}, "friction": {}, "limits": LIMITS,
}  # fmt: skip
RAMP = {"shape": "polyline", "times": [0.2, 0.4, 1.2, 1.6, 2.0], "values": [0.0, 0.1, 0.1, -0.1, 0]}
PATIENT: dict[str, Any] = {"late": 60.0, "silence": 60.0, "heartbeat": 5.0}
"""No machine is too busy for these."""


def channel() -> str:
    return uuid.uuid4().hex


def start_thread(text: str) -> tuple[BinaryIO, BinaryIO, Any]:
    """A relay as a thread: virtual buses end at the process."""
    (inner_in, out), (into, inner_out) = os.pipe(), os.pipe()
    relay = Relay(Drive(address_of(text)), os.fdopen(inner_out, "wb"))

    def serve() -> None:
        with os.fdopen(inner_in, "rb") as commands:
            relay.serve(commands)
        relay._out.close()

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    return os.fdopen(out, "wb"), os.fdopen(into, "rb"), thread.join


class FastClock(SimpleNamespace):
    """`time` with faster seconds."""

    def __init__(self, speed: float) -> None:
        self.speed = speed

    def monotonic(self) -> float:
        return time.monotonic() * self.speed

    def sleep(self, seconds: float) -> None:
        time.sleep(seconds / self.speed)


def quicken(speed: float, patch: Callable[[Any, str, Any], object] = setattr) -> None:
    """Let the relay's clock run faster; a simulated drive with this `speed` counts as fast.

    What waits for the drive waits as long as before, and for its reaction to silence a minute: a
    busy machine is not as fast, nor is the clock of the drive on it.
    """
    clock, rest, late = FastClock(speed), Drive.bring_to_rest, CanopenBackend._late
    for module in (relay, drive):
        patch(module, "time", clock)
    patch(proof, "REACTION", speed * 60.0)
    patch(relay, "ENABLE", speed * relay.ENABLE)
    patch(Drive, "bring_to_rest", lambda self, patience: rest(self, speed * patience))
    patch(CanopenBackend, "_late", lambda self, period: speed * late(self, period))


def backend(name: str, **options: Any) -> CanopenBackend:
    settings = {**PATIENT, "port": f"can://virtual/{name}?node=5", **options}
    chosen = CanopenOptions.model_validate(settings, context={"si": True})
    return CanopenBackend(chosen, start_thread)


def trial(number: int = 1, bench: Any = None, **task: Any) -> Trial:
    given: dict[str, Any] = {
        "mode": "rate", "command": RAMP, "duration": 2.4, "window": (0.0, 2.4),
        "sample_rate": 100.0, **task,
    }  # fmt: skip
    return Trial(number=number, test="t", kind="move", seed=number, bench=bench or BENCH,
                 task=Task.model_validate(given))  # fmt: skip


def execute(backend: Any, what: Trial, stop: Any = lambda: False) -> tuple[Ending, Recording]:
    recorder = MemoryRecorder()
    ending = backend.execute(what, recorder, stop)
    return ending, recorder.recording(ending)
