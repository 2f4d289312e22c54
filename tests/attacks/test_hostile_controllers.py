"""Controllers that announce channels that cannot be, on a line that is only played.

No byte goes over a line: the fake answers what is written to it at once, frame by frame, also with
bodies that this program would not send.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest

from campaign.archive.layout.run_status import RunStatus
from campaign.errors import ExitCode
from campaign.recording import Outcome, SafeState
from campaign.wire.fields import Writer
from campaign.wire.frames import Frame, FrameDecoder, encode_frame
from campaign.wire.messages import (
    VERSION,
    Ack,
    Capabilities,
    Channel,
    End,
    Event,
    Format,
    Kind,
    Latch,
    LatchCause,
    Message,
    NakCode,
    Samples,
    Set,
    State,
    Status,
    decode,
    encode,
)
from campaign.wire.messages import Fault as FaultCode
from campaign.wire.messages import Nak as Refusal
from campaign.wire.messages import Outcome as OutcomeCode
from tests.attacks.laboratory import Done, Here
from tests.attacks.test_hostile_backends import seldom

FAULT, USAGE, DONE = ExitCode.LIMIT_OR_FAULT, ExitCode.USAGE, ExitCode.DONE
GOOD = 0.01
RATE = 100.0
CHANNELS = (
    Channel("relative_rate", "rad/s", "deg/s", "Rate"),
    Channel("relative_angle", "rad", "deg", "Angle"),
    Channel("temperature", "degC", "degC", "Temperature"),
)
ESC = "nul \0 esc \x1b[2J\x1b]0;owned\a \r\x7f\x9b1m turned \u202e end"
LONE = "\ud800"


def first(**changes: Any) -> tuple[Channel, ...]:
    """The channels, the first one with changes."""
    return (replace(CHANNELS[0], **changes), *CHANNELS[1:])


@dataclass
class Hostile:
    """What a controller does otherwise than a good one.

    Attributes:
        channels: as announced; texts need not be UTF-8, nor formats known.
        total: how many there are said to be.
        rate: of the recording (Hz).
        value: of every channel, before its scale.
        capabilities: of it, changed.
        records: in place of the good ones; of the number of samples.
        refusal: of every ARM.
        latch: as it tells of it.
    """

    channels: Sequence[Channel] = CHANNELS
    total: int | None = None
    rate: float = RATE
    value: float = GOOD
    capabilities: dict[str, Any] = field(default_factory=dict)
    records: Callable[[int], list[Message]] | None = None
    refusal: str = ""
    latch: Latch = field(default_factory=lambda: Latch(False, 0, LatchCause.NONE, None))


def text(writer: Writer, told: str) -> None:
    data = told.encode("utf-8", "surrogatepass")
    writer.number("B", len(data)).data(data)


def announced(sequence: int, hostile: Hostile) -> bytes:
    """The body of CHANNELS, whatever stands in it."""
    writer = Writer()
    total = len(hostile.channels) if hostile.total is None else hostile.total
    writer.number("H", sequence).number("B", total).number("B", 0).number("d", hostile.rate)
    writer.number("B", len(hostile.channels))
    for channel in hostile.channels:
        for told in (channel.name, channel.unit, channel.display_unit, channel.label):
            text(writer, told)
        writer.number("B", channel.measured).number("B", channel.format)
        writer.number("d", channel.scale)
    return writer.done()


class Controller:
    """Stands in for the connection, with the controller at its other end.

    Attributes:
        heard: kinds of the commands that came, in order.
    """

    def __init__(self, hostile: Hostile) -> None:
        self.hostile = hostile
        self.heard: list[Kind] = []
        self.beats: dict[int, float] = {}
        self._state, self._trial, self._made, self._duration = State.IDLE, 0, 0, 0.0
        self._decoder = FrameDecoder()
        self._waiting = bytearray()

    def open(self, port: str, baud: int, session: int) -> Controller:
        return self

    def write(self, data: bytes) -> None:
        for frame in self._decoder.feed(data):
            self._take(frame)

    def receive(self, timeout: float) -> bytes:
        if not self._waiting and timeout > 0:
            time.sleep(0.002)
            self._say(self._status())  # as if a heartbeat had come
        data = bytes(self._waiting)
        self._waiting.clear()
        return data

    def wanted(self, trial: int, record: int, *, at_once: bool = False) -> None: ...

    def holds(self, *, held: bool) -> None: ...

    def close(self, *, last_words: bool = True) -> None: ...

    def _say(self, message: Message) -> None:
        kind, body = encode(message)
        self._waiting += encode_frame(kind, 0, body)

    def _status(self) -> Status:
        return Status(
            self._state, FaultCode.NONE, True, False, 1, 0.0, 0, 0.0, self._trial, 0, self._made, 0
        )

    def _take(self, frame: Frame) -> None:
        kind, message = Kind(frame.kind), decode(frame.kind, frame.body)
        self.heard.append(kind)
        if kind is Kind.HELLO:
            good: dict[str, Any] = {"name": "fake", "features": ("rate", "torque")}
            told = {**good, **self.hostile.capabilities}
            self._say(
                Capabilities(
                    frame.sequence, VERSION, VERSION, VERSION, 1, self._state, 0.1, 16, 4096, 1e5,
                    **told,
                )
            )  # fmt: skip
        elif kind is Kind.QUERY:
            self._say(self._status())
            self._say(self.hostile.latch)
        elif kind is Kind.ARM and self.hostile.refusal:
            told = self.hostile.refusal
            self._say(Refusal(frame.sequence, kind, NakCode.NOT_READY, self._state, told, told))
        elif kind not in (Kind.RESEND, Kind.BYE, Kind.HEARTBEAT):
            self._obey(kind, frame.sequence, message)

    def _obey(self, kind: Kind, sequence: int, message: Any) -> None:
        after = {
            Kind.SET: State.CONFIGURED, Kind.ARM: State.ARMED, Kind.START: State.ENDED,
            Kind.STOP: State.ENDED, Kind.RELEASE: State.IDLE, Kind.CLEAR: State.IDLE,
            Kind.SAFE: State.SAFE,
        }  # fmt: skip
        self._state = after.get(kind, self._state)
        if isinstance(message, Set):
            found = {item.name: item.value for item in message.items}
            self._duration = float(found.get("task.duration", self._duration))
        if kind is Kind.ARM:
            body = announced(sequence, self.hostile)
            self._waiting += encode_frame(Kind.CHANNELS, 0, body)
        self._say(Ack(sequence, kind, self._state, 1))
        if kind is Kind.START:
            self._trial = message.trial
            count = int(self._duration * RATE)
            records = (self.hostile.records or self._good)(count)
            self._made = len(records)
            for record in records:
                self._say(replace(record, trial=self._trial))
        if kind in (Kind.SAFE, Kind.CLEAR):
            self._say(self._status())

    def _good(self, count: int) -> list[Message]:
        return spread(count, self.hostile.channels, self.hostile.value)


FORMATS = {Format.I16: "<i2", Format.I32: "<i4", Format.F32: "<f4"}
AT_A_TIME = 20
"""Samples in a record: a frame has to hold them."""


def spread(
    count: int, channels: Sequence[Channel] = CHANNELS, value: float = GOOD
) -> list[Message]:
    """Records of a good trial of so many samples."""
    kinds = [(f"c{n}", FORMATS.get(c.format, "<f8")) for n, c in enumerate(channels[:5])]
    made: list[Message] = []
    for begin in range(0, count, AT_A_TIME):
        rows = np.zeros(min(AT_A_TIME, count - begin), np.dtype(kinds))
        for name, _ in kinds:
            rows[name] = value
        made.append(Samples(1, len(made), begin, len(rows), rows.tobytes()))
    return [*made, ended(count, number=len(made))]


def ended(count: int, reason: str = "", number: int = 1, **changes: Any) -> End:
    told = {"outcome": OutcomeCode.COMPLETED, "fault": FaultCode.NONE, "safe": True, **changes}
    return End(1, number, samples=count, reason=reason, **told)


@dataclass
class Met:
    """What came of a run on a hostile controller."""

    done: Done
    controller: Controller


@pytest.fixture
def met(here: Here, monkeypatch: pytest.MonkeyPatch) -> Callable[[Hostile], Met]:
    def run(hostile: Hostile) -> Met:
        controller = Controller(hostile)
        monkeypatch.setattr("campaign.backends.serial.Connection", controller.open)
        patience = ("--set", 'backend.silence="0.5 s"')
        words = ("run", "moves.toml", "--backend", "serial", "--port", "fake", "--yes", *patience)
        return Met(here.campaign(*words, backend="serial"), controller)

    return run


def test_a_good_one_is_a_good_one(met: Callable[[Hostile], Met]) -> None:
    done = met(Hostile()).done.ended(DONE).sealed()
    assert done.run.status is RunStatus.COMPLETE
    assert done.run.trials[1].recording()["relative_rate"] == pytest.approx(GOOD)


@pytest.mark.parametrize(
    ("channels", "word"),
    [
        (first(name="relative_angle"), "relative_angle"),
        ((*CHANNELS, *CHANNELS), "relative_rate"),
        (first(name=""), ""),
        (first(name="a/b"), "a/b"),
        seldom(first(name=".."), ".."),
        (first(name=ESC), ""),
        seldom(first(name="\0"), ""),
        (first(name=LONE), ""),
        seldom(first(label=LONE), ""),
        (first(unit="furlong"), "furlong"),
        (first(unit="A"), "relative_rate"),
        (first(unit=ESC), "relative_rate"),
        seldom(first(unit=""), "relative_rate"),
        seldom(first(unit="rad"), "relative_rate"),
        ((*CHANNELS[:2], replace(CHANNELS[2], unit="K")), "temperature"),
        (first(format=9), ""),
        seldom(first(format=0), ""),
        seldom(first(scale=float("nan")), ""),
        seldom(first(scale=float("inf")), ""),
        ((), ""),
    ],
)
def test_channels_that_cannot_be_are_a_fault_before_anything_moves(
    met: Callable[[Hostile], Met], channels: tuple[Channel, ...], word: str
) -> None:
    """Names that are no names, and one twice, were exit code 70."""
    one_fault(met(Hostile(channels)), word)


def one_fault(found: Met, word: str) -> None:
    """No START was sent, no sample archived; the bench was seen safe."""
    done = found.done.ended(FAULT).sealed()
    assert Kind.START not in found.controller.heard
    ended = done.run.trials[0]
    assert ended.ending.outcome is Outcome.FAULT
    assert word in ended.ending.reason
    assert len(ended.recording().time) == 0
    assert done.run.safe_state is SafeState.CONFIRMED


@pytest.mark.parametrize(
    "hostile",
    [
        Hostile(total=200),
        seldom(Hostile(total=1)),
        seldom(Hostile(rate=0.0)),
        seldom(Hostile(rate=float("nan"))),
        Hostile(rate=1000.0),
        Hostile(refusal=ESC),
    ],
    ids=["more-to-come", "beyond-total", "no-rate", "nan-rate", "other-rate", "refused"],
)
def test_nor_does_it_move_when_arming_goes_wrong(
    met: Callable[[Hostile], Met], hostile: Hostile
) -> None:
    one_fault(met(hostile), "")


@pytest.mark.parametrize(("unit", "value"), [("deg/s", 30.0), seldom("rpm", 5.0)])
def test_a_rate_in_degrees_is_never_taken_for_one_in_radians(
    met: Callable[[Hostile], Met], unit: str, value: float
) -> None:
    """Converted and said, or refused."""
    channels = first(unit=unit, scale=value / GOOD)
    found = met(Hostile(channels))
    if found.done.code == FAULT:
        one_fault(found, unit)
        return
    done = found.done.ended(DONE).sealed()
    recording = done.run.trials[0].recording()
    factor = {"deg/s": np.pi / 180, "rpm": np.pi / 30}[unit]
    assert recording.channels["relative_rate"].unit == "rad/s"
    assert recording["relative_rate"] == pytest.approx(value * factor, rel=1e-12)
    assert any(unit in event.text for event in recording.events)
    assert any("relative_rate" in line and unit in line for line in done.err.splitlines())


@pytest.mark.parametrize(
    "channels",
    [
        first(label=ESC),
        seldom(first(display_unit=ESC)),
        first(display_unit="furlong"),
        first(name="time"),
        seldom(first(name=" ")),
        seldom(first(name=200 * "x")),
        seldom(first(label=250 * "l")),
    ],
)
def test_texts_keep_no_run_from_being_sealed(
    met: Callable[[Hostile], Met], channels: tuple[Channel, ...]
) -> None:
    met(Hostile(channels)).done.ended(DONE, FAULT).sealed()


@pytest.mark.parametrize(
    "records",
    [
        lambda count: [Samples(1, 0, 0, 3, b"123"), ended(count)],
        lambda count: spread(count + 100),
        lambda count: [ended(2**32 - 1, number=0)],
        lambda count: [Event(1, 0, -1e308, ESC), ended(count)],
        lambda count: [ended(0, ESC, 0, outcome=OutcomeCode.FAULT, fault=FaultCode.DRIVE)],
        lambda count: [ended(0, ESC, 0, outcome=OutcomeCode.LIMIT)],
    ],
    ids=["odd-size", "too-long", "never-sent", "event", "fault", "limit"],
)
def test_records_that_cannot_be_are_a_fault(
    met: Callable[[Hostile], Met], records: Callable[[int], list[Message]]
) -> None:
    done = met(Hostile(records=records)).done.ended(FAULT).sealed()
    assert done.run.trials[0].ending.outcome in (Outcome.FAULT, Outcome.LIMIT)


@pytest.mark.parametrize(
    "capabilities",
    [
        {"name": "e\x1b[2J", "firmware": "\0"},
        {"features": ("channel:", "channel:\x1b[2J", "channel:a/b")},
        {"features": ("rate",) * 200},
    ],
    ids=["name", "features", "many"],
)
def test_what_it_says_of_itself_is_only_text(
    met: Callable[[Hostile], Met], capabilities: dict[str, Any]
) -> None:
    done = met(Hostile(capabilities=capabilities)).done.ended(DONE, USAGE, FAULT)
    assert done.refused or done.sealed()


def test_who_stopped_it_is_only_text(met: Callable[[Hostile], Met]) -> None:
    found = met(Hostile(latch=Latch(True, 3, LatchCause.STOPPED, 1.0, ESC)))
    assert found.done.ended(FAULT).refused
    assert "--clear-stop 3" in found.done.err
    assert Kind.ARM not in found.controller.heard
