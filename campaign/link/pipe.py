"""Messages between relay and parent: kind (1 byte), length (4 bytes), payload."""

from __future__ import annotations

import struct
from enum import IntEnum
from typing import BinaryIO

_HEAD = struct.Struct("<BI")


class Kind(IntEnum):
    """Parent to relay: WRITE, WANTED, HOLDS. Relay to parent: all others."""

    WRITE = 1  # bytes for the port
    WANTED = 2  # content of further heartbeats; see WANTED
    OPENED = 3  # the port is open
    REFUSED = 4  # the port cannot be opened: reason
    BYTES = 5  # bytes from the port
    LOST = 6  # the line is lost: reason
    BEAT = 7  # a heartbeat is sent; see BEAT
    HOLDS = 8  # one byte: whether the host holds the controller, so that SAFE is sent at exit


WANTED = struct.Struct("<II?")
"""Trial, number of its next wanted record, and whether to send a heartbeat at once."""
BEAT = struct.Struct("<Id")
"""Counter, and steady clock (s), common to all processes of a machine."""


def send(pipe: BinaryIO, kind: Kind, payload: bytes = b"") -> None:
    """Write and flush one item. Raises OSError (BrokenPipeError) if the reader has closed."""
    pipe.write(_HEAD.pack(kind, len(payload)) + payload)
    pipe.flush()


def receive(pipe: BinaryIO) -> tuple[Kind, bytes] | None:
    """The next item; None if the other end has closed."""
    head = pipe.read(_HEAD.size)
    if len(head) < _HEAD.size:
        return None
    kind, length = _HEAD.unpack(head)
    payload = pipe.read(length)
    return (Kind(kind), payload) if len(payload) == length else None
