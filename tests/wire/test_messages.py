"""Messages as bytes: every one comes back as it was, and nothing else is taken for one."""

import math
import struct
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from campaign import recording
from campaign.wire import codes
from campaign.wire import messages as wire
from campaign.wire.frames import FrameDecoder
from campaign.wire.parameters import SLICE

from .strategies import FINITE, INT64, MESSAGE, NAME, TEXT


@given(MESSAGE)
def test_a_message_comes_back_as_it_was(message: wire.Message) -> None:
    kind, body = wire.encode(message)
    assert len(body) <= wire.MAX_BODY
    assert wire.decode(kind, body) == message


@given(MESSAGE, st.data())
def test_a_body_cut_short_or_too_long_is_no_message(message: wire.Message, data: st.DataObject):
    kind, body = wire.encode(message)
    if kind in (wire.Kind.SAFE, wire.Kind.SAMPLES):
        return  # obeyed whatever its body; data of any length
    with pytest.raises(wire.WireError):
        wire.decode(kind, body + b"\0")
    if body:
        with pytest.raises(wire.WireError):
            wire.decode(kind, body[: data.draw(st.integers(0, len(body) - 1))])


@given(st.integers(0, 255), st.binary(max_size=60))
def test_any_bytes_are_a_message_or_a_wire_error(kind: int, body: bytes) -> None:
    try:
        message = wire.decode(kind, body)
    except wire.WireError:
        return
    if not isinstance(message, wire.Safe):
        again = wire.encode(message)
        assert again[0] == kind
        assert wire.decode(*again) == message


@pytest.mark.parametrize(
    ("kind", "body"),
    [
        (0x7F, b""),
        (wire.Kind.SET, b"\0"),  # no item
        (wire.Kind.SET, b"\x01\x01a\x01" + struct.pack("<d", math.nan)),
        (wire.Kind.SET, b"\x01\x01a\x01" + struct.pack("<d", math.inf)),
        (wire.Kind.SET, b"\x01\x02a.\x03\x01"),  # a name that ends with a dot
        (wire.Kind.SET, b"\x01\x01a\x03\x02"),  # a flag of 2
        (wire.Kind.SET, b"\x01\x01a\x04\x01\x00\xff"),  # not UTF-8
        (wire.Kind.SET, b"\x01\x01a\x05" + struct.pack("<IIBd", 1, 1, 1, 0.0)),  # beyond total
        (wire.Kind.START, struct.pack("<I", 0)),
        (wire.Kind.HELLO, b"\x02\x02" + bytes(4) + b"\x04host"),  # nobody's session
        (wire.Kind.BYE, bytes(4)),
        (wire.Kind.HEARTBEAT, bytes(12)),  # of version 1: of no session
        (wire.Kind.QUERY, b"?"),
        (wire.Kind.UNLATCH, struct.pack("<I", 3)),  # by nobody at all
        (wire.Kind.UNLATCH, struct.pack("<IB", 3, 1) + b"\xff"),
        (wire.Kind.LATCH, struct.pack("<BIBdB", 2, 3, 1, 0.0, 0)),
        (wire.Kind.LATCH, struct.pack("<BIBdB", 1, 3, 9, 0.0, 0)),  # no such cause
        (wire.Kind.LATCH, struct.pack("<BIBdB", 1, 3, 1, math.inf, 0)),
        (wire.Kind.RESEND, struct.pack("<III", 1, 5, 0)),
        (wire.Kind.RESEND, struct.pack("<III", 1, 2**32 - 1, 2)),
        (wire.Kind.SAMPLES, struct.pack("<IIIH", 1, 0, 0, 0)),
        (wire.Kind.SAMPLES, struct.pack("<IIIH", 1, 0, 0, 2) + b"123"),
        (wire.Kind.ACK, struct.pack("<HBBI", 1, 2, 7, 0)),  # no such state
    ],
)
def test_what_is_not_allowed_is_refused(kind: int, body: bytes) -> None:
    with pytest.raises(wire.WireError):
        wire.decode(kind, body)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        (b"", wire.Safe()),
        (b"\x05\0\0\0", wire.Safe(5)),
        (b"\x05\0\0\0\x04stop", wire.Safe(5, "stop")),
        (b"\0\0\0\0\x04stop", wire.Safe(0, "stop")),
        (b"\x05\0\0", wire.Safe()),
        (b"\x05\0\0\0\x05stop", wire.Safe()),
        (b"\x05\0\0\0\x04stop!", wire.Safe()),
        (b"\x05\0\0\0\x01\xff", wire.Safe()),
        (b"anything", wire.Safe()),
    ],
)
def test_safe_is_understood_whatever_its_body(body: bytes, message: wire.Safe) -> None:
    assert wire.decode(wire.Kind.SAFE, body) == message


@given(st.binary(max_size=300))
def test_any_body_of_a_safe_is_one(body: bytes) -> None:
    assert isinstance(wire.decode(wire.Kind.SAFE, body), wire.Safe)


def test_a_frame_holds_its_message_and_its_number() -> None:
    for message, number in ((wire.Safe(), 0), (wire.Safe(7, "eve"), 99), (wire.Query(), 1)):
        [frame] = FrameDecoder().feed(wire.framed(message, number))
        assert (wire.decode(frame.kind, frame.body), frame.sequence) == (message, number)


def test_nobodys_safe_is_the_one_of_version_1() -> None:
    assert wire.encode(wire.Safe()) == (wire.Kind.SAFE, b"")


@pytest.mark.parametrize("message", [wire.Hello(2, 2, 0), wire.Bye(0)])
def test_nobodys_session_cannot_be_said(message: wire.Message) -> None:
    with pytest.raises(wire.WireError, match="0 means none"):
        wire.encode(message)


VALUES = st.one_of(FINITE, INT64, st.booleans(), TEXT, st.lists(FINITE, max_size=200).map(tuple))


@pytest.mark.slow
@given(st.dictionaries(NAME, VALUES, max_size=20))
def test_a_configuration_survives_being_cut_into_messages(parameters: dict[str, wire.Value]):
    sets = wire.parameter_messages(parameters)
    bodies = [wire.encode(message)[1] for message in sets]
    assert all(len(body) <= wire.MAX_BODY for body in bodies)
    received = [wire.decode(wire.Kind.SET, body) for body in bodies]
    again = wire.assembled(item for each in received for item in each.items)
    assert again == parameters
    assert [type(value) for value in again.values()] == [type(v) for v in parameters.values()]


def test_the_thesis_ship_motion_of_a_thousand_components_can_be_sent() -> None:
    parameters = {f"task.{n}": tuple(map(float, range(1000))) for n in ("a", "f", "p")}
    sets = wire.parameter_messages(parameters)
    assert wire.assembled(item for each in sets for item in each.items) == parameters


@pytest.mark.parametrize("missing", [0, 1, 2])
def test_an_array_with_a_piece_missing_is_refused(missing: int) -> None:
    listed = wire.items({"task.times": tuple(map(float, range(3 * SLICE)))})
    del listed[missing]
    with pytest.raises(wire.WireError, match=r"task\.times"):
        wire.assembled(listed)


def test_the_checksum_of_a_configuration_depends_on_order_and_bytes() -> None:
    assert wire.configuration_crc([b"1234", b"56789"]) == 0xCBF43926
    assert wire.configuration_crc([b"56789", b"1234"]) != 0xCBF43926
    assert wire.configuration_crc([]) == 0


def test_many_channels_take_several_messages_each_within_a_frame() -> None:
    listed = [wire.Channel(f"channel_{n}", "rad/s", "deg/s", "Label " * 9) for n in range(40)]
    messages = wire.channels_messages(3, 1000.0, listed)
    assert len(messages) > 1
    decoded = [wire.decode(*wire.encode(message)) for message in messages]
    assert [c for each in decoded for c in each.channels] == listed
    firsts = [each.first for each in decoded]
    assert firsts == sorted(set(firsts))
    assert all(each.total == 40 for each in decoded)


def test_samples_have_the_layout_of_their_channels() -> None:
    formats = [wire.Format.F64, wire.Format.I16, wire.Format.F32, wire.Format.I32]
    listed = [wire.Channel(str(f), "", "", "", format=f) for f in formats]
    assert wire.sample_size(listed) == 18
    assert [kind for _, kind in wire.sample_dtype(listed)] == ["<f8", "<i2", "<f4", "<i4"]
    count = wire.samples_per_record(listed)
    wire.encode(wire.Samples(1, 0, 0, count, bytes(count * 18)))
    with pytest.raises(wire.WireError):
        wire.encode(wire.Samples(1, 0, 0, count + 1, bytes((count + 1) * 18)))


def test_words_are_those_of_the_rest_of_the_program() -> None:
    of_hosts = {str(recording.Fault.RECORDING)}  # judged there; no device can say it
    assert {f.text for f in wire.Fault} - {"none"} == {str(f) for f in recording.Fault} - of_hosts
    assert {o.text for o in wire.Outcome} == {str(o) for o in recording.Outcome}


def test_commands_are_what_the_host_sends_and_the_device_acknowledges() -> None:
    host = {kind for kind in wire.Kind if not kind & 0x80}
    unnumbered = {wire.Kind.HEARTBEAT, wire.Kind.RESEND, wire.Kind.QUERY, wire.Kind.BYE}
    assert host - codes.COMMANDS == unnumbered


def test_the_protocol_needs_the_standard_library_only() -> None:
    code = "import sys, campaign.wire.messages, campaign.wire.statemachine; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not {"numpy", "pydantic", "serial"} & set(done.stdout.split())
