"""However a run on hardware ends, the bench ends at rest with its drive off, and that is said."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.open_run import open_run
from campaign.execution.recorder import LATE
from campaign.link.port import open_port
from campaign.link.safe import SafeWatch, is_safe
from campaign.recording import Outcome
from campaign.wire.messages import Query, State, Status, framed
from tests.link.controllers import controller
from tests.system.user import Process, begun, campaign, program_of, write

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")

PROTOCOL = """\
title = "Short on hardware"

[[test]]
name = "sea"
kind = "stabilization"
bench = "platform"
seed = 7
cycles = 1
settle_cycles = 1

[test.matrix]
compensation = ["none", "lugre"]
"""
LONG = PROTOCOL.replace("cycles = 1\n", "cycles = 100\n", 1)
ON = ("--backend", "serial", "--set", "backend.motion=emulated")

PATIENT = ("--heartbeat-timeout", "20")
"""A controller that does not mind a busy machine, where heartbeats are late."""
SOON = ("--set", "backend.safe_time=2 s", "--set", "backend.silence=1 s")


def status_of(port: str) -> Status:
    """What the controller answers to a stranger's question."""
    line, watch = open_port(port, 2_000_000, exclusive=False), SafeWatch()
    try:
        while watch.last is None:
            line.write(framed(Query()))
            watch.feed(line.read())
        return watch.last
    finally:
        line.close()


@contextmanager
def running(folder: Path, port: str) -> Iterator[Process]:
    """`campaign run` while the axis moves."""
    write(folder, LONG)
    with begun(folder, "run", "protocol.toml", *ON, *SOON, "--port", port, "--yes") as process:
        try:
            deadline = time.monotonic() + 60
            while status_of(port).state is not State.RUNNING:
                assert process.poll() is None, process.stderr.read()
                assert time.monotonic() < deadline
                time.sleep(0.02)
            yield process
        finally:
            process.kill()


@pytest.mark.slow
def test_the_archive_of_a_rehearsal_is_that_of_the_simulation(tmp_path: Path) -> None:
    write(tmp_path, PROTOCOL)
    simulated = campaign(tmp_path, "run", "protocol.toml").last_line
    with controller("--speed", "max") as port:
        words = ("run", "protocol.toml", *ON, "--port", port, "--yes")
        # With a Python of its own for the guardian, and another one for the program.
        rehearsed = campaign(tmp_path, *words, start=True).last_line
    pairs = zip(
        open_run(tmp_path / simulated).trials, open_run(tmp_path / rehearsed).trials, strict=True
    )
    for true, mine in pairs:
        theirs, ours = true.recording(), mine.recording()
        assert mine.trial == true.trial
        assert ours.time.tobytes() == theirs.time.tobytes()
        prompt = tuple(event for event in ours.events if not event.text.startswith(LATE))
        assert prompt == theirs.events  # whatever else this machine had to do
        assert tuple(ours.channels) == tuple(theirs.channels)
        for name, channel in theirs.channels.items():
            got = ours.channels[name]
            assert got.samples.tobytes() == channel.samples.tobytes()
            assert (got.unit, got.display_unit, got.label, got.measured) == (
                channel.unit, channel.display_unit, channel.label, channel.measured,
            )  # fmt: skip
        assert ours.ending.outcome is Outcome.COMPLETED
        assert np.isfinite(float(str(ours.ending.telemetry["round_trip_ms_max"])))


def test_a_plan_is_refused_without_a_port(tmp_path: Path) -> None:
    write(tmp_path, PROTOCOL)
    refused = campaign(tmp_path, "plan", "protocol.toml", "--backend", "serial", code=2)
    assert "task.base_acceleration" in refused.err
    campaign(tmp_path, "plan", "protocol.toml", *ON)
    assert "--port" in campaign(tmp_path, "run", "protocol.toml", *ON, "--yes", code=2).err


@pytest.mark.slow
def test_ctrl_c_ends_in_the_safe_state(tmp_path: Path) -> None:
    with controller(*PATIENT) as port, running(tmp_path, port) as process:
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
        assert process.returncode == 130, err
        run = open_run(tmp_path / out.splitlines()[-1])
        assert run.safe_state.value == "confirmed"
        assert run.trials[0].recording().ending.outcome is Outcome.INTERRUPTED
        status = status_of(port)
        assert status.state is State.SAFE
        assert status.at_rest
        assert not status.drive_on


@pytest.mark.slow
def test_a_killed_host_leaves_a_safe_bench(tmp_path: Path) -> None:
    with controller(*PATIENT) as port, running(tmp_path, port) as process:
        os.kill(program_of(process), signal.SIGKILL)
        out, err = process.communicate(timeout=60)
        assert (process.returncode, out) == (5, ""), err
        assert "\nthe program died: signal 9\nSAFE STATE NOT CONFIRMED" in err
        assert err.endswith("\nsafe state confirmed\n"), "what `campaign stop` says"
        assert is_safe(status_of(port))
        (partial,) = (tmp_path / "results").glob("*.partial")
        refused = campaign(tmp_path, "resume", partial.stem, "--yes", code=3)
        assert "--clear-stop 1" in refused.err


@pytest.mark.slow
def test_a_host_whose_guardian_is_killed_stops_in_order(tmp_path: Path) -> None:
    with controller(*PATIENT) as port, running(tmp_path, port) as process:
        process.kill()
        out, err = process.communicate(timeout=60)  # the program has the pipes still
        run = open_run(tmp_path / out.splitlines()[-1])
        assert run.reason == "stopped by the death of its guardian process", err
        assert run.safe_state.value == "confirmed"
        assert is_safe(status_of(port))


@pytest.mark.slow
def test_the_panic_stop_works_while_the_host_hangs(tmp_path: Path) -> None:
    with controller(*PATIENT) as port, running(tmp_path, port) as process:
        program = program_of(process)
        os.kill(program, signal.SIGSTOP)
        assert campaign(tmp_path, "stop", "--port", port).out == "safe state confirmed\n"
        # In state FAULT on a machine so busy that heartbeats were late, which is as safe.
        assert is_safe(status_of(port))
        os.kill(program, signal.SIGCONT)
        out, err = process.communicate(timeout=60)
        assert process.returncode == 130, err  # somebody stood there
        run = open_run(tmp_path / out.splitlines()[-1])
        assert run.status is RunStatus.INTERRUPTED
        assert run.reason.startswith("panic stop by ")
        assert run.trials[0].recording().ending.outcome is not Outcome.COMPLETED


def test_a_pulled_plug_is_not_confirmed_until_the_line_is_back(tmp_path: Path) -> None:
    """The controller comes back within the patience of the host, and is then seen safe."""
    write(tmp_path, PROTOCOL)
    with controller("--speed", "max", "--fault", "unplug=0.5@trial=1") as port:
        done = campaign(tmp_path, "run", "protocol.toml", *ON, "--port", port, "--yes", code=3)
    first, second = open_run(tmp_path / done.last_line).trials
    assert first.recording().ending.safe_state.value == "not confirmed"
    assert first.recording().ending.fault == "lost-connection"
    assert second.recording().ending.outcome is Outcome.COMPLETED


@pytest.mark.slow
def test_a_controller_that_has_gone_is_said_with_its_own_exit_code(tmp_path: Path) -> None:
    with controller() as port:
        starting = running(tmp_path, port)
        process = starting.__enter__()
    out, err = process.communicate(timeout=90)
    starting.__exit__(None, None, None)
    assert process.returncode == 5, err
    assert "NOT CONFIRMED" in err
    assert open_run(tmp_path / out.splitlines()[-1]).safe_state.value == "not confirmed"
    done = campaign(tmp_path, "stop", "--port", port, code=5)
    assert done.out == "SAFE STATE NOT CONFIRMED\n"
