"""The kit on the backends that need another end: a controller's process, and an archive."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from campaign.archive.reading.open_run import open_run
from campaign.backends.replay import BACKEND as REPLAY
from campaign.backends.replay import ReplayOptions
from campaign.backends.serial import BACKEND as SERIAL
from campaign.backends.serial import SerialOptions
from campaign.backends.sim import SimBackend, SimOptions
from campaign.cli.stop import stop_bench
from campaign.errors import ExitCode
from campaign.recording import Ending, Event, Fault, Outcome, Recording
from campaign.signals import Sine
from campaign.testing import BackendUnderTest, StrictRecorder, backend_checks
from campaign.trial import Task, Trial
from tests.archives import archived, executed
from tests.link.controllers import controller
from tests.physics.benches import bench

CHECKS = backend_checks()
SWING = Sine(amplitude=0.3, frequency=0.5)
TASK = Task(
    mode="rate",
    command=Sine(amplitude=0.1, frequency=1.0),
    duration=5.0,
    window=(0.0, 5.0),
    sample_rate=1000.0,
)
TREE = bench().model_dump(mode="json")
TRIAL = Trial(number=1, test="t", kind="move", seed=1, bench=TREE, task=TASK)


def asking(trial: Trial, **changes: object) -> Trial:
    """`trial` with another task."""
    return trial.model_copy(update={"task": trial.task.model_copy(update=changes)})


SWUNG = asking(TRIAL, base_acceleration=SWING)


def possible(trial: Trial, name: str) -> Trial:
    """For a check of stopping: longer than what the controller sends ahead of the host's word."""
    long = {"duration": 60.0, "window": (0.0, 60.0)}
    return asking(trial, **long) if name.startswith(("stops_", "keeps_a_stop")) else trial


def panic_stop(port: str) -> None:
    assert stop_bench(port, 2_000_000, 30.0) is ExitCode.DONE


@pytest.fixture(scope="module")
def port() -> Iterator[str]:
    with controller("--speed", "max", bench="simulink") as found:
        yield found


@pytest.fixture(scope="module")
def hot_port() -> Iterator[str]:
    """Of a controller whose motor is too hot in every trial."""
    with controller("--speed", "max", "--fault", "over-temperature", bench="simulink") as found:
        yield found


@pytest.fixture(scope="module")
def slow_port() -> Iterator[str]:
    """Of a controller whose seconds take a second."""
    patient = ("--heartbeat-timeout", "20")  # a busy machine is no silence
    with controller("--speed", "1", *patient, bench="simulink") as found:
        yield found


@pytest.mark.slow
@pytest.mark.parametrize("name", CHECKS)
def test_serial_passes(name: str, port: str, hot_port: str, slow_port: str) -> None:
    in_time = name == "hands_samples_over_in_time"
    CHECKS[name](
        BackendUnderTest(
            open=lambda: SERIAL.open(SerialOptions(port=slow_port if in_time else port)),
            possible=possible(TRIAL, name),
            impossible=possible(SWUNG, name),
            names="task.base_acceleration",
            failing=lambda: SERIAL.open(SerialOptions(port=hot_port)),
            live=True,
            stop_outside=lambda: panic_stop(port),
        )
    )


# The same but for the hull: at full speed nothing is handed over in the time of the wall clock.
@pytest.mark.parametrize("name", [name for name in CHECKS if name != "hands_samples_over_in_time"])
def test_serial_with_an_emulated_hull_passes(name: str, port: str) -> None:
    CHECKS[name](
        BackendUnderTest(
            open=lambda: SERIAL.open(SerialOptions(port=port, motion="emulated")),
            possible=possible(SWUNG, name),
            impossible=asking(SWUNG, disturbance=SWING),
            names="task.disturbance",
            live=True,
            stop_outside=lambda: panic_stop(port),
        )
    )


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return executed(tmp_path_factory.mktemp("good"), [TRIAL], SimBackend(SimOptions()))


@pytest.fixture(scope="module")
def failed(tmp_path_factory: pytest.TempPathFactory, good: Path) -> Path:
    """An archive whose one trial was ended by its drive."""
    (trial,) = open_run(good).trials
    was = trial.recording()
    ending = Ending(Outcome.FAULT, "the drive tripped", fault=Fault.DRIVE)
    recording = Recording(was.time, was.channels, was.events, ending)
    return archived(tmp_path_factory.mktemp("failed"), [(TRIAL, recording)])


@pytest.mark.parametrize("name", CHECKS)
def test_replay_passes(name: str, good: Path, failed: Path) -> None:
    CHECKS[name](
        BackendUnderTest(
            open=lambda: REPLAY.open(ReplayOptions(run=str(good))),
            possible=TRIAL,
            impossible=SWUNG,
            names="base_acceleration",
            failing=lambda: REPLAY.open(ReplayOptions(run=str(failed))),
        )
    )


def test_a_stopped_replay_has_the_samples_and_events_until_then(tmp_path: Path, good: Path) -> None:
    (trial,) = open_run(good).trials
    was = trial.recording()
    events = (Event(0.5, "early"), Event(4.5, "late"))
    path = archived(tmp_path, [(TRIAL, Recording(was.time, was.channels, events, was.ending))])
    recorder = StrictRecorder()
    with REPLAY.open(ReplayOptions(run=str(path))) as backend:
        ending = backend.execute(TRIAL, recorder, lambda: recorder.blocks >= 1)
    recording = recorder.recording(ending)
    count = len(recording.time)
    assert 0 < count < len(was.time)
    assert recording["gyro_rate"].tobytes() == was["gyro_rate"][:count].tobytes()
    assert recording.events == events[:1]
