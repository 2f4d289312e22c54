"""A trial's step is checked at half of it by the trial itself; the archive says what changed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from campaign.archive.reading.open_run import open_run
from campaign.backends.sim import SimBackend, SimOptions
from campaign.backends.step_check import CHANGE, STEP, StepCheck
from campaign.recording import Ending, MemoryRecorder, Outcome, Recording
from campaign.signals import Sine
from campaign.trial import Trial
from tests.backends.test_sim import trial
from tests.physics.benches import bench, task
from tests.system.user import SEA, campaign, write

SWING = Sine(amplitude=float(np.deg2rad(18.0)), frequency=0.24)
MOVING = trial(bench(), task(base_acceleration=SWING, compensation="lugre", duration=2.5))


def simulated(step: str, *, check: bool = False, one: Trial = MOVING) -> Recording:
    recorder = MemoryRecorder()
    backend = SimBackend(SimOptions(longest_step=step, check_step=check))
    return recorder.recording(backend.execute(one, recorder, lambda: False))


def test_it_is_the_rms_of_the_change_over_that_of_the_channel() -> None:
    check = StepCheck(0.5, ["a", "b", "still"])
    check.add(np.array([[3.0], [1.0], [0.0]]), np.array([[3.0], [1.5], [0.0]]))
    check.add(np.array([[4.0], [1.0], [0.0]]), np.array([[5.0], [1.5], [0.0]]))
    assert check.telemetry() == {STEP: 0.5, CHANGE: {"a": 0.2, "b": 0.5}}


def test_what_is_told_is_what_two_runs_differ_by() -> None:
    told = simulated("1 ms", check=True).ending.telemetry
    whole, half = simulated("1 ms"), simulated("0.5 ms")
    assert told[STEP] == 1e-3
    changes = told[CHANGE]
    assert isinstance(changes, dict)
    assert set(changes) > {"gyro_rate", "motor_current", "friction_torque", "compensation_torque"}
    for name, share in changes.items():
        change = np.sqrt(np.mean((whole[name] - half[name]) ** 2) / np.mean(whole[name] ** 2))
        assert share == pytest.approx(change, rel=0.01), name


def test_the_samples_are_those_of_a_trial_that_is_not_checked() -> None:
    checked, plain = simulated("1 ms", check=True), simulated("1 ms")
    for name, channel in plain.channels.items():
        assert channel.samples.tobytes() == checked[name].tobytes(), name
    assert plain.ending == Ending(Outcome.COMPLETED)


def test_noise_is_no_change() -> None:
    """The sensors read the same noise at either step: what differs is the plant."""
    noisy = bench(
        lambda tree: tree.update(
            controller={**tree["controller"], "sample_rate": "1 kHz"},
            sensors={"gyro": {"noise": "1e-3 rad/s"}},
        )
    )
    one = trial(noisy, task(base_acceleration=SWING))
    changes = simulated("0.125 ms", check=True, one=one).ending.telemetry[CHANGE]
    assert isinstance(changes, dict)
    assert changes["gyro_rate"] < 1e-3


def test_together_each_is_checked_by_its_own() -> None:
    """Two trials that differ, and one that is shorter."""
    fields = [{"duration": 1.0}, {"duration": 0.3}, {"duration": 1.0, "compensation": "lugre"}]
    trials = [
        trial(bench(lambda tree, k=k: tree["axis"].update(inertia=f"{40 + k} kg m^2")),
              task(**{"base_acceleration": SWING, "compensation": "lugre", **each}))
        for k, each in enumerate(fields)
    ]  # fmt: skip
    recorders = [MemoryRecorder() for _ in trials]
    backend = SimBackend(SimOptions(longest_step="1 ms", check_step=True))
    stops = [lambda: False] * len(trials)
    endings = dict(backend.execute_together(trials, recorders, stops))
    for place, one in enumerate(trials):
        alone = simulated("1 ms", check=True, one=one).ending.telemetry
        assert endings[place].telemetry == alone
    assert endings[0].telemetry != endings[2].telemetry


@pytest.mark.slow
def test_a_user_is_told(tmp_path: Path) -> None:
    write(tmp_path, SEA)
    done = campaign(tmp_path, "run", "protocol.toml", "--check-step")
    assert "step check: half the step changes no channel by more than" in done.err
    run = open_run(tmp_path / done.last_line)
    assert run.header.backend_options["check_step"] is True
    for one in run.trials:
        assert one.ending.telemetry[CHANGE]
    coarse = campaign(
        tmp_path, "run", "protocol.toml", "--check-step", "--set", 'backend.longest_step="4 ms"'
    )
    assert "by more than 0.001 of a channel's RMS" in coarse.err
    assert "--set backend.longest_step=" in coarse.err
    plain = campaign(tmp_path, "run", "protocol.toml")
    assert "step check" not in plain.err
