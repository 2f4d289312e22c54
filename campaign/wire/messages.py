"""Every message of the protocol, and its body as bytes.

`encode` converts a message to (kind, body), `decode` the reverse, or raises WireError: every length
is exact, every code known, every number finite. Times are in seconds, all values SI. The
annotations of a message's class define its body (`campaign.wire.fields`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeVar

from campaign.wire.codes import (
    COMMANDS,
    VERSION,
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
from campaign.wire.fields import Reader, clipped, read, written
from campaign.wire.frames import MAX_BODY, encode_frame
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
)

__all__ = [
    "COMMANDS", "MAX_BODY", "VERSION", "Ack", "Arm", "ArraySlice", "Bye", "Capabilities", "Channel",
    "Channels", "Clear", "End", "Event", "Fault", "Format", "Heartbeat", "Hello", "Holder", "Item",
    "Kind", "Latch", "LatchCause", "LostRecords", "Message", "Nak", "NakCode", "Outcome", "Query",
    "Record", "Release", "Resend", "Safe", "Samples", "Set", "Start", "State", "Status", "Stop",
    "Unlatch", "Value", "WireError", "assembled",
    "channels_messages", "clipped", "configuration_crc", "decode", "encode", "framed", "items",
    "parameter_messages", "sample_dtype", "sample_size", "samples_per_record",
]  # fmt: skip

MOST_MEMBERS = 255
"""Largest number of members of a list: its length is a u8."""
M = TypeVar("M")
Record = Samples | Event | End
Message = (
    Hello | Set | Arm | Start | Heartbeat | Resend | Release | Stop | Safe | Clear | Query
    | Unlatch | Bye
    | Capabilities | Ack | Nak | Channels | Status | Samples | Event | End | LostRecords | Latch
    | Holder
)  # fmt: skip


MESSAGES: Mapping[Kind, type[Any]] = {
    Kind.HELLO: Hello,
    Kind.SET: Set,
    Kind.ARM: Arm,
    Kind.START: Start,
    Kind.HEARTBEAT: Heartbeat,
    Kind.RESEND: Resend,
    Kind.RELEASE: Release,
    Kind.STOP: Stop,
    Kind.SAFE: Safe,  # its body may be shorter: see `_safe`
    Kind.CLEAR: Clear,
    Kind.QUERY: Query,
    Kind.UNLATCH: Unlatch,
    Kind.BYE: Bye,
    Kind.CAPABILITIES: Capabilities,
    Kind.ACK: Ack,
    Kind.NAK: Nak,
    Kind.CHANNELS: Channels,
    Kind.STATUS: Status,
    Kind.SAMPLES: Samples,
    Kind.EVENT: Event,
    Kind.END: End,
    Kind.LOST: LostRecords,
    Kind.LATCH: Latch,
    Kind.HOLDER: Holder,
}
KINDS: Mapping[type[Any], Kind] = {made: kind for kind, made in MESSAGES.items()}


def encode(message: Message) -> tuple[Kind, bytes]:
    """Type and body of `message`. Raises WireError if it cannot be sent."""
    kind = KINDS[type(message)]
    _check(message)
    body = b"" if message == Safe() else written(message)  # without a session: as in version 1
    if len(body) > MAX_BODY:
        raise WireError(f"a {kind.name} of {len(body)} bytes; a frame carries {MAX_BODY}")
    return kind, body


def decode(kind: int, body: bytes) -> Message:
    """The message. Raises WireError if the type is unknown or the body does not match it."""
    if kind not in MESSAGES:
        raise WireError(f"no message has the type 0x{kind:02x}")
    if kind == Kind.SAFE:
        return _safe(body)
    reader = Reader(body)
    message: Message = read(MESSAGES[Kind(kind)], reader)
    reader.end()
    _check(message)
    return message


def framed(message: Message, sequence: int = 0) -> bytes:
    """`message` as a frame with delimiters. Raises WireError if it cannot be sent."""
    kind, body = encode(message)
    return encode_frame(kind, sequence, body)


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
    return [Set(batch) for batch in _packed(items(parameters), encoded, 1)]


def channels_messages(
    sequence: int, sample_rate: float, channels: Iterable[Channel]
) -> list[Channels]:
    """The CHANNELS messages that answer ARM number `sequence`, each within a frame."""
    batches = _packed(tuple(channels), written, 13)
    total, first, messages = sum(map(len, batches)), 0, []
    for batch in batches:
        messages.append(Channels(sequence, total, first, sample_rate, batch))
        first += len(batch)
    return messages


def _packed(members: Iterable[M], write: Callable[[M], bytes], head: int) -> list[tuple[M, ...]]:
    """`members` in as few messages as possible; `head`: bytes of a message without members."""
    batches: list[list[M]] = []
    size = 0
    for member in members:
        length = len(write(member))
        if not batches or size + length > MAX_BODY or len(batches[-1]) == MOST_MEMBERS:
            batches.append([])
            size = head
        batches[-1].append(member)
        size += length
    return [tuple(batch) for batch in batches]


def sample_dtype(channels: Iterable[Channel]) -> list[tuple[str, str]]:
    """The fields of a packed numpy dtype of one sample: `numpy.dtype(sample_dtype(channels))`."""
    return [(channel.name, channel.format.dtype) for channel in channels]


def sample_size(channels: Iterable[Channel]) -> int:
    """Size of one sample of all channels (bytes)."""
    return sum(channel.format.size for channel in channels)


def samples_per_record(channels: Iterable[Channel]) -> int:
    """Largest number of samples in one SAMPLES message."""
    return (MAX_BODY - 14) // sample_size(channels)
