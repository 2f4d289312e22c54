"""The whole controller, across a real byte stream: the server in a thread, a host by hand."""

from __future__ import annotations

import math
import shutil
import socket
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from campaign.device.faults import parse_faults
from campaign.device.latch import new_memory
from campaign.device.line import TcpLine
from campaign.device.machine import Setup
from campaign.device.server import Server
from campaign.errors import UsageError
from campaign.physics.bench import Bench
from campaign.protocol.bench_file import load_bench
from campaign.signals import Sine
from campaign.trial import Task, Trial
from campaign.wire.codes import Fault, Outcome, State
from campaign.wire.configuration import configuration_of
from campaign.wire.device import Ack, Capabilities, End, Event, Nak, Samples, Status
from campaign.wire.frames import FrameDecoder, encode_frame
from campaign.wire.host import Arm, Heartbeat, Hello, Release, Resend, Safe, Start
from campaign.wire.messages import Message, configuration_crc, decode, encode, parameter_messages

BENCH = load_bench("platform")
TASK = Task(
    mode="rate",
    command=Sine(amplitude=0.2, frequency=1.0),
    duration=0.6,
    window=(0.0, 0.6),
    sample_rate=1000.0,
)
TRIAL = Trial(number=1, test="t", kind="k", seed=7, bench=BENCH.model_dump(mode="json"), task=TASK)


@contextmanager
def serving(
    *faults: str, speed: float = math.inf, timeout: float = 5.0, bench: Bench = BENCH
) -> Iterator[Callable[[], Host]]:
    line = TcpLine("127.0.0.1:0")
    wanted = parse_faults(faults)
    folder = tempfile.mkdtemp()
    new_memory(Path(folder) / "latch")
    setup = Setup(bench, speed, latch_file=Path(folder) / "latch")
    server = Server(line, setup, timeout=timeout, faults=wanted, fault_seed=3)
    thread = threading.Thread(target=server.serve)
    thread.start()
    port = int(line.name.rpartition(":")[2])
    hosts: list[Host] = []

    def connect() -> Host:
        hosts.append(Host(port))
        return hosts[-1]

    try:
        yield connect
    finally:
        for host in hosts:
            host.socket.close()
        server.stop()
        thread.join(20.0)
        assert not thread.is_alive()
        shutil.rmtree(folder)


class Host:
    def __init__(self, port: int) -> None:
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=20.0)
        self.decoder = FrameDecoder()
        self.heard: list[Message] = []
        self.sequence = 65530  # it wraps
        self.beats = 0

    def send(self, message: Message, sequence: int = 0) -> None:
        kind, body = encode(message)
        self.socket.sendall(encode_frame(kind, sequence, body))

    def until(self, wanted: Callable[[Any], bool]) -> Any:
        """The first message heard, or yet to come, that is wanted."""
        while True:
            for index, message in enumerate(self.heard):
                if wanted(message):
                    return self.heard.pop(index)
            data = self.socket.recv(65536)
            assert data
            self.heard += [decode(f.kind, f.body) for f in self.decoder.feed(data)]

    def command(self, message: Message) -> Any:
        self.sequence = (self.sequence + 1) % 2**16
        self.send(message, self.sequence)
        return self.until(
            lambda m: isinstance(m, Ack | Nak | Capabilities) and m.sequence == self.sequence
        )

    def beat(self, trial: int = 0, wanted: int = 0) -> Status:
        self.beats += 1
        self.send(Heartbeat(self.beats, trial, wanted, 77))
        status: Status = self.until(lambda m: isinstance(m, Status) and m.heartbeat == self.beats)
        return status

    def start(self, trial: Trial = TRIAL) -> None:
        self.command(Hello(2, 2, 77))
        bodies = []
        for message in parameter_messages(configuration_of(trial)):
            bodies.append(encode(message)[1])
            assert isinstance(self.command(message), Ack)
        self.beat()
        assert isinstance(self.command(Arm(configuration_crc(bodies))), Ack)
        assert isinstance(self.command(Start(3)), Ack)


def test_configure_arm_start_stream_resend_release() -> None:
    with serving() as connect:
        host = connect()
        host.start()
        end = host.until(lambda m: isinstance(m, End))
        assert (end.outcome, end.samples, end.safe) == (Outcome.COMPLETED, 600, True)
        first = host.until(lambda m: isinstance(m, Samples) and m.number == 0)
        host.send(Resend(3, 0, 1))
        assert host.until(lambda m: isinstance(m, Samples) and m.number == 0) == first
        assert host.command(Release(3)).state is State.IDLE


def test_an_axis_that_turns_for_ever_has_no_limit_of_angle_on_the_line() -> None:
    limits = BENCH.limits.model_copy(update={"angle": math.inf})
    bench = BENCH.model_copy(update={"limits": limits})
    trial = TRIAL.model_copy(update={"bench": bench.model_dump(mode="json")})
    with serving(bench=bench) as connect:
        host = connect()
        told = host.command(Hello(2, 2, 77))
        assert {item.name for item in told.limits} >= {"limits.rate", "limits.torque"}
        assert "limits.angle" not in {item.name for item in told.limits}
        host.start(trial)
        end = host.until(lambda m: isinstance(m, End))
        assert (end.outcome, end.samples) == (Outcome.COMPLETED, 600)


def test_heartbeats_that_stop_lead_to_drive_off_and_standstill() -> None:
    with serving(speed=1.0, timeout=0.2) as connect:
        host = connect()
        host.start()
        end = host.until(lambda m: isinstance(m, End))
        assert (end.outcome, end.fault, end.safe) == (Outcome.FAULT, Fault.HEARTBEAT, True)
        host.heard.clear()
        status = host.beat()
        assert (status.state, status.drive_on, status.at_rest) == (State.FAULT, False, True)


def test_a_panic_stop_works_while_another_host_has_the_line() -> None:
    with serving(speed=0.01, timeout=30.0) as connect:
        host, panic = connect(), connect()
        host.start()
        panic.send(Safe())
        assert panic.until(lambda m: isinstance(m, Ack)).state is State.SAFE
        assert host.until(lambda m: isinstance(m, Status) and m.state is State.SAFE)


def test_lost_blocks_can_be_had_again() -> None:
    with serving("lost-blocks=0.2") as connect:
        host = connect()
        host.start()
        while (status := host.beat(3)).state is State.RUNNING:
            pass
        records: dict[int, Message] = {}
        while len(records) < status.next_record:
            for number in set(range(status.next_record)) - records.keys():
                host.send(Resend(3, number, 1))
            host.beat(3)
            for message in host.heard:
                if isinstance(message, Samples | Event | End):
                    records[message.number] = message
            host.heard.clear()
        assert sum(m.count for m in records.values() if isinstance(m, Samples)) == 600


def test_an_address_that_is_none_is_refused() -> None:
    with pytest.raises(UsageError, match="HOST:PORT"):
        TcpLine("4000")
