"""A run over a line that loses, repeats, swaps, delays and dribbles bytes, goes deaf or hangs up.

Every sample that is kept is the simulated one to the bit or is marked as lost, what failed has a
name, the exit code says how it ended, and the controller's own log ends with the drive off. No
judgement here depends on how fast the machine is: on a slow one a trial may end in a fault that a
fast one would not have met, and that is as right.
"""

from __future__ import annotations

import json
import random
import time
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.open_run import open_run
from campaign.errors import ExitCode
from campaign.recording import Fault, Outcome, Recording, SafeState
from tests.link.bad_line import Block, Trouble, bad_line, schedule
from tests.link.controllers import controller
from tests.system.user import begun, campaign, write

PROTOCOL = """\
title = "Short on a bad line"

[faults]
default = { do = "retry", times = 1 }

[[test]]
name = "sea"
kind = "stabilization"
bench = "simulink"
seed = 7
frequency = "4 Hz"
acceleration = "18 deg/s^2"
cycles = 2
settle_cycles = 1

[test.matrix]
compensation = ["none", "lugre", "static"]
"""
ON = ("--backend", "serial", "--set", "backend.motion=emulated", "--yes")
SOON = ("--set", "backend.silence=1.5 s", "--set", "backend.safe_time=4 s")
PATIENCE = 600.0
"""s; only for a machine that is very busy, and a run that would never end."""

CHARACTERS: tuple[dict[Trouble, float], ...] = (
    {Trouble.DROP: 0.03},
    {Trouble.DUPLICATE: 0.02},
    {Trouble.SWAP: 0.02},
    {Trouble.DELAY: 0.02},
    {Trouble.DRIBBLE: 0.02},
    {Trouble.DEAF: 0.003},
    {Trouble.RESET: 0.003},
    dict.fromkeys(Trouble, 0.005),
)
"""Share of the blocks that meet a trouble; a trial is some hundred blocks."""


def simulated(folder: Path) -> tuple[Recording, ...]:
    """What the same protocol gives without any line."""
    write(folder, PROTOCOL)
    done = campaign(folder, "run", "protocol.toml")
    return tuple(trial.recording() for trial in open_run(folder / done.last_line).trials)


@pytest.fixture(scope="module")
def truth(tmp_path_factory: pytest.TempPathFactory) -> tuple[Recording, ...]:
    return simulated(tmp_path_factory.mktemp("simulated"))


def judge_recording(mine: Recording, true: Recording) -> None:
    """Right to the bit where it is not marked; whole where it is said to be completed."""
    count = len(mine.time)
    assert mine.time.tobytes() == true.time[:count].tobytes()
    if not count:
        assert mine.ending.outcome is not Outcome.COMPLETED
        return
    assert tuple(mine.channels) == tuple(true.channels)
    marked = np.isnan(mine["gyro_rate"])
    for name in mine.channels:
        got, expected = mine[name], true[name][:count]
        np.testing.assert_array_equal(np.isnan(got), marked | np.isnan(expected))
        assert got[~marked].tobytes() == expected[~marked].tobytes()
    if mine.ending.outcome is Outcome.COMPLETED:
        assert count == len(true.time)
        assert not marked.any()


def judge_archive(path: Path, truth: tuple[Recording, ...], code: int) -> None:
    """What is archived, and that the exit code says it."""
    run = open_run(path)
    kept = [trial.recording() for trial in run.trials]
    for trial, mine in zip(run.trials, kept, strict=True):
        judge_recording(mine, truth[trial.trial.number - 1])
        if mine.ending.outcome is Outcome.FAULT:
            assert isinstance(mine.ending.fault, Fault)
            assert mine.ending.reason
    if run.safe_state is not SafeState.CONFIRMED:
        expected = ExitCode.NOT_SAFE
    elif run.status is RunStatus.INTERRUPTED:
        expected = ExitCode.INTERRUPTED
    elif any(mine.ending.outcome is not Outcome.COMPLETED for mine in kept):
        expected = ExitCode.LIMIT_OR_FAULT
    else:
        expected = ExitCode.DONE
    assert code == expected, (run.status, run.reason)
    if code == ExitCode.DONE:
        assert len(kept) == len(truth)


def drive_is_off(log: Path) -> bool:
    events = [json.loads(line)["event"] for line in log.read_text(encoding="utf-8").splitlines()]
    drive = [event for event in events if event.startswith("drive ")]
    return not drive or drive[-1] == "drive off"


def attack(folder: Path, seed: int, truth: tuple[Recording, ...]) -> int:
    """One run over a line of this seed."""
    folder.mkdir()
    source = random.Random(seed)
    rates = CHARACTERS[seed % len(CHARACTERS)]
    quiet = [source.choice([0, 200, 2000, 20_000]) for _ in range(2)]
    there = schedule(f"{seed} out", rates, quiet[0])
    back = schedule(f"{seed} back", rates, quiet[1])
    return run_over(folder, there, back, truth)


def run_over(
    folder: Path, there: Iterable[Block], back: Iterable[Block], truth: tuple[Recording, ...]
) -> int:
    """One run over a line with these faults, judged; its exit code."""
    write(folder, PROTOCOL)
    log = folder / "device.log"
    log.touch()
    options = ("--log", str(log), "--latch", str(folder / "latch.json"), "--new-latch")
    patient = ("--heartbeat-timeout", "2")
    with (
        controller("--speed", "max", *options, *patient, bench="simulink") as port,
        bad_line(port, there, back) as line,
    ):
        run = begun(folder, "run", "protocol.toml", *ON, *SOON, "--port", line.port)
        out, err = run.communicate(timeout=PATIENCE)
        assert "Traceback" not in err, err
        deadline = time.monotonic() + PATIENCE
        while not drive_is_off(log):  # by itself, where nobody could tell it
            assert time.monotonic() < deadline, log.read_text()
            time.sleep(0.05)
    code = run.returncode
    assert code is not None
    if out.strip():
        judge_archive(folder / out.splitlines()[-1], truth, code)
    else:  # the controller never answered, or told who stopped it
        assert code in (ExitCode.USAGE, ExitCode.LIMIT_OR_FAULT), err
        assert err.strip()
        assert "drive on" not in log.read_text(encoding="utf-8")
    return code


def attacks(folder: Path, seeds: range, truth: tuple[Recording, ...]) -> list[int]:
    """Several at a time: most of a run over a bad line is waiting."""
    with ThreadPoolExecutor(4) as pool:
        return list(pool.map(lambda seed: attack(folder / str(seed), seed, truth), seeds))


@pytest.mark.slow
def test_a_line_with_faults_gives_no_wrong_sample(
    tmp_path: Path, truth: tuple[Recording, ...]
) -> None:
    codes = attacks(tmp_path, range(8), truth)
    assert ExitCode.DONE in codes  # a little is mended


@pytest.mark.soak
@pytest.mark.parametrize("batch", range(40))
def test_a_line_with_faults_gives_no_wrong_sample_for_long(
    tmp_path: Path, truth: tuple[Recording, ...], batch: int
) -> None:
    attacks(tmp_path, range(1000 + 8 * batch, 1008 + 8 * batch), truth)
