"""docs/developers/serial-protocol.md agrees with the code: numbers, tables, frames."""

import re
import struct
from pathlib import Path

import pytest

from campaign.wire import messages as wire
from campaign.wire.codes import COMMANDS, VERSION, Code, Tag
from campaign.wire.frames import MAX_BODY, MAX_ENCODED, FrameDecoder, encode_frame
from campaign.wire.statemachine import after, after_hello, after_silence

DOCUMENT = (Path(__file__).parents[2] / "docs" / "developers" / "serial-protocol.md").read_text(
    "utf-8"
)
FLAT = " ".join(DOCUMENT.split())


def rows(first: str) -> list[list[str]]:
    """The cells of all table rows whose first cell matches."""
    found = [line.strip("| ").split(" | ") for line in DOCUMENT.splitlines() if line[:1] == "|"]
    return [[cell.strip() for cell in row] for row in found if re.fullmatch(first, row[0].strip())]


def test_every_message_has_its_row_with_its_fields_in_order() -> None:
    documented = {int(row[0], 16): row for row in rows("0x[0-9A-F]{2}")}
    assert {number: row[1] for number, row in documented.items()} == {
        int(kind): kind.name for kind in wire.Kind
    }
    for number, row in documented.items():
        made = wire.MESSAGES[wire.Kind(number)]
        fields = [name for name in made.__dataclass_fields__ if name not in ("items", "channels")]
        places = [re.search(rf"\b{name}\b", row[2]) for name in fields]
        assert all(places), (row, fields)
        starts = [place.start() for place in places if place]
        assert starts == sorted(starts), row


@pytest.mark.parametrize("code", wire.NakCode)
def test_every_refusal_is_listed(code: Code) -> None:
    assert [row[1] for row in rows(str(int(code))) if len(row) == 3] == [code.text]


def test_the_state_table_is_the_state_machine() -> None:
    def cell(result: object) -> str:
        return result.name if isinstance(result, wire.State) else "–"

    for kind in COMMANDS - {wire.Kind.HELLO}:
        [row] = [row for row in rows(kind.name) if len(row) == 8]
        assert row[1:] == [cell(after(state, kind)) for state in wire.State], kind
    for same, name in ((True, "HELLO, same session"), (False, "HELLO, another session")):
        [row] = rows(name)
        expected = [cell(after_hello(state, same, held=False)) for state in wire.State]
        assert [text.removesuffix(" (busy)") for text in row[1:]] == expected
    [row] = rows("the same while held")
    expected = [cell(after_hello(state, same_session=False, held=True)) for state in wire.State]
    assert [text.removesuffix(" (busy)") for text in row[1:]] == expected
    for state in wire.State:  # of the other row: held or not makes no difference
        assert after_hello(state, True, held=True) == after_hello(state, True, held=False)
    [row] = rows("no heartbeat")
    assert row[1:] == [after_silence(state).name for state in wire.State]


def test_the_numbers_of_the_enumerations_are_listed() -> None:
    for state in wire.State:
        assert any(row[:2] == [str(int(state)), state.name] for row in rows(r"\d"))
    for outcome in wire.Outcome:
        assert re.search(rf"^\| {int(outcome)} \| {outcome.text}\b", DOCUMENT, re.MULTILINE)
    for fault in wire.Fault:
        assert re.search(rf"\| {int(fault)} \| {fault.text}\b", DOCUMENT)
    for cause in wire.LatchCause:
        assert re.search(rf"^\| {int(cause)} {cause.text} \|", DOCUMENT, re.MULTILINE)
    for form in wire.Format:
        assert f"| {int(form)} {form.text} | {form.size} |" in DOCUMENT
    assert [int(tag) for tag in Tag] == [1, 2, 3, 4, 5]


def test_sizes_and_loads_follow_from_the_layouts() -> None:
    assert f"at most {MAX_ENCODED} bytes" in FLAT
    assert f"0 to {MAX_BODY} bytes" in FLAT
    for form, words in ((wire.Format.F64, "| 82.3 kB/s |"), (wire.Format.F32, "| 41.1 kB/s |")):
        channels = [wire.Channel(str(n), "", "", "", format=form) for n in range(10)]
        count = wire.samples_per_record(channels)
        data = b"\x01" * count * wire.sample_size(channels)  # no zeros: COBS at its longest
        frame = len(encode_frame(*_numbered(wire.Samples(2**32 - 1, 1, 1, count, data))))
        assert f"= {frame} B" in DOCUMENT
        assert f"{frame * 1000 / count / 1000:.1f} kB/s" in words
        assert words.strip("| ") in DOCUMENT
    status = wire.Status(
        wire.State.IDLE, wire.Fault.NONE, True, False, 1, 0.0, 1, 0.0, 1, 1, 1, 1
    )  # fmt: skip
    assert f"STATUS: {len(encode_frame(*_numbered(status)))} B" in DOCUMENT
    beat = wire.Heartbeat(1, 1, 1, 0x12345678)
    assert f"heartbeats of {len(encode_frame(*_numbered(beat)))} B" in FLAT
    assert "1.1 kB/s" in FLAT


def _numbered(message: wire.Message) -> tuple[int, int, bytes]:
    kind, body = wire.encode(message)
    return kind, 1, body


EXAMPLES = [
    wire.Hello(2, 2, 0x12345678, "campaign"),
    wire.Set(
        (
            wire.Item("task.mode", "rate"),
            wire.Item("task.command.amplitude", 0.5),
            wire.Item("rehearsal.seed", -1),
            wire.Item("task.hold", True),
            wire.Item("task.command.times", wire.ArraySlice(3, 1, (0.0, 2.5))),
        )
    ),
    wire.Arm(0xCBF43926),
    wire.Start(1),
    wire.Heartbeat(1, 1, 17, 0x12345678),
    wire.Resend(1, 5, 2),
    wire.Safe(),
    wire.Safe(0x12345678, "stop"),
    wire.Unlatch(3, "ada"),
    wire.Ack(2, wire.Kind.SET, wire.State.CONFIGURED, 0xB007),
    wire.Nak(3, 3, wire.NakCode.LIMIT, wire.State.CONFIGURED, "task.command", "too fast"),
    wire.Samples(1, 0, 0, 2, struct.pack("<dhdh", 0.5, 100, -0.5, -100)),
    wire.End(1, 2, wire.Outcome.FAULT, wire.Fault.DRIVE, 2, True, "drive fault 17"),
    wire.LostRecords(1, 0, 3),
    wire.Latch(True, 3, wire.LatchCause.STOPPED, 2.5, "stop"),
]
"""What the text above the examples says they are, in the order of the examples."""


def test_the_worked_examples_are_what_they_say() -> None:
    pattern = r"^([A-Z]+), sequence (\d+)\n((?:[0-9a-f]{2}[ \n])+)"
    found = re.findall(pattern, DOCUMENT, re.MULTILINE)
    assert len(found) == len(EXAMPLES)
    for (name, sequence, octets), example in zip(found, EXAMPLES, strict=True):
        assert name == wire.KINDS[type(example)].name
        [frame] = FrameDecoder().feed(bytes.fromhex(octets))
        assert frame.sequence == int(sequence)
        assert wire.decode(frame.kind, frame.body) == example
        assert encode_frame(frame.kind, frame.sequence, frame.body) == bytes.fromhex(octets)


def test_the_version_is_the_one_that_is_spoken() -> None:
    assert f"This is version {VERSION} of the protocol" in FLAT
    last = [row[0] for row in rows(r"\d") if len(row) == 2][-1]
    assert last == str(VERSION)
    assert f"offers versions {VERSION} to {VERSION}" in FLAT
