"""A change of the engine that changes samples has a version of its own."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from campaign.backends.sim import BACKEND, SimOptions
from campaign.experiments.shared.friction_models import with_model
from campaign.physics.engine_version import ENGINE
from campaign.protocol.bench_file import load_bench
from campaign.recording import MemoryRecorder
from campaign.signals import Polyline, Sine
from campaign.trial import Task, Trial

BENCHES = Path(__file__).parent / "kept"
KEPT = BENCHES / "engine.json"
CHANNELS = ("gyro_rate", "pointing_error", "motor_current", "friction_torque")
DIGITS = 9  # platforms agree on them: the sums of a library differ in the last of sixteen

SEA = Sine(amplitude=0.314, frequency=2.0)
PUSH = Polyline(times=(0.0, 0.4), values=(0.0, 60.0))
TURN = Polyline(times=(0.0, 0.1, 0.3, 0.4), values=(0.0, 0.2, -0.2, 0.0))
TRIALS = {
    "simulink, none": ("simulink", "rate", "none", {"base_acceleration": SEA}),
    "simulink, lugre": ("simulink", "rate", "lugre", {"base_acceleration": SEA}),
    "simulink, observer": ("simulink", "rate", "observer", {"command": TURN}),
    "simulink, static": ("simulink", "rate", "static", {"base_acceleration": SEA}),
    "simulink, dry, none": ("simulink", "rate", "none", {"base_acceleration": SEA}),
    "simulink, dry, lugre": ("simulink", "rate", "lugre", {"command": TURN}),
    "simulink, dry, static": ("simulink", "rate", "static", {"base_acceleration": SEA}),
    "simulink, pushed": ("simulink", "torque", "none", {"command": PUSH}),
    "simulink, prescribed": ("simulink", "prescribed", "none", {"command": TURN}),
    "platform, none": ("platform", "rate", "none", {"base_acceleration": SEA}),
    "platform, static": ("platform", "rate", "static", {"command": TURN}),
    "platform, lugre": ("platform", "rate", "lugre", {"command": TURN}),
    "platform, dry, none": ("platform", "rate", "none", {"command": TURN}),
    "platform, pushed": ("platform", "torque", "none", {"command": PUSH}),
}  # fmt: skip


def trajectory(name: str) -> dict[str, list[float]]:
    """Some samples of each channel, rounded."""
    bench, mode, compensation, signals = TRIALS[name]
    on = load_bench(str(BENCHES / f"{bench}.toml"))
    task = Task(
        mode=mode, compensation=compensation, duration=0.4, window=(0.0, 0.4), sample_rate=1000.0,
        **signals,
    )  # fmt: skip
    tree = with_model(on, "stribeck") if ", dry" in name else on.model_dump(mode="json")
    trial = Trial(number=1, test="t", kind="k", seed=7, bench=tree, task=task)
    recorder = MemoryRecorder()
    with BACKEND.open(SimOptions()) as backend:
        ending = backend.execute(trial, recorder, lambda: False)
    recording = recorder.recording(ending)
    assert ending.outcome == "completed", ending
    return {
        channel: [float(f"{x:.{DIGITS}g}") for x in recording[channel][[3, 40, 199, 395]]]
        for channel in CHANNELS
        if channel in recording.channels
    }


def test_samples_change_with_the_version_alone():
    """To renew the file: raise ENGINE, say in the changelog which results change and why, and run
    `python -m tests.physics.test_engine_version`."""
    kept = json.loads(KEPT.read_text(encoding="utf-8"))
    assert kept["engine"] == ENGINE, "ENGINE was raised: renew the kept samples (see this test)"
    for name, channels in kept["trials"].items():
        now = trajectory(name)
        assert now.keys() == channels.keys()
        for channel, values in channels.items():
            largest = np.max(np.abs(values))
            assert now[channel] == pytest.approx(values, rel=2e-8, abs=2e-8 * largest), (
                f"{name}: {channel} is not what engine {ENGINE} computes: if that is meant, raise "
                "ENGINE in campaign/physics/engine_version.py (see this test for how)"
            )


def test_every_trial_is_kept():
    assert json.loads(KEPT.read_text(encoding="utf-8"))["trials"].keys() == TRIALS.keys()


if __name__ == "__main__":
    found = {"engine": ENGINE, "trials": {name: trajectory(name) for name in TRIALS}}
    KEPT.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
