"""The hardware backend across a real byte stream, against the simulated bench itself."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from campaign.backends.serial import BACKEND, SerialBackend, SerialOptions
from campaign.backends.sim import BACKEND as SIM
from campaign.backends.sim import SimOptions
from campaign.errors import UsageError
from campaign.protocol.bench_file import load_bench
from campaign.recording import Ending, Fault, MemoryRecorder, Outcome, Recording, SafeState
from campaign.signals import MultiSine, Polyline, Sine
from campaign.trial import Task, Trial
from campaign.wire.channel_features import channel_features, named_channels
from tests.link.controllers import controller

PLATFORM = load_bench("platform").model_dump(mode="json")
SWING = Sine(amplitude=0.3, frequency=0.5)


def task(**changes: Any) -> Task:
    settings: dict[str, Any] = {
        "mode": "rate",
        "command": Sine(amplitude=0.1, frequency=1.0),
        "duration": 1.0,
        "window": (0.0, 1.0),
        "sample_rate": 1000.0,
        **changes,
    }
    return Task(**settings)


def trial(what: Task | None = None, number: int = 1, **changes: Any) -> Trial:
    settings: dict[str, Any] = {
        "number": number,
        "test": "t",
        "kind": "k",
        "seed": 100 + number,
        "bench": PLATFORM,
        "task": what or task(),
        **changes,
    }
    return Trial(**settings)


def backend_at(port: str, **options: Any) -> SerialBackend:
    return SerialBackend(SerialOptions(port=port, motion="emulated", **options))


def execute(
    backend: Any, what: Trial, stopped: Callable[[], bool] = lambda: False
) -> tuple[Ending, Recording]:
    recorder = MemoryRecorder()
    ending = backend.execute(what, recorder, stopped)
    return ending, recorder.recording(ending)


def simulated(what: Trial) -> tuple[Ending, Recording]:
    return execute(SIM.open(SimOptions()), what)


def compare(recording: Recording, true: Recording) -> int:
    """How many samples are marked as missing; every other one is right to the bit."""
    count = len(recording.time)
    assert recording.time.tobytes() == true.time[:count].tobytes()
    assert tuple(recording.channels) == tuple(true.channels)
    marked = np.isnan(recording["gyro_rate"])
    for name in recording.channels:
        mine, theirs = recording[name], true[name][:count]
        np.testing.assert_array_equal(np.isnan(mine), marked)
        assert mine[~marked].tobytes() == theirs[~marked].tobytes()
    return int(marked.sum())


PUSH = task(mode="torque", command=Polyline(times=(0.0, 2.0), values=(0.0, 2000.0)))
"""Ends at a limit of the bench."""


@pytest.mark.parametrize("pty", [False, True])
def test_without_faults_it_equals_the_simulation_to_the_bit(pty: bool) -> None:
    if pty and sys.platform == "win32":
        pytest.skip("no pseudo-terminals")
    trials = [
        trial(),
        trial(task(base_acceleration=SWING, compensation="lugre", duration=2.0), 2),
        trial(PUSH, 3),
    ]
    with controller("--speed", "max", pty=pty) as port, backend_at(port) as backend:
        for each in trials:
            ending, recording = execute(backend, each)
            expected, true = simulated(each)
            assert (ending.outcome, ending.reason) == (expected.outcome, expected.reason)
            assert ending.safe_state is SafeState.CONFIRMED
            assert compare(recording, true) == 0
            assert len(recording.time) == len(true.time)
            assert recording.events == true.events
            assert recording.channels.keys() == true.channels.keys()
            assert ending.telemetry["lost_records"] == 0
        assert backend.make_safe() is SafeState.CONFIRMED


def test_a_multisine_goes_as_it_is_however_many_lines_it_has() -> None:
    count = 1000  # as many as there may be: several messages of each array
    lines = MultiSine(
        amplitudes=(1e-3,) * count,
        frequencies=tuple(0.05 * (2 * k + 1) for k in range(count)),
        phases=tuple(0.7 * k * k % 6.0 for k in range(count)),
    )
    shaken = trial(task(mode="torque", command=lines))
    with controller("--speed", "max") as port, backend_at(port) as backend:
        ending, recording = execute(backend, shaken)
        assert ending.outcome is Outcome.COMPLETED
        _, true = simulated(shaken)
        assert compare(recording, true) == 0
        assert np.ptp(recording["drive_torque"]) > 0


def test_a_command_longer_than_the_controller_takes_is_refused_with_its_longest() -> None:
    count = 65_537
    times = tuple(k / count for k in range(count))
    long = trial(task(command=Polyline(times=times, values=(0.0,) * count)))
    with controller("--speed", "max") as port, backend_at(port) as backend:
        ending, _ = execute(backend, long)
        assert ending.outcome is not Outcome.COMPLETED
        assert "65536" in ending.reason
        assert "task.command.times" in ending.reason


def hold_to_it(faults: tuple[str, ...], trials: int) -> list[Ending]:
    """Nothing is wrong or missing without being marked, whatever the line does."""
    options = [word for fault in faults for word in ("--fault", fault)]
    endings = []
    with controller("--speed", "max", *options) as port, backend_at(port) as backend:
        for number in range(1, trials + 1):
            each = trial(number=number)
            ending, recording = execute(backend, each)
            _, true = simulated(each)
            missing = compare(recording, true)
            if ending.outcome is Outcome.COMPLETED:
                assert missing == 0
                assert len(recording.time) == len(true.time)
                assert recording.events == true.events
            else:
                assert ending.outcome is Outcome.FAULT
                assert ending.fault is not None
            endings.append(ending)
    return endings


NOISY = ("corrupt=1e-4", "drop=5e-5", "lost-blocks=0.01")


@pytest.mark.slow
def test_a_bad_line_damages_nothing_silently() -> None:
    endings = hold_to_it(NOISY, 6)
    assert sum(int(str(ending.telemetry["resend_requests"])) for ending in endings) > 0
    assert [ending.outcome for ending in endings].count(Outcome.COMPLETED) >= 5


@pytest.mark.soak
def test_a_bad_line_damages_nothing_silently_for_long() -> None:
    endings = hold_to_it(NOISY, 500)
    assert [ending.outcome for ending in endings].count(Outcome.COMPLETED) >= 490


@pytest.mark.parametrize(
    ("fault", "expected", "safe"),
    [
        ("reboot=0.05@trial=1", Fault.RESET, SafeState.CONFIRMED),
        ("over-temperature=0@trial=1", Fault.OVER_TEMPERATURE, SafeState.CONFIRMED),
        ("sensor@trial=1", Fault.SENSOR, SafeState.CONFIRMED),
        ("unplug=0.3@trial=1", Fault.LOST_CONNECTION, SafeState.NOT_CONFIRMED),
    ],
)
def test_a_fault_has_its_name_and_the_next_trial_is_good(
    fault: str, expected: Fault, safe: SafeState
) -> None:
    with controller("--speed", "max", "--fault", fault) as port, backend_at(port) as backend:
        ending, recording = execute(backend, trial())
        assert (ending.outcome, ending.fault) == (Outcome.FAULT, expected), ending
        assert ending.safe_state is safe
        _, true = simulated(trial())
        if expected is not Fault.SENSOR:  # whose frozen samples are real, and said to be so
            compare(recording, true)
        assert backend.make_safe() is SafeState.CONFIRMED
        ending, recording = execute(backend, trial())
        assert ending.outcome is Outcome.COMPLETED, ending
        assert compare(recording, true) == 0


def test_a_trial_can_be_stopped() -> None:
    patient = ("--heartbeat-timeout", "20")  # a busy machine is no silence
    with controller("--speed", "1", *patient) as port, backend_at(port) as backend:
        long = trial(task(duration=60.0))
        asked = iter([False, False])
        ending, recording = execute(backend, long, lambda: next(asked, True))
    assert ending.outcome is Outcome.INTERRUPTED
    assert ending.safe_state is SafeState.CONFIRMED
    assert len(recording.time) < 30_000


def test_a_configuration_that_is_refused_is_a_fault_with_the_name_in_it() -> None:
    bench = {**PLATFORM, "limits": {**PLATFORM["limits"], "current": 1e6}}
    with controller("--speed", "max") as port, backend_at(port) as backend:
        ending, _ = execute(backend, trial(bench=bench))
        assert (ending.outcome, ending.fault) == (Outcome.FAULT, Fault.REFUSED)
        assert "limits.current" in ending.reason
        assert ending.safe_state is SafeState.CONFIRMED


# What is refused before anything is connected


@pytest.mark.parametrize(
    ("what", "said"),
    [
        (task(mode="prescribed"), "task.mode"),
        (task(mode="spring", spring_stiffness=1.0), "task.mode"),
        (task(disturbance=SWING), "task.disturbance"),
        (task(base_acceleration=SWING), "task.base_acceleration"),
    ],
)
def test_what_only_a_simulation_can_do_is_refused_by_its_field(what: Task, said: str) -> None:
    assert said in str(SerialBackend(SerialOptions()).refuses(trial(what)))
    assert SerialBackend(SerialOptions()).refuses(trial()) is None


def changed(path: str, value: Any) -> dict[str, Any]:
    tree = load_bench("platform").model_dump(mode="json")
    *above, last = path.split(".")[1:]
    table = tree
    for key in above:
        table = table[key]
    table[last] = value
    return tree


def test_a_plant_changes_only_where_a_person_sets_it() -> None:
    path = "bench.gear.preload.torque"
    refuses = SerialBackend(SerialOptions()).refuses
    by_person = {"point": {path: 20.0}, "set_by_operator": (path,)}
    assert refuses(trial()) is None
    assert refuses(trial(bench=changed(path, 20.0), **by_person)) is None
    assert path in str(refuses(trial()))  # nobody sets it back
    friction = "bench.friction.load.coulomb_torque"
    assert friction in str(refuses(trial(point={friction: 17.0}, bench=changed(friction, 17.0))))
    assert friction in str(refuses(trial(bench=changed(friction, 17.0), **by_person)))


def test_gains_and_limits_may_be_swept() -> None:
    refuses = SerialBackend(SerialOptions()).refuses
    gain = "bench.controller.rate.proportional"
    assert refuses(trial()) is None
    assert refuses(trial(point={gain: 100.0}, bench=changed(gain, 100.0))) is None


def test_without_a_port_nothing_is_connected_and_the_message_says_what_to_do() -> None:
    with pytest.raises(UsageError, match="--port"):
        BACKEND.open(SerialOptions()).__enter__()
    with pytest.raises(UsageError, match="no answer"):
        SerialBackend(SerialOptions(port="socket://127.0.0.1:9")).__enter__()
    with pytest.raises(UsageError, match="plugged in"):
        SerialBackend(SerialOptions(port="/dev/no-such-port")).__enter__()


def test_the_channels_are_those_that_the_controller_names_when_it_is_connected() -> None:
    what = trial()
    with controller("--speed", "max") as port:
        backend = backend_at(port)
        assert backend.channels(what) is None
        with backend:
            known = backend.channels(what)
            assert known is not None
            assert known == set(execute(backend, what)[1].channels)
        assert backend.channels(what) is None


def test_a_feature_word_names_a_channel() -> None:
    assert channel_features(["gyro_rate", "command"]) == ("channel:gyro_rate", "channel:command")
    words = ("rate", "channel:gyro_rate", "torque", "channel:vibration", "channels")
    assert named_channels(words) == {"gyro_rate", "vibration"}
    assert named_channels(("rate", "torque")) is None  # it will say when it is armed
