"""SIGKILL at any moment: what was reported finished is there and intact, and the run goes on."""

from __future__ import annotations

import random
import shutil
import sys
import time
from pathlib import Path

import pytest

from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_list import find_run, run_paths
from campaign.archive.verification.verify_run import verify_run
from tests.system.user import SEA, begun, write

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL")

PROTOCOL = SEA.replace("cycles = 1\n", "cycles = 1\nrepeat = 6\n", 1)
TRIALS = 12


def live(folder: Path, arguments: str, until: float | None = None) -> int | None:
    """The exit code of a command, or -9 when it was killed after `until` s.

    It is a fork of what has imported the program, so that a kill meets the run.
    """
    process = begun(folder, *arguments.split(), "--workers", "1")
    if until is not None:
        time.sleep(until)  # the moment of the kill is what is random here
        process.kill()
    process.communicate()
    return process.returncode


def kill_again_and_again(folder: Path, kills: int, seed: int) -> int:
    """Kill runs and resumes at random moments; returns how many kills met a life.

    Whatever was reported finished at one kill is looked for after the next ones, and in the end.
    """
    chance = random.Random(seed)
    results = folder / "results"
    results.mkdir()
    write(folder, PROTOCOL)
    met = 0
    began = time.monotonic()
    assert live(folder, "run protocol.toml --results warm") == 0
    whole = time.monotonic() - began
    known: set[str] = set()
    while met < kills:
        runs = run_paths(results)
        command = f"resume {runs[0].stem}" if runs else "run protocol.toml"
        code = live(folder, command, chance.uniform(0.0, 0.5 * whole))
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
            assert verify_run(run.path).sound
            assert len(run.trials) == TRIALS
            known = set()
            run.path.unlink()
            # A kill may have come while the folder that was sealed was being removed.
            shutil.rmtree(run.path.with_suffix(".partial"), ignore_errors=True)
    if run_paths(results):
        assert live(folder, f"resume {find_run(results).stem}") == 0
        run = open_run(find_run(results))
        assert (run.sealed, run.status, len(run.trials)) == (True, RunStatus.COMPLETE, TRIALS)
        assert known <= {trial.trial.name for trial in run.trials}
        assert run.problems() == []
        assert verify_run(run.path).sound
    return met


@pytest.mark.slow
def test_a_killed_run_loses_no_finished_trial_and_goes_on(tmp_path: Path):
    assert kill_again_and_again(tmp_path, kills=3, seed=1) >= 3


@pytest.mark.soak
def test_two_hundred_kills_lose_no_finished_trial(tmp_path: Path):
    assert kill_again_and_again(tmp_path, kills=200, seed=2) >= 200
