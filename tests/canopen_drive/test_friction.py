"""Experiments on a simulated drive find the friction that it has."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from campaign.physics.bench import Bench
from campaign.recording import Outcome
from tests.canopen_drive.rig import BENCH, backend, execute
from tests.canopen_drive.simulated import SimulatedDrive
from tests.experiments.laboratory import Done, analyse, finding, trials

DESK = Bench.model_validate(BENCH, context={"si": True})
Make = Callable[..., tuple[str, SimulatedDrive]]
MAP = {
    "speeds": ["4 deg/s", "7 deg/s", "10 deg/s", "13 deg/s", "18 deg/s"],
    "max_travel": "20 deg",
    "max_time": "3 s",
    "window_time": "0.5 s",
    "window_angle": "1 deg",
    "settle_time": "0.4 s",
    "settle_angle": "0.1 deg",
    "acceleration": "100 deg/s^2",
    "rest": "0.2 s",
    "warm_up_cycles": 0,
    "sample_rate": "100 Hz",
}
RAMPS = {
    "positions": ["-5 deg", "5 deg"],
    "torque_rate": "0.5 N m/s",
    "peak_torque": "3 N m",
    "rest": "0.2 s",
    "sample_rate": "100 Hz",
    "sliding_rate": "0.02 rad/s",
}


def executed(kind: str, options: dict[str, Any], drives: Make) -> tuple[list[Done], list[float]]:
    """All trials, and the largest friction of each."""
    name, drive = drives(coulomb=1.0, static=1.5, viscous=0.5, noise=0.005)
    done, peaks = [], []
    with backend(name) as connected:
        for trial in trials(kind, DESK, options):
            assert connected.refuses(trial) is None
            ending, recording = execute(connected, trial)
            assert ending.outcome is Outcome.COMPLETED, ending
            peaks.append(drive.peak_friction)
            done.append(Done(trial, ending, recording))
    return done, peaks


@pytest.mark.slow
def test_a_velocity_map_finds_coulomb_and_viscous_friction(drives: Make) -> None:
    done, _ = executed("velocity_map", MAP, drives)
    result = analyse("velocity_map", done)
    for direction in ("positive", "negative"):
        for quantity, true in (("coulomb_torque", 1.0), ("viscous_friction", 0.5)):
            found = finding(result, quantity, direction=direction).estimate
            assert found.low is not None
            assert found.low < true < found.high, (quantity, direction, found)


@pytest.mark.slow
def test_ramps_find_the_breakaway_torque_of_each(drives: Make) -> None:
    done, peaks = executed("breakaway", RAMPS, drives)
    result = analyse("breakaway", done)
    for number, peak in enumerate(peaks, start=1):
        found = finding(result, "breakaway_torque", measurement=number).estimate
        assert found.low < peak < found.high, (number, peak, found.low, found.high)
