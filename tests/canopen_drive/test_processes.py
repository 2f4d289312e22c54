"""A relay as a process, over slcan: what of the host is killed or hangs, and what the bus loses."""

from __future__ import annotations

import json
import os
import random
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from campaign.backends.canopen import CanopenBackend, CanopenOptions
from campaign.recording import Fault, MemoryRecorder, Outcome, SafeState
from tests.canopen_drive import host as hosts
from tests.canopen_drive.hub import Hub, cut, unharmed
from tests.canopen_drive.rig import PATIENT, channel, execute, start_thread, trial
from tests.canopen_drive.simulated import SimulatedDrive
from tests.canopen_drive.test_backend import stays_off
from tests.forks import Begun
from tests.system.user import ROOT, environment, forks

posix = pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")


@contextmanager
def rig(speed: float = hosts.SPEED) -> Iterator[tuple[SimulatedDrive, Hub]]:
    name = channel()
    with SimulatedDrive(name, speed=speed) as drive, Hub(name) as hub:
        yield drive, hub


def begun(folder: Path, *arguments: str) -> Begun:
    """In a fork, with the variables of this test."""
    return Begun(forks(), folder, *arguments, environment=environment())


@contextmanager
def host(hub: Hub, drive: SimulatedDrive, **options: Any) -> Iterator[Begun]:
    """A program in the midst of its trial: faster than any motion that proves the drive."""
    settings = json.dumps({**PATIENT, "port": hub.port, **options})
    code = f"from tests.canopen_drive.host import main; main({settings!r})"
    with begun(ROOT, "-c", code) as process:
        try:
            drive.wait(lambda: process.poll() is not None or abs(drive.rate) > 0.65)
            assert process.poll() is None, process.communicate()
            yield process
        finally:
            process.kill()


def states(drive: SimulatedDrive, since: int) -> list[str]:
    return [event[1] for event in drive.log[since:] if event[0] == "state"]


def gone(hub: Hub, drive: SimulatedDrive) -> None:
    drive.wait(lambda: not hub.clients)


@posix
@pytest.mark.slow
def test_a_killed_host_leaves_the_drive_at_rest_and_the_bus_silent() -> None:
    with rig() as (drive, hub), host(hub, drive) as process:
        since = len(drive.log)
        # The quick stop by PDO is lost: the relay stays until the drive is at rest.
        hub.fate = lambda to_drive, cob, data: [] if cob == 0x205 else [0.0]
        process.kill()
        stays_off(drive, since)
        assert states(drive, since)[0] == "quick stop", "the relay stops it, before its heartbeat"
        gone(hub, drive)
        beats = hub.beats
        drive.wait(lambda: drive.state == "fault")  # nobody sends a heartbeat
        assert hub.beats == beats
        stays_off(drive, since)


@posix
@pytest.mark.slow
def test_a_host_that_hangs_is_silent_and_the_relay_stops_the_drive() -> None:
    with rig() as (drive, hub), host(hub, drive, silence=2.5) as process:
        since = len(drive.log)
        process.send_signal(signal.SIGSTOP)
        stays_off(drive, since)
        assert states(drive, since)[0] == "quick stop"
        drive.wait(lambda: drive.state == "fault")  # its heartbeat has ended
        assert hub.clients, "the relay is there, and silent"
        process.send_signal(signal.SIGCONT)
        out, _ = process.communicate(timeout=60)
        assert out.split() == ["heartbeat", "confirmed"]
        stays_off(drive, since)


@posix
@pytest.mark.slow
def test_a_killed_relay_is_followed_by_a_stop(state_folder: Path) -> None:
    with rig() as (drive, hub), host(hub, drive) as process:
        since = len(drive.log)
        (served,) = (state_folder / "campaign" / "canopen").glob("*.port.json")
        os.kill(json.loads(served.read_text())["pid"], signal.SIGKILL)
        out, _ = process.communicate(timeout=60)
        assert out.split() == ["lost-connection", "confirmed"]
        stays_off(drive, since)
        # By the drive itself, or by the next relay, which the host starts to make it safe.
        assert states(drive, since)[0] in ("fault reaction", "quick stop")


@pytest.mark.slow
def test_a_pulled_cable_is_the_drives_own_business() -> None:
    with rig() as (drive, hub), host(hub, drive, late=2.0, safe_time=1.0) as process:
        since = len(drive.log)
        hub.fate = cut
        stays_off(drive, since)
        assert states(drive, since)[0] == "fault reaction"
        out, _ = process.communicate(timeout=90)
        assert out.split() == ["lost-connection", "not", "confirmed"]
        hub.fate = lambda to_drive, cob, data: [0.0]
        stays_off(drive, since)


@contextmanager
def connected(hub: Hub, **options: Any) -> Iterator[CanopenBackend]:
    settings = {**PATIENT, "port": hub.port, **options}
    chosen = CanopenOptions.model_validate(settings, context={"si": True})
    with CanopenBackend(chosen, start_thread) as backend:
        first, _ = execute(backend, trial())
        assert first.outcome is Outcome.COMPLETED, first
        yield backend


@pytest.mark.slow
def test_delayed_frames_move_no_sample(fast: float) -> None:
    """Each SYNC waits for the answers to the last: the samples are those of a fast bus."""
    draw = random.Random(4)
    with rig(fast) as (drive, hub), connected(hub) as backend:
        drive.angle = drive.bristle = drive.rate = 0.0
        _, quick = execute(backend, trial())
        hub.fate = lambda to_drive, cob, data: [draw.choice((0.0, 0.0, 0.0, 0.012))]
        drive.angle = drive.bristle = drive.rate = 0.0
        ending, slow = execute(backend, trial())
        assert ending.outcome is Outcome.COMPLETED, ending
        for name in ("relative_rate", "drive_torque"):
            assert np.allclose(quick[name], slow[name], atol=0.02), name


CASES = (
    (0x80, 0, Outcome.FAULT),
    (0x80, 2, Outcome.COMPLETED),  # its count (1019h) shows the drive that it is the same
    (0x185, 0, Outcome.FAULT),
    (0x185, 2, Outcome.FAULT),
)


@pytest.mark.slow
def test_a_lost_or_doubled_frame_is_no_other_sample(fast: float) -> None:
    """SYNC, and an answer to it, once samples have come."""
    with rig(fast) as (drive, hub), connected(hub, late=2.0) as backend:
        for cob, copies, outcome in CASES:
            recorder, left = MemoryRecorder(), [1]
            hub.fate = partial(_harm, recorder, left, cob, copies)
            ending = backend.execute(trial(), recorder, lambda: False)
            since, recording = len(drive.log), recorder.recording(ending)
            hub.fate = unharmed
            assert not left[0]
            assert ending.outcome is outcome, ending
            assert ending.safe_state is SafeState.CONFIRMED
            if outcome is Outcome.FAULT:
                assert ending.fault is Fault.LOST_SAMPLES
                assert np.isnan(recording["relative_rate"][-1])
            else:
                assert len(recording.time) == 240
            stays_off(drive, since)


def _harm(
    recorder: MemoryRecorder, left: list[int], cob: int, copies: int,
    to_drive: bool, number: int, data: bytes,
) -> list[float]:  # fmt: skip
    if number == cob and recorder._blocks and left[0]:
        left[0] = 0
        return [0.0] * copies
    return [0.0]


PROTOCOL = """
title = "A drive on a desk"
[[test]]
name = "map"
kind = "velocity_map"
bench = "desk.toml"
speeds = ["30 deg/s", "40 deg/s"]
sample_rate = "100 Hz"
warm_up_cycles = 0
"""
DESK = """
name = "desk"
friction = {}
[axis]
name = "desk"
inertia = "0.1 kg m^2"
[limits]
angle = "57 deg"
rate = "57 deg/s"
acceleration = "280 deg/s^2"
torque = "6 N m"
current = "3 A"
duration = "100 s"
"""


@posix
@pytest.mark.slow
def test_campaign_run_is_stopped_by_campaign_stop(tmp_path: Path) -> None:
    (tmp_path / "desk.toml").write_text(DESK)
    (tmp_path / "map.toml").write_text(PROTOCOL)
    with rig(speed=1.0) as (drive, hub):
        settings = ("late=60 s", "silence=60 s", "heartbeat=2 s")
        given = [part for each in settings for part in ("--set", f"backend.{each}")]
        line = ["run", "map.toml", "--backend", "canopen", "--port", hub.port, "--yes", *given]
        run = begun(tmp_path, *line)
        drive.wait(lambda: run.poll() is not None or abs(drive.rate) > 0.515, 120.0)
        assert run.poll() is None, run.communicate()
        since = len(drive.log)
        stop = ("stop", "--port", hub.port, "--patience", "60")
        done = forks().run(tmp_path, *stop, environment=environment())
        assert (done.returncode, done.stdout.strip()) == (0, "safe state confirmed"), done
        out, err = run.communicate(timeout=120)
        assert run.returncode == 130, err
        assert "panic stop" in out + err
        stays_off(drive, since)
