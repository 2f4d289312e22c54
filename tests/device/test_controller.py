"""The controller without a line: states, pace, records, and what goes wrong on demand."""

from __future__ import annotations

import itertools
import math
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from campaign.backends.sim import SimBackend, SimOptions
from campaign.device.controller import Controller
from campaign.device.faults import parse_faults
from campaign.device.latch import new_memory
from campaign.device.machine import DeviceLog, Setup
from campaign.device.producer import AHEAD
from campaign.protocol.bench_file import load_bench
from campaign.recording import MemoryRecorder
from campaign.signals import Sine
from campaign.trial import Task, Trial
from campaign.wire.codes import Fault, NakCode, Outcome, State
from campaign.wire.configuration import configuration_of
from campaign.wire.device import (
    Ack,
    Capabilities,
    Channels,
    End,
    Event,
    Holder,
    Latch,
    LostRecords,
    Nak,
    Samples,
    Status,
)
from campaign.wire.frames import Frame
from campaign.wire.host import (
    Arm,
    Clear,
    Heartbeat,
    Hello,
    Query,
    Release,
    Resend,
    Safe,
    Start,
    Stop,
)
from campaign.wire.messages import Message, configuration_crc, encode, parameter_messages

BENCH = load_bench("platform")
HOST, STRANGER = 1, 2
OURS, THEIRS = 42, 43
"""Sessions."""
RATE = 1000.0


def trial(duration: float = 1.0, amplitude: float = 0.2) -> Trial:
    task = Task(
        mode="rate",
        command=Sine(amplitude=amplitude, frequency=1.0),
        base_acceleration=Sine(amplitude=0.1, frequency=2.0),
        compensation=next(iter(BENCH.compensation)),
        duration=duration,
        window=(0.0, duration),
        sample_rate=RATE,
    )
    tree = BENCH.model_dump(mode="json")
    return Trial(number=1, test="t", kind="k", seed=7, bench=tree, task=task)


class Rig:
    """A controller whose clock stands until it is told to go on."""

    folder = Path()  # conftest.py makes one for each test
    numbers = itertools.count()

    def __init__(
        self, *faults: str, speed: float = 1.0, latch: Path | None = None, log: Path | None = None
    ) -> None:
        """Without a file for its latch it gets a new one that is lost with the rig."""
        if latch is None:
            latch = Rig.folder / f"latch-{next(Rig.numbers)}"
            new_memory(latch)
        self.time = 100.0
        self.said: list[tuple[int | None, Message]] = []
        setup = Setup(
            BENCH,
            speed,
            faults=parse_faults(faults),
            now=lambda: self.time,
            log=DeviceLog(log),
            latch_file=latch,
        )
        self.controller = Controller(setup, lambda to, what: self.said.append((to, what)), 0.1)
        self.sequence = 500

    def send(self, message: Message, client: int = HOST, sequence: int | None = None) -> Any:
        """The answer to a message."""
        if sequence is None:
            self.sequence = sequence = self.sequence + 1
        kind, body = encode(message)
        before = len(self.said)
        self.controller.handle(client, Frame(kind, sequence, body))
        return next(
            (m for _, m in self.said[before:] if isinstance(m, Ack | Nak | Capabilities)), None
        )

    def beat(self) -> Status:
        """Heartbeats are not numbered."""
        self.send(Heartbeat(1, 0, 0, OURS), sequence=0)
        status = self.said[-1][1]
        assert isinstance(status, Status)
        return status

    def latch(self) -> Latch:
        """As it tells anybody who asks."""
        self.send(Query(), client=STRANGER, sequence=0)
        return next(m for to, m in self.said[::-1] if to == STRANGER and isinstance(m, Latch))

    def holder(self) -> Holder:
        self.send(Query(), client=STRANGER, sequence=0)
        return next(m for to, m in self.said[::-1] if to == STRANGER and isinstance(m, Holder))

    def configure(self, what: Trial) -> Any:
        self.send(Hello(2, 2, OURS, "ada"))
        self.beat()
        bodies = []
        for message in parameter_messages(configuration_of(what)):
            bodies.append(encode(message)[1])
            assert isinstance(self.send(message), Ack)
        return self.send(Arm(configuration_crc(bodies)))

    def start(self, what: Trial | None = None) -> None:
        assert isinstance(self.configure(what or trial()), Ack)
        armed = self.controller.machine._armed
        assert armed is not None
        deadline = time.monotonic() + 60.0
        while not (armed.producer.finished or armed.producer.available >= AHEAD):
            assert time.monotonic() < deadline
            time.sleep(0.001)
        assert isinstance(self.send(Start(9)), Ack)
        self.controller.tick()

    def go_on(self, seconds: float, *, beating: bool = True, step: float = 0.02) -> None:
        for _ in range(round(seconds / step)):
            self.time += step
            if beating:
                self.beat()
            self.controller.tick()

    def records(self) -> list[Samples | Event | End]:
        return [m for _, m in self.said if isinstance(m, Samples | Event | End)]

    def samples(self) -> int:
        return sum(m.count for m in self.records() if isinstance(m, Samples))

    def end(self) -> End:
        (end,) = [m for m in self.records() if isinstance(m, End)]
        return end


def test_a_trial_equals_the_simulated_one_to_the_bit() -> None:
    rig, what = Rig(), trial()
    rig.start(what)
    rig.go_on(1.2)
    assert rig.end().outcome is Outcome.COMPLETED
    assert rig.end().samples == 1000
    recorder = MemoryRecorder()
    recording = recorder.recording(SimBackend(SimOptions()).execute(what, recorder, lambda: False))
    (channels,) = [m for _, m in rig.said if isinstance(m, Channels)]
    data = b"".join(m.data for m in rig.records() if isinstance(m, Samples))
    streamed = np.frombuffer(data, "<f8").reshape(-1, channels.total)
    expected = np.stack([recording[each.name] for each in channels.channels], axis=1)
    assert streamed.tobytes() == expected.tobytes()


@pytest.mark.parametrize("speed", [1.0, 20.0])
def test_samples_come_in_step_with_the_clock_however_irregularly_it_is_looked_at(
    speed: float,
) -> None:
    rig = Rig(speed=speed)
    rig.start(trial(duration=10.0))
    began = rig.time
    for step in (0.013, 0.0007, 0.031, 0.05, 0.0333, 0.02) * 2:
        rig.time += step
        rig.beat()
        rig.controller.tick()
        due = math.floor((rig.time - began) * speed * RATE + 1e-6) + 1
        assert due - 11 < rig.samples() <= due  # a record is not sent before it is whole


def test_at_unlimited_speed_nothing_runs_further_ahead_than_the_window() -> None:
    rig = Rig(speed=math.inf)
    rig.start(trial(duration=20.0))
    assert rig.controller.machine.ring.used == 1024
    rig.send(Heartbeat(2, 9, 24, OURS), sequence=0)
    rig.controller.tick()
    assert rig.controller.machine.ring.first == 24
    assert rig.controller.machine.ring.next == 1048


def test_silence_switches_off_and_says_so() -> None:
    rig = Rig()
    rig.start()
    rig.go_on(0.08, beating=False)
    assert rig.controller.state is State.RUNNING
    rig.go_on(0.04, beating=False)
    assert rig.controller.state is State.FAULT
    assert not rig.controller.status().drive_on
    rig.go_on(0.1, beating=False)
    assert (rig.end().outcome, rig.end().fault) == (Outcome.FAULT, Fault.HEARTBEAT)
    assert rig.end().safe
    assert rig.controller.status().at_rest


def test_stop_keeps_what_was_streamed() -> None:
    rig = Rig()
    rig.start()
    rig.go_on(0.5)
    assert isinstance(rig.send(Stop()), Ack)
    rig.go_on(0.2)
    assert rig.controller.state is State.ENDED
    assert rig.end().outcome is Outcome.INTERRUPTED
    assert rig.end().samples == rig.samples() > 400


def test_safe_is_obeyed_from_anybody() -> None:
    rig = Rig()
    rig.start()
    rig.send(Safe(), client=STRANGER, sequence=7)
    assert rig.controller.state is State.SAFE
    assert not rig.controller.status().drive_on
    assert [type(m) for to, m in rig.said if to == STRANGER] == [Ack, Status]
    rig.go_on(0.1)
    assert rig.end().safe
    assert isinstance(rig.send(Clear()), Ack)
    assert rig.controller.state is State.IDLE


def test_a_stranger_commands_nothing_else() -> None:
    rig = Rig()
    rig.start()
    assert rig.send(Stop(), client=STRANGER).code is NakCode.BUSY
    assert rig.send(Hello(2, 2, THEIRS), client=STRANGER).code is NakCode.BUSY
    rig.go_on(0.04)
    assert rig.controller.state is State.RUNNING


def test_a_repeated_command_is_answered_and_not_carried_out() -> None:
    rig = Rig()
    rig.start()
    rig.go_on(0.1)
    streamed = rig.controller.machine.ring.next
    assert isinstance(rig.send(Start(9), sequence=rig.sequence), Ack)
    assert rig.controller.machine.ring.next == streamed > 0


def test_records_are_had_again_until_they_are_released() -> None:
    rig = Rig()
    rig.start()
    rig.go_on(1.2)
    sent = rig.records()
    rig.said.clear()
    rig.send(Resend(9, 3, 4), sequence=0)
    assert rig.records() == sent[3:7]
    rig.send(Heartbeat(3, 9, 5, OURS), sequence=0)
    rig.said.clear()
    rig.send(Resend(9, 3, 4), sequence=0)
    assert rig.said[0][1] == LostRecords(9, 3, 2)
    assert rig.records() == sent[5:7]
    rig.said.clear()
    rig.send(Resend(8, 3, 4), sequence=0)
    assert [said[1] for said in rig.said] == [
        LostRecords(8, 3, 4)
    ]  # of another trial nothing is held
    assert rig.send(Release(8)).code is NakCode.WRONG_TRIAL
    assert isinstance(rig.send(Release(9)), Ack)
    assert rig.controller.state is State.IDLE


def test_what_breaks_a_limit_is_not_armed() -> None:
    nak = Rig().configure(trial(amplitude=50.0))
    assert nak.code is NakCode.LIMIT
    assert nak.state is State.CONFIGURED


def test_parameters_that_arrived_otherwise_are_not_armed() -> None:
    rig = Rig()
    rig.configure(trial())
    rig.send(Clear())
    rig.send(parameter_messages(configuration_of(trial()))[0])
    assert rig.send(Arm(1)).code is NakCode.CHECKSUM


@pytest.mark.parametrize(
    ("fault", "code"),
    [
        ("over-temperature@time=0.2", Fault.OVER_TEMPERATURE),
        ("limit-switch@time=0.2", Fault.LIMIT_SWITCH),
        ("sensor=gyro_rate@time=0.1", Fault.SENSOR),
    ],
)
def test_a_fault_on_demand_ends_the_trial_at_its_time(fault: str, code: Fault) -> None:
    rig = Rig(fault)
    rig.start()
    rig.go_on(0.5)
    assert rig.controller.state is State.FAULT
    assert (rig.end().fault, rig.end().samples) == (code, 200)
    assert rig.end().safe


def test_a_stuck_sensor_shows_one_value_until_it_is_noticed() -> None:
    rig = Rig("sensor=gyro_rate@time=0.1")
    rig.start()
    rig.go_on(0.5)
    data = b"".join(m.data for m in rig.records() if isinstance(m, Samples))
    gyro = np.frombuffer(data, "<f8").reshape(200, -1)[:, 2]
    assert len(set(gyro[:100])) > 90
    assert len(set(gyro[100:])) == 1


def test_a_reboot_forgets_everything_but_which_trial_comes_next() -> None:
    rig = Rig("reboot@trial=1@time=0.2")
    rig.start()
    boot = rig.controller.status().boot
    rig.go_on(0.3)
    status = rig.controller.status()
    assert (status.state, status.ring_used, status.trial) == (State.IDLE, 0, 0)
    assert status.boot != boot
    assert rig.send(Stop()).code is NakCode.OUT_OF_ORDER  # no session
    rig.start()
    rig.go_on(1.2)
    assert rig.end().outcome is Outcome.COMPLETED
