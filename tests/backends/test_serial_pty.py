"""The hardware backend through a terminal device, as with a controller on a USB cable."""

from __future__ import annotations

import sys

import pytest

from campaign.backends.serial import BACKEND, SerialOptions
from campaign.backends.sim import SimBackend, SimOptions
from campaign.recording import MemoryRecorder, Outcome, SafeState
from campaign.signals import Sine
from campaign.trial import Task, Trial
from tests.link.controllers import controller
from tests.physics.benches import bench


@pytest.mark.skipif(sys.platform == "win32", reason="there are no pseudo-terminals")
def test_through_a_terminal_the_samples_are_those_of_the_simulation() -> None:
    task = Task(
        mode="rate",
        command=Sine(amplitude=0.1, frequency=2.0),
        duration=0.5,
        window=(0.0, 0.5),
        sample_rate=1000.0,
    )
    tree = bench().model_dump(mode="json")
    trial = Trial(number=1, test="t", kind="move", seed=3, bench=tree, task=task)
    expected, heard = MemoryRecorder(), MemoryRecorder()
    true = expected.recording(SimBackend(SimOptions()).execute(trial, expected, lambda: False))
    with controller("--speed", "max", bench="simulink", pty=True) as port:
        assert not port.startswith("socket:")
        with BACKEND.open(SerialOptions(port=port)) as backend:
            ending = backend.execute(trial, heard, lambda: False)
    recording = heard.recording(ending)
    assert (ending.outcome, ending.safe_state) == (Outcome.COMPLETED, SafeState.CONFIRMED), ending
    assert len(recording.time) == 500
    assert recording.time.tobytes() == true.time.tobytes()
    assert list(recording.channels) == list(true.channels)
    for name in true.channels:
        assert recording[name].tobytes() == true[name].tobytes(), name
