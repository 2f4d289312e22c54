"""Every message of the protocol, and its body as bytes.

`encode` converts a message to (kind, body), `decode` the reverse, or raises WireError: every length
is exact, every code known, every number finite. Times are in seconds, all values SI. `LAYOUTS`
defines the bodies completely: field by field, in the order of the bytes.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from campaign.wire.codes import (
    COMMANDS,
    VERSION,
    Code,
    Fault,
    Format,
    Kind,
    LatchCause,
    NakCode,
    Outcome,
    State,
    WireError,
)
from campaign.wire.device import (
    Ack,
    Capabilities,
    Channel,
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
from campaign.wire.fields import Reader, Writer, clipped
from campaign.wire.frames import MAX_BODY
from campaign.wire.host import (
    Arm,
    Bye,
    Clear,
    Heartbeat,
    Hello,
    Query,
    Release,
    Resend,
    Safe,
    Set,
    Start,
    Stop,
    Unlatch,
)
from campaign.wire.parameters import (
    ArraySlice,
    Item,
    Value,
    assembled,
    configuration_crc,
    encoded,
    items,
    packed,
    read_item,
)

__all__ = [
    "COMMANDS", "MAX_BODY", "VERSION", "Ack", "Arm", "ArraySlice", "Bye", "Capabilities", "Channel",
    "Channels", "Clear", "End", "Event", "Fault", "Format", "Heartbeat", "Hello", "Holder", "Item",
    "Kind", "Latch", "LatchCause", "LostRecords", "Message", "Nak", "NakCode", "Outcome", "Query",
    "Record", "Release", "Resend", "Safe", "Samples", "Set", "Start", "State", "Status", "Stop",
    "Unlatch", "Value", "WireError", "assembled",
    "channels_messages", "clipped", "configuration_crc", "decode", "encode", "items",
    "parameter_messages", "sample_dtype", "sample_size", "sample_struct", "samples_per_record",
]  # fmt: skip

Record = Samples | Event | End
Message = (
    Hello | Set | Arm | Start | Heartbeat | Resend | Release | Stop | Safe | Clear | Query
    | Unlatch | Bye
    | Capabilities | Ack | Nak | Channels | Status | Samples | Event | End | LostRecords | Latch
    | Holder
)  # fmt: skip


@dataclass(frozen=True)
class Layout:
    """Writer and reader of one kind of field."""

    write: Callable[[Writer, Any], object]
    read: Callable[[Reader], Any]


def _integer(letter: str) -> Layout:
    return Layout(lambda w, value: w.number(letter, value), lambda r: r.integer(letter))


def _code(kind: type[Code]) -> Layout:
    return Layout(lambda w, value: w.number("B", kind(value)), lambda r: r.code(kind))


def _write_items(writer: Writer, listed: tuple[Item, ...]) -> None:
    writer.number("B", len(listed))
    for item in listed:
        writer.data(encoded(item))


def _read_items(reader: Reader) -> tuple[Item, ...]:
    return tuple(read_item(reader) for _ in range(reader.integer("B")))


def _write_channels(writer: Writer, channels: tuple[Channel, ...]) -> None:
    writer.number("B", len(channels))
    for c in channels:
        writer.text(c.name).text(c.unit).text(c.display_unit).text(c.label)
        writer.number("B", c.measured).number("B", c.format).finite(c.scale)


def _read_channels(reader: Reader) -> tuple[Channel, ...]:
    return tuple(
        Channel(
            reader.text(),
            reader.text(),
            reader.text(),
            reader.text(),
            reader.flag(),
            reader.code(Format),
            reader.finite(),
        )
        for _ in range(reader.integer("B"))
    )


def _write_optional(writer: Writer, value: float | None) -> None:
    if value is None:
        writer.number("d", math.nan)
    else:
        writer.finite(value)


def _read_optional(reader: Reader) -> float | None:
    value = reader.real()
    if math.isinf(value):
        raise WireError("an infinite number")
    return None if math.isnan(value) else value


U8, U16, U32 = _integer("B"), _integer("H"), _integer("I")
F64 = Layout(lambda w, value: w.finite(value), lambda r: r.finite())
OPTIONAL = Layout(_write_optional, _read_optional)
FLAG = Layout(lambda w, value: w.number("B", bool(value)), lambda r: r.flag())
SHORT = Layout(lambda w, value: w.text(value), lambda r: r.text())
LONG = Layout(lambda w, value: w.text(value, "H"), lambda r: r.text("H"))
WORDS = Layout(lambda w, value: w.texts(value), lambda r: r.texts())
ITEMS = Layout(_write_items, _read_items)
CHANNELS = Layout(_write_channels, _read_channels)
REST = Layout(lambda w, value: w.data(value), lambda r: r.data(r.left))
STATE, FAULT, OUTCOME = _code(State), _code(Fault), _code(Outcome)
KIND, NAK, CAUSE = _code(Kind), _code(NakCode), _code(LatchCause)

LAYOUTS: Mapping[Kind, tuple[type[Any], tuple[tuple[str, Layout], ...]]] = {
    Kind.HELLO: (
        Hello,
        (("lowest", U8), ("highest", U8), ("session", U32), ("host", SHORT)),
    ),
    Kind.SET: (Set, (("items", ITEMS),)),
    Kind.ARM: (Arm, (("crc", U32),)),
    Kind.START: (Start, (("trial", U32),)),
    Kind.HEARTBEAT: (
        Heartbeat,
        (("counter", U32), ("trial", U32), ("next", U32), ("session", U32)),
    ),
    Kind.RESEND: (Resend, (("trial", U32), ("first", U32), ("count", U32))),
    Kind.RELEASE: (Release, (("trial", U32),)),
    Kind.STOP: (Stop, ()),
    Kind.SAFE: (Safe, (("session", U32), ("host", SHORT))),  # or less: see `_safe`
    Kind.CLEAR: (Clear, ()),
    Kind.QUERY: (Query, ()),
    Kind.UNLATCH: (Unlatch, (("count", U32), ("host", SHORT))),
    Kind.BYE: (Bye, (("session", U32),)),
    Kind.CAPABILITIES: (
        Capabilities,
        (
            ("sequence", U16),
            ("version", U8),
            ("lowest", U8),
            ("highest", U8),
            ("boot", U32),
            ("state", STATE),
            ("heartbeat_timeout", F64),
            ("ring_records", U32),
            ("longest_array", U32),
            ("sample_rate", F64),
            ("name", SHORT),
            ("firmware", SHORT),
            ("features", WORDS),
            ("compensations", WORDS),
            ("limits", ITEMS),
        ),
    ),
    Kind.ACK: (Ack, (("sequence", U16), ("kind", KIND), ("state", STATE), ("boot", U32))),
    Kind.NAK: (
        Nak,
        (
            ("sequence", U16),
            ("kind", U8),
            ("code", NAK),
            ("state", STATE),
            ("name", SHORT),
            ("text", SHORT),
        ),
    ),
    Kind.CHANNELS: (
        Channels,
        (
            ("sequence", U16),
            ("total", U8),
            ("first", U8),
            ("sample_rate", F64),
            ("channels", CHANNELS),
        ),
    ),
    Kind.STATUS: (
        Status,
        (
            ("state", STATE),
            ("fault", FAULT),
            ("at_rest", FLAG),
            ("drive_on", FLAG),
            ("boot", U32),
            ("clock", F64),
            ("heartbeat", U32),
            ("heartbeat_age", F64),
            ("trial", U32),
            ("first_record", U32),
            ("next_record", U32),
            ("ring_used", U32),
            ("bad_frames", U32),
            ("temperature", OPTIONAL),
        ),
    ),
    Kind.SAMPLES: (
        Samples,
        (("trial", U32), ("number", U32), ("first", U32), ("count", U16), ("data", REST)),
    ),
    Kind.EVENT: (Event, (("trial", U32), ("number", U32), ("time", F64), ("text", LONG))),
    Kind.END: (
        End,
        (
            ("trial", U32),
            ("number", U32),
            ("outcome", OUTCOME),
            ("fault", FAULT),
            ("samples", U32),
            ("safe", FLAG),
            ("reason", LONG),
        ),
    ),
    Kind.LOST: (LostRecords, (("trial", U32), ("first", U32), ("count", U32))),
    Kind.LATCH: (
        Latch,
        (("latched", FLAG), ("count", U32), ("cause", CAUSE), ("age", OPTIONAL), ("by", SHORT)),
    ),
    Kind.HOLDER: (Holder, (("held", FLAG), ("age", OPTIONAL), ("host", SHORT))),
}
KINDS: Mapping[type[Any], Kind] = {made: kind for kind, (made, _) in LAYOUTS.items()}


def encode(message: Message) -> tuple[Kind, bytes]:
    """Type and body of `message`. Raises WireError if it cannot be sent."""
    kind = KINDS[type(message)]
    _check(message)
    writer = Writer()
    for name, layout in LAYOUTS[kind][1]:
        layout.write(writer, getattr(message, name))
    body = b"" if message == Safe() else writer.done()  # without a session: as in version 1
    if len(body) > MAX_BODY:
        raise WireError(f"a {kind.name} of {len(body)} bytes; a frame carries {MAX_BODY}")
    return kind, body


def decode(kind: int, body: bytes) -> Message:
    """The message. Raises WireError if the type is unknown or the body does not match it."""
    if kind not in LAYOUTS:
        raise WireError(f"no message has the type 0x{kind:02x}")
    if kind == Kind.SAFE:
        return _safe(body)
    made, layouts = LAYOUTS[Kind(kind)]
    reader = Reader(body)
    message: Message = made(**{name: layout.read(reader) for name, layout in layouts})
    reader.end()
    _check(message)
    return message


def _safe(body: bytes) -> Safe:
    """Decode SAFE, which is obeyed with any body: it is never sent by mistake.

    Four bytes are a session without an identity; an invalid body counts as without a session.
    """
    try:
        reader = Reader(body)
        session = reader.integer("I") if body else 0
        host = reader.text() if reader.left else ""
        reader.end()
    except WireError:
        return Safe()
    return Safe(session, host)


def _check(message: Message) -> None:
    """Check conditions between fields. Raises WireError."""
    if isinstance(message, Samples):
        if message.count < 1 or not message.data or len(message.data) % message.count:
            raise WireError(f"{len(message.data)} bytes cannot be {message.count} samples")
    elif isinstance(message, Set) and not message.items:
        raise WireError("a SET without items")
    elif isinstance(message, Channels):
        beyond = message.first + len(message.channels) > message.total
        if beyond or not message.channels or message.sample_rate <= 0:
            raise WireError("channels beyond their total, none at all, or no sample rate")
    elif isinstance(message, Hello | Bye) and not message.session:
        raise WireError("sessions are counted from 1: 0 means none")
    elif isinstance(message, Start) and not message.trial:
        raise WireError("trials are counted from 1: 0 means none")
    elif (
        isinstance(message, Resend | LostRecords)
        and not 1 <= message.count <= 2**32 - message.first
    ):
        raise WireError(f"{message.count} records from {message.first}")


# Lists that may need several messages, for both ends


def parameter_messages(parameters: Mapping[str, Value]) -> list[Set]:
    """`parameters` in as few SET messages as possible, in order; arrays cut into slices."""
    return [Set(batch) for batch in packed(items(parameters))]


def channels_messages(
    sequence: int, sample_rate: float, channels: Iterable[Channel]
) -> list[Channels]:
    """The CHANNELS messages that answer ARM number `sequence`, each within a frame."""
    listed = tuple(channels)
    messages: list[Channels] = []
    first = 0
    while first < len(listed):
        last = len(listed)
        while True:
            message = Channels(sequence, len(listed), first, sample_rate, listed[first:last])
            writer = Writer()
            _write_channels(writer, message.channels)
            if len(writer.done()) + 12 <= MAX_BODY or last == first + 1:
                break
            last -= 1
        messages.append(message)
        first = last
    return messages


def sample_struct(channels: Iterable[Channel]) -> struct.Struct:
    """Layout of one sample of all channels."""
    return struct.Struct("<" + "".join(channel.format.letter for channel in channels))


def sample_dtype(channels: Iterable[Channel]) -> list[tuple[str, str]]:
    """The fields of a packed numpy dtype of one sample: `numpy.dtype(sample_dtype(channels))`."""
    return [(channel.name, channel.format.dtype) for channel in channels]


def sample_size(channels: Iterable[Channel]) -> int:
    """Size of one sample of all channels (bytes)."""
    return sum(channel.format.size for channel in channels)


def samples_per_record(channels: Iterable[Channel]) -> int:
    """Largest number of samples in one SAMPLES message."""
    return (MAX_BODY - 14) // sample_size(channels)
