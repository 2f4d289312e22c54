"""The rehearsal controller and the reference in C: the same frames, the same answers."""

from __future__ import annotations

import itertools
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from campaign import recording
from campaign.device import controller as rehearsal
from campaign.device import latch as memory
from campaign.device.machine import Setup
from campaign.device.ring import Ring
from campaign.protocol.bench_file import load_bench
from campaign.wire import messages as wire
from campaign.wire.frames import Frame, encode_frame

from .console import Console
from .host import CRC, OTHERS, OURS, SETS, TRIAL, hello
from .test_scripts import A_TRIAL, COMMAND, LATEST, PAST, RECORDS, TIMEOUT

BENCH = load_bench("platform")
RAW = st.sampled_from(
    [
        (wire.Kind.HELLO, b"\x02\x02" + bytes(4) + b"\x04host"), (wire.Kind.HELLO, b"\x02"),
        (wire.Kind.HELLO, b"\x01\x01\x2a\0\0\0\x04host"),
        (wire.Kind.HELLO, b"\x03\x09\x2b\0\0\0\0"),
        (wire.Kind.SAFE, b"\x2a\0\0\0"), (wire.Kind.SAFE, b"\x2a\0\0"),
        (wire.Kind.SAFE, b"\x2b\0\0\0\x01\xff"), (wire.Kind.UNLATCH, b"\0\0\0\0"),
        (wire.Kind.HEARTBEAT, bytes(12)), (wire.Kind.QUERY, b"?"), (wire.Kind.BYE, bytes(4)),
        (wire.Kind.START, bytes(4)), (wire.Kind.SET, b"\0"), (0x3F, b""), (0xBF, b""),
        (wire.Kind.RESEND, wire.encode(wire.Resend(TRIAL, 0, 2))[1]),
        (wire.Kind.RESEND, wire.encode(wire.Resend(0, 0, 2))[1]),
    ]
)  # fmt: skip
INTERESTING = st.sampled_from(
    [wire.Safe(), wire.Safe(OTHERS, "eve"), LATEST, hello(), hello(OTHERS, "eve"), wire.Bye(OURS)]
)
STEP = st.one_of(
    st.tuples(st.just("send"), COMMAND, st.sampled_from(["next"] * 8 + ["same", "same", "far"])),
    st.tuples(st.just("raw"), RAW, st.sampled_from(["next", "same"])),
    st.tuples(st.just("try")),
    st.tuples(st.just("send"), INTERESTING, st.just("next")),
    st.tuples(st.just("wait"), st.sampled_from([1000, TIMEOUT - 1, TIMEOUT + 1])),
    st.tuples(st.just("memory"), st.booleans()),
    st.tuples(st.just("finish"), st.sampled_from(wire.Outcome)),
    st.sampled_from([("reset",), ("reset",), ("wipe",)]),
)
GREETED: list[tuple] = [("send", hello(), "next")]
STEPS = st.builds(
    list.__add__,
    st.sampled_from([[], GREETED, GREETED, [*GREETED, ("try",)]]),
    st.lists(STEP, max_size=25),
)
PLACES = itertools.count()


class Axis:
    """In place of the simulated one: it stops at once, and takes no samples."""

    def __init__(self, emit) -> None:
        self.ring, self._emit = Ring(RECORDS), emit
        self.winding = SimpleNamespace(celsius=25.0)
        self.outcome: recording.Outcome | None = None
        self.drive_on = False
        self._ending: recording.Ending | None = None

    at_rest = True

    def refuses(self, trial: object) -> None:
        """Nothing."""

    def arm(self, trial: object) -> tuple[wire.Channel, ...]:
        return (wire.Channel("gyro_rate", "rad/s", "deg/s", "Rate of the load"),)

    def start(self, number: int) -> None:
        self.ring.begin(number)
        self.drive_on, self.outcome = True, None

    def switch_off(self, ending: recording.Ending, *, told: bool = False) -> None:
        if self.drive_on:
            self.drive_on, self._ending = False, ending

    def drop(self) -> None:
        self.drive_on, self._ending = False, None

    def tick(self) -> list[object]:
        if self._ending is not None:
            ending, self._ending = self._ending, None
            outcome = wire.Outcome[ending.outcome.name]
            fault = wire.Fault[ending.fault.name] if ending.fault else wire.Fault.NONE
            end = wire.End(self.ring.trial, self.ring.next, outcome, fault, 0, True, ending.reason)
            self.ring.add(end)
            self._emit(end)
            self.outcome = ending.outcome
        return []


class Rehearsal:
    """The controller as a device on one line, with a clock and a memory that obey the test."""

    def __init__(self, console: Console, file: Path | None) -> None:
        self._said: list[wire.Message] = []
        setup = Setup(BENCH, now=lambda: 100.0 + console.now / 1e6, latch_file=file)
        self.controller = rehearsal.Controller(setup, lambda to, what: self._said.append(what))
        self.controller.machine = Axis(self.controller._emit)  # type: ignore[assignment]

    def receive(self, kind: int, sequence: int, body: bytes) -> list[wire.Message]:
        self.controller.handle(1, Frame(kind, sequence, body))
        return self.tick()

    def tick(self) -> list[wire.Message]:
        self.controller.tick()
        said, self._said[:] = list(self._said), []
        return said

    def finish(self, outcome: wire.Outcome) -> list[wire.Message]:
        if outcome is wire.Outcome.FAULT:
            self.controller._fail(recording.Fault.DRIVE, "")
        else:
            self.controller.machine.switch_off(
                recording.Ending(recording.Outcome[outcome.name], "")
            )
        return self.tick()

    def reset(self) -> None:
        self.controller._switch_on()


def essence(found: list[wire.Message], *, repeated: bool = False) -> list[object]:
    """What both must say, in both's order; a STATUS more or less at a change of state is neither's.

    The state in the answer to a repetition may be that of then or of now.
    """
    said: list[object] = []
    for message in found:
        match message:
            case wire.Ack():
                said.append(("ack", message.kind, message.sequence, repeated or message.state))
                said.append(message.boot)
            case wire.Nak():
                said.append(("nak", message.kind, message.sequence, message.code))
                said.append((repeated or message.state, message.name))
                if message.code in (wire.NakCode.BUSY, wire.NakCode.LATCHED):
                    said.append(message.text)
            case wire.Capabilities():
                said.append((message.sequence, message.version, message.boot, message.state))
                said.append((message.lowest, message.highest, message.heartbeat_timeout))
            case wire.Latch():  # since when outlives a reset in one of them only
                said.append((message.latched, message.count, message.cause, message.by))
            case wire.Holder():
                said.append((message.held, message.age and round(message.age, 6), message.host))
            case wire.End():
                ours = message.reason.startswith(("panic stop", "switched off"))
                said.append((message.number, message.outcome, message.safe))
                said.append(message.reason if ours else "")
            case wire.LostRecords():
                said.append(message)
    return said


def facts(status: wire.Status) -> tuple[object, ...]:
    return (
        status.state, status.at_rest, status.drive_on, status.boot, status.heartbeat, status.trial,
        status.first_record, status.next_record,
    )  # fmt: skip


class Pair:
    """Both devices; whatever is done is done to both, and compared."""

    def __init__(self, console: Console, folder: Path, past: str) -> None:
        self.console, self.sequence = console, 0
        console.do("new", RECORDS, *past.split())
        console.now = 0
        self.file = None if past == "forgetful" else folder / f"latch-{next(PLACES)}"
        if self.file is not None:
            cause = wire.LatchCause.STOPPED if past else wire.LatchCause.NONE
            count, by = (3, "ada") if past else (0, "")
            stop = memory.Stop(latched=bool(past), count=count, cause=cause, by=by, at=None)
            self.file.write_text(stop.model_dump_json(), encoding="utf-8")
        self.python = Rehearsal(console, self.file)

    def send(self, kind: int, body: bytes, turn: str) -> None:
        if kind in wire.COMMANDS or kind == 0x3F:
            self.sequence = (self.sequence + {"next": 1, "same": 0, "far": 7}[turn]) % 2**16
        frame = encode_frame(kind, self.sequence, body)
        in_c = self.console.messages("receive", self.console.now, frame.hex())
        in_python = self.python.receive(kind, self.sequence, body)
        repeated = turn == "same"
        assert essence(in_python, repeated=repeated) == essence(in_c, repeated=repeated)

    def step(self, step: tuple) -> None:
        console = self.console
        if step[0] == "send":
            latest = wire.Unlatch(self.python.controller._latch.stop.count, "ada")
            self.send(*wire.encode(latest if step[1] is LATEST else step[1]), step[2])
        elif step[0] == "raw":
            self.send(*step[1], step[2])
        elif step[0] == "try":
            for message in A_TRIAL:
                self.send(*wire.encode(message), "next")
        elif step[0] == "wait":
            in_c = console.wait(step[1])
            assert essence(self.python.tick()) == essence(in_c)
        elif step[0] == "finish":
            in_c = console.messages("finish", int(step[1]), int(wire.Fault.DRIVE), "-")
            assert essence(self.python.finish(step[1])) == essence(in_c)
        elif step[0] == "memory":
            console.do("memory", int(step[1]))
            Breakable.works = step[1]
        else:
            console.do(step[0])
            if step[0] == "wipe" and self.file is not None:
                self.file.unlink(missing_ok=True)
            self.python.reset()

    def compare(self) -> None:
        body = wire.encode(wire.Query())[1]
        frame = encode_frame(wire.Kind.QUERY, 0, body)
        in_c = self.console.messages("receive", self.console.now, frame.hex())
        in_python = self.python.receive(wire.Kind.QUERY, 0, body)
        assert essence(in_python) == essence(in_c)
        assert isinstance(in_c[0], wire.Status)
        assert isinstance(in_python[0], wire.Status)
        assert facts(in_python[0]) == facts(in_c[0])


class Breakable:
    """A memory that can be made to fail; it does not wait for the disk."""

    works = True

    @classmethod
    def write(cls, file: Path, text: str) -> None:
        if not cls.works:
            raise OSError(28, "no space left on device")
        file.write_text(text, encoding="utf-8")


@pytest.fixture
def stand_ins(monkeypatch: pytest.MonkeyPatch) -> None:
    """What keeps the controller from simulating a trial, and from random numbers."""
    monkeypatch.setattr(memory, "write_atomically", Breakable.write)
    armed = SimpleNamespace(task=SimpleNamespace(sample_rate=1000.0))
    monkeypatch.setattr(rehearsal, "make_trial", lambda bench, parameters: armed)
    monkeypatch.setattr(rehearsal, "secrets", Boots)


class Boots:
    """Counts as the console does."""

    boot = 6

    @classmethod
    def randbits(cls, count: int) -> int:
        cls.boot += 1
        return cls.boot


@pytest.mark.slow
@settings(
    max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(past=PAST, steps=STEPS)
@example(past="", steps=[("send", SETS[0], "next")])  # nobody has said HELLO
@example(  # a stop since, then the same UNLATCH again
    past="latched 3",
    steps=[
        ("send", hello(), "next"), ("send", LATEST, "next"),
        ("raw", (wire.Kind.SAFE, b""), "same"),
        ("send", wire.Unlatch(3, "ada"), "same"),
    ],
)  # fmt: skip
@example(  # somebody's malformed HELLO, then the last command again
    past="",
    steps=[
        ("send", hello(), "next"), ("send", SETS[0], "next"),
        ("raw", (wire.Kind.HELLO, b""), "same"), ("send", SETS[0], "same"),
    ],
)  # fmt: skip
@example(  # a heartbeat beyond what exists frees nothing
    past="",
    steps=[
        ("send", hello(), "next"), *(("send", message, "next") for message in A_TRIAL),
        ("send", wire.Stop(), "next"),
        ("raw", (wire.Kind.HEARTBEAT, wire.encode(wire.Heartbeat(7, TRIAL, 99, 42))[1]), "same"),
    ],
)  # fmt: skip
@example(  # a stop that could be remembered only later outlives a reset
    past="",
    steps=[
        ("memory", False), ("send", wire.Safe(0, ""), "next"), ("memory", True), ("reset",),
    ],
)  # fmt: skip
@example(past="", steps=[("raw", (wire.Kind.RESEND, wire.encode(wire.Resend(0, 0, 2))[1]), "same")])
def test_the_same_frames_have_the_same_answers(
    console: Console, tmp_path: Path, stand_ins: None, past: str, steps: list[tuple]
) -> None:
    assert wire.configuration_crc([wire.encode(SETS[0])[1]]) == CRC
    Boots.boot, Breakable.works = 6, True
    pair = Pair(console, tmp_path, past)
    pair.compare()
    for step in steps:
        pair.step(step)
        pair.compare()
