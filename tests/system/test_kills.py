"""SIGKILL at any moment: what was reported finished is there and intact, and the run goes on."""

from __future__ import annotations

import contextlib
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from campaign.archive import RunStatus, find_run, open_run
from campaign.archive.reading.listing import run_paths
from tests.system.user import SEA, environment, write

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL")

PROTOCOL = SEA.replace("cycles = 1\n", "cycles = 1\nrepeat = 6\n", 1)
TRIALS = 12

# The program is imported once; each life is a fork of it that runs the real command line. So a kill
# meets the run, and not the second in which Python starts.
NURSERY = """
import os, sys
import campaign.cli.run, campaign.cli.resume, campaign.archive.writing.trial_file
import campaign.archive.writing.sealing, campaign.archive.writing.unsealing
import campaign.physics.simulate, campaign.backends.sim
from campaign.cli import main
for line in sys.stdin:
    child = os.fork()
    if child == 0:
        sys.argv = ["campaign", *line.split()]
        main()
        os._exit(0)
    print(child, flush=True)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""


class Nursery:
    """Lives of the program in one folder, one at a time; their output is thrown away."""

    def __init__(self, folder: Path) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-W", "ignore", "-c", NURSERY],
            cwd=folder,
            env=environment(),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )

    def __enter__(self) -> Nursery:
        return self

    def __exit__(self, *exception: object) -> None:
        self._process.stdin.close()
        self._process.wait(60)
        self._process.stdout.close()

    def live(self, arguments: str, until: float | None = None) -> int:
        """The exit code of a command, or -9 when it was killed after `until` s."""
        print(arguments, file=self._process.stdin, flush=True)
        child = int(self._next())
        if until is not None:
            time.sleep(until)  # the moment of the kill is what is random here
            with contextlib.suppress(ProcessLookupError):
                os.kill(child, signal.SIGKILL)
        return int(self._next())

    def _next(self) -> str:
        """A number; what the command itself printed is passed over."""
        for line in self._process.stdout:
            if line.strip().lstrip("-").isdigit():
                return line
        raise AssertionError("the nursery has closed")


def kill_again_and_again(folder: Path, kills: int, seed: int) -> int:
    """Kill runs and resumes at random moments; returns how many kills met a life.

    Whatever was reported finished at one kill is looked for after the next ones, and in the end.
    """
    chance = random.Random(seed)
    results = folder / "results"
    results.mkdir()
    write(folder, PROTOCOL)
    met = 0
    with Nursery(folder) as nursery:
        began = time.monotonic()
        assert nursery.live("run protocol.toml --workers 1 --results warm") == 0
        whole = time.monotonic() - began
        known: set[str] = set()
        while met < kills:
            runs = run_paths(results)
            command = f"resume {runs[0].stem}" if runs else "run protocol.toml"
            code = nursery.live(f"{command} --workers 1", chance.uniform(0.0, 0.5 * whole))
            met += code == -9
            if not run_paths(results):
                assert not known, "a run is gone"
                continue
            run = open_run(find_run(results))
            assert run.problems() == []
            numbers = {trial.trial.name for trial in run.trials}
            assert known <= numbers, "a finished trial is gone"
            known |= numbers
            if run.sealed and run.status is RunStatus.COMPLETE:
                assert run.unchanged()
                assert len(run.trials) == TRIALS
                known = set()
                run.path.unlink()
                # A kill may have come while the folder that was sealed was being removed.
                shutil.rmtree(run.path.with_suffix(".partial"), ignore_errors=True)
        if run_paths(results):
            assert nursery.live(f"resume {find_run(results).stem} --workers 1") == 0
            run = open_run(find_run(results))
            assert (run.sealed, run.status, len(run.trials)) == (True, RunStatus.COMPLETE, TRIALS)
            assert known <= {trial.trial.name for trial in run.trials}
            assert run.problems() == []
            assert run.unchanged()
    return met


@pytest.mark.slow
def test_a_killed_run_loses_no_finished_trial_and_goes_on(tmp_path: Path):
    assert kill_again_and_again(tmp_path, kills=3, seed=1) >= 3


@pytest.mark.soak
def test_two_hundred_kills_lose_no_finished_trial(tmp_path: Path):
    assert kill_again_and_again(tmp_path, kills=200, seed=2) >= 200
