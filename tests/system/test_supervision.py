"""A plug-in that records what it likes, hangs, or falls silent, from the command line."""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_reader import RunReader
from campaign.recording import Fault, Outcome, SafeState
from campaign.wire.messages import State
from tests.link.controllers import controller
from tests.packages import Packages
from tests.system.test_safety import status_of
from tests.system.user import begun, program_of, write

WILD = """
import threading, time
import numpy as np
from campaign.backends.interface import BackendKind, Source
from campaign.options import Options
from campaign.trial import ChannelInfo, Ending, Outcome, SafeState

CHANNELS = (
    ChannelInfo("relative_rate", "rad/s", "Rate", "deg/s"),
    ChannelInfo("motor_current", "A", "Current", "A"),
    ChannelInfo("drive_torque", "N m", "Torque", "N m"),
)

class WildOptions(Options):
    how: str = "wild"
    \"\"\"What it does.\"\"\"

class Wild:
    def __init__(self, options):
        self.how = options.how
    def __enter__(self):
        return self
    def __exit__(self, *exception):
        return None
    def refuses(self, trial):
        return None
    def channels(self, trial):
        return frozenset(c.name for c in CHANNELS)
    def execute(self, trial, recorder, stop):
        recorder.start(CHANNELS)
        count = int(trial.task.duration * trial.task.sample_rate)
        values = np.array([[100.0], [5000.0], [1e6]]) * (self.how == "wild")
        for first in range(0, count, 20):
            n = np.arange(first, min(first + 20, count))
            recorder.append(n / trial.task.sample_rate, values * np.ones(len(n)))
            if self.how == "stuck":
                threading.Event().wait()
        return Ending(Outcome.COMPLETED)
    def make_safe(self):
        return SafeState.CONFIRMED

BACKEND = BackendKind("wild", "a wild one", WildOptions, Wild, Source.HARDWARE, live=True)
"""

MOVE = """\
[[test]]
name = "home"
kind = "move"
bench = "simulink"
angle = "10 deg"
seed = 1
"""


def run_wild(folder: Path, how: str) -> tuple[int, str, RunReader]:
    packages = Packages(folder / "packages")
    packages.install("wild", {"wild.py": WILD}, {"campaign.backends/wild": "wild:BACKEND"})
    write(folder, MOVE)
    settings = ("--backend", "wild", "--set", f"backend.how={how}", "--yes")
    done = packages.campaign("run", "protocol.toml", *settings)
    assert done.stdout, done.stderr
    return done.returncode, done.stderr, open_run(folder / done.stdout.splitlines()[-1])


@pytest.mark.slow
def test_what_a_plug_in_records_beyond_every_limit_is_no_completed_trial(tmp_path: Path) -> None:
    """It did end `complete`, exit code 0."""
    code, said, run = run_wild(tmp_path, "wild")
    assert code == 3, said
    [trial] = run.trials
    assert trial.ending.outcome is Outcome.LIMIT
    assert trial.ending.safe_state is SafeState.CONFIRMED
    assert "relative_rate reached" in trial.ending.reason
    assert "(the backend: completed)" in trial.ending.reason
    assert len(trial.recording().time) == 1
    assert "home: no channel shows these limits: angle" in said
    assert trial.ending.telemetry["unwatched_limits"] == ["angle"]


@pytest.mark.slow
def test_a_plug_in_that_never_returns_leaves_a_sealed_run(tmp_path: Path) -> None:
    began = time.monotonic()
    code, said, run = run_wild(tmp_path, "stuck")
    assert time.monotonic() - began > 10  # 5 s of silence, 5 s to come back
    assert code == 3, said
    assert run.status == "fault"
    [trial] = run.trials
    assert trial.ending.fault is Fault.LOST_CONNECTION
    assert trial.ending.safe_state is SafeState.CONFIRMED
    assert "did not come back" in trial.ending.reason


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_a_host_that_sleeps_does_not_take_that_for_the_silence_of_the_bench(tmp_path: Path) -> None:
    """Longer than the silence that ends a trial; the controller keeps what it has measured."""
    write(tmp_path, MOVE)
    # Shorter than the sleep, and longer than a busy machine lets the relay wait for its turn.
    patient = ("--heartbeat-timeout", "4")
    options = ("--backend", "serial", "--yes", "--set", "home.angle=60 deg")
    with (
        controller(*patient, bench="simulink") as port,
        begun(tmp_path, "run", "protocol.toml", *options, "--port", port) as process,
    ):
        try:
            deadline = time.monotonic() + 60
            while status_of(port).state is not State.RUNNING:
                assert process.poll() is None, process.stderr.read()
                assert time.monotonic() < deadline
            time.sleep(1.0)
            program = program_of(process)
            os.kill(program, signal.SIGSTOP)
            time.sleep(5.5)
            os.kill(program, signal.SIGCONT)
            out, err = process.communicate(timeout=60)
        finally:
            process.kill()
    assert process.returncode == 0, err
    [trial] = open_run(tmp_path / out.splitlines()[-1]).trials
    recording = trial.recording()
    assert trial.ending.outcome is Outcome.COMPLETED
    assert float(str(trial.ending.telemetry["longest_gap_s"])) > 5
    assert np.isfinite(recording["gyro_rate"]).all()
