"""Messages between relay and parent: kind (1 byte), length (4 bytes), payload."""

from __future__ import annotations

import struct
from enum import IntEnum
from typing import BinaryIO

_HEAD = struct.Struct("<BI")


class Kind(IntEnum):
    """Parent to relay: WRITE, WANTED, HOLDS. Relay to parent: all others."""

    WRITE = 1  # bytes for the port
    WANTED = 2  # what the heartbeats from now on say; see WANTED
    OPENED = 3  # the port is open
    REFUSED = 4  # it cannot be opened: why
    BYTES = 5  # bytes from the port
    LOST = 6  # the line is lost: why
    BEAT = 7  # a heartbeat is being sent; see BEAT
    HOLDS = 8  # one byte: whether the controller is the host's, so that last words are due


WANTED = struct.Struct("<II?")
"""Trial, number of the next record wanted of it, and whether a heartbeat shall say so at once."""
BEAT = struct.Struct("<Id")
"""Counter, and the steady clock (s), which all processes of a machine share."""


def send(pipe: BinaryIO, kind: Kind, payload: bytes = b"") -> None:
    """Write one item at once. Raises OSError (BrokenPipeError) when nobody reads any more."""
    pipe.write(_HEAD.pack(kind, len(payload)) + payload)
    pipe.flush()


def receive(pipe: BinaryIO) -> tuple[Kind, bytes] | None:
    """The next item; None when the other end has gone."""
    head = _exactly(pipe, _HEAD.size)
    if head is None:
        return None
    kind, length = _HEAD.unpack(head)
    payload = _exactly(pipe, length)
    return None if payload is None else (Kind(kind), payload)


def _exactly(pipe: BinaryIO, count: int) -> bytes | None:
    data = b""
    while len(data) < count:
        part = pipe.read(count - len(data))
        if not part:
            return None
        data += part
    return data
