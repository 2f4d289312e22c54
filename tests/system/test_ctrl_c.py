"""Ctrl-C once and twice, at any instant: no traceback, no lost request, and the last line says what
was kept."""

from __future__ import annotations

import os
import random
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.forks import Begun
from tests.system.user import ROOT, SEA, Process, campaign, environment, forks, write

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")

LONG = SEA.replace("cycles = 1\n", "cycles = 2\nrepeat = 1000\n", 1)
ENDED = r"interrupted \(stopped by Ctrl-C\): .*|campaign: interrupted"
"""What the last line says when the program ended in order."""
LEFT = rf"{ENDED}|stopped at once; .*"


MAIN = """
import os
from campaign import __main__, interrupts
interrupts.listen()
os.write(1, b"listening\\n")
__main__.main()
"""
"""As `python -m campaign`. What a signal does to an interpreter that starts is not ours to say."""


def started(folder: Path, main: str = MAIN) -> subprocess.Popen[str]:
    """A run that listens to signals, also while it is imported."""
    process = subprocess.Popen(
        [sys.executable, "-c", main, "run", "protocol.toml"],
        cwd=folder,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        stdin=subprocess.DEVNULL,
        text=True,
    )
    assert process.stdout.readline() == "listening\n"
    return process


def interrupt(process: Process) -> None:
    if process.poll() is None:
        process.send_signal(signal.SIGINT)


def last_words(err: str) -> str:
    """The last line that is no command to go on with."""
    lines = (line for line in err.splitlines() if line and not line.startswith("  campaign "))
    return next(reversed(list(lines)), "")


def check(folder: Path, seed: int, times: int) -> float:
    """Interrupt a run `times` times at instants drawn from `seed`; s until it had ended."""
    chance = random.Random(seed)
    write(folder, LONG)
    process = started(folder)
    time.sleep(chance.uniform(0.0, 4.0))
    interrupt(process)
    if times == 2:
        time.sleep(chance.choice((0.0, 0.001, 0.02, 0.1, 0.5)))
        interrupt(process)
    began = time.monotonic()
    out, err = process.communicate(timeout=120)
    took = time.monotonic() - began
    said = last_words(err)
    told = f"seed {seed}: exit code {process.returncode}\n{out}\n{err}"
    assert process.returncode == 130, told
    assert "Traceback" not in err, told
    assert "ignored" not in err, told
    assert re.fullmatch(LEFT if times == 2 else ENDED, said), told
    partial = list((folder / "results").glob("*.partial"))
    assert times == 2 or not partial, told
    if partial:
        assert str(Path("results") / partial[0].name) in said, told
        campaign(folder, "show", partial[0].stem)
    return took


@pytest.mark.slow
@pytest.mark.parametrize("times", [1, 2])
@pytest.mark.parametrize("seed", range(4))
def test_at_some_instants(tmp_path: Path, seed: int, times: int) -> None:
    check(tmp_path, seed, times)


SLOW_TO_BEGIN = """
import os, signal, time
from campaign import __main__, interrupts
from campaign.archive.writing.writer import RunWriter
create = RunWriter.create.__func__
def interrupted(cls, *arguments):
    create(cls, *arguments)
    for _ in range(2):
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.2)
    time.sleep(600)
RunWriter.create = classmethod(interrupted)
interrupts.listen()
os.write(1, b"listening\\n")
__main__.main()
"""


@pytest.mark.slow
def test_twice_while_the_run_is_begun(tmp_path: Path) -> None:
    """Its folder is there, and nobody has said so: the last line does."""
    write(tmp_path, LONG)
    process = started(tmp_path, SLOW_TO_BEGIN)
    _, err = process.communicate(timeout=120)
    (partial,) = (tmp_path / "results").glob("*.partial")
    assert process.returncode == 130, err
    assert str(Path("results") / partial.name) in last_words(err), err


@pytest.mark.soak
@pytest.mark.parametrize("times", [1, 2])
@pytest.mark.parametrize("decade", range(20))
def test_at_many_instants(tmp_path: Path, decade: int, times: int) -> None:
    for seed in range(1000 + 10 * decade, 1010 + 10 * decade):
        folder = tmp_path / str(seed)
        folder.mkdir()
        check(folder, seed, times)


STUCK = '''
"""A backend that hangs in a call into a library; with `hold`, in one that lets no thread run."""
import ctypes, pathlib
from campaign.backends.interface import BackendKind, Source
from campaign.options import Options
from campaign.trial import SafeState

class StuckOptions(Options):
    hold: bool = False

class Stuck:
    def __init__(self, options): self.options = options
    def __enter__(self): return self
    def __exit__(self, *exception): return None
    def refuses(self, trial): return None
    def channels(self, trial): return None
    def execute(self, trial, recorder, stop):
        pathlib.Path("stuck").touch()
        (ctypes.PyDLL if self.options.hold else ctypes.CDLL)(None).sleep(600)
    def make_safe(self):
        pathlib.Path("safe").touch()
        return SafeState.CONFIRMED

BACKEND = BackendKind("stuck", "hangs", StuckOptions, Stuck, Source.SIMULATION)
MOVES = BackendKind("stuck_live", "hangs", StuckOptions, Stuck, Source.HARDWARE, live=True)
'''


@pytest.mark.parametrize("hold", [False, True])
def test_inside_a_call_that_does_not_return(tmp_path: Path, hold: bool) -> None:
    packages = tmp_path / "packages"
    about = packages / "stuck-1.0.dist-info"
    about.mkdir(parents=True)
    (packages / "stuck.py").write_text(STUCK)
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: stuck\nVersion: 1.0\n")
    points = "stuck = stuck:BACKEND\nstuck_live = stuck:MOVES\n"
    (about / "entry_points.txt").write_text(f"[campaign.backends]\n{points}")
    write(tmp_path, LONG)
    options = ("--backend", "stuck_live" if hold else "stuck", "--yes")
    options += ("--set", f"backend.hold={str(hold).lower()}")
    own = {"PYTHONPATH": f"{packages}{os.pathsep}{ROOT}"}
    run = ("run", "protocol.toml", *options)
    with Begun(forks(), tmp_path, *run, environment=environment() | own) as process:
        deadline = time.monotonic() + 120
        while not (tmp_path / "stuck").exists():
            assert process.poll() is None, process.stderr.read()
            assert time.monotonic() < deadline
            time.sleep(0.05)
        interrupt(process)
        time.sleep(0.3)
        assert process.poll() is None  # the first one only asks
        interrupt(process)
        _, err = process.communicate(timeout=60)  # it would take ten minutes
    assert process.returncode == (5 if hold else 130), err
    assert ("did not obey and was killed\nSAFE STATE NOT CONFIRMED" in err) is hold
    assert (tmp_path / "safe").exists() is not hold
    err = err.removesuffix("the backend could not be asked to make the bench safe\n")
    assert "Traceback" not in err
    (kept,) = (tmp_path / "results").glob("*.partial")
    assert re.fullmatch(
        rf"stopped at once; the finished trials are in results/{kept.name}; .*",
        last_words(err),
    )
    campaign(tmp_path, "show", kept.stem)
