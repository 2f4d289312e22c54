"""Frames without a session, and the wait for a confirmed safe state.

The relay imports this: nothing heavy may be imported here.
"""

from __future__ import annotations

import threading
from collections.abc import Callable

from campaign.wire.codes import Kind, State, WireError
from campaign.wire.frames import Frame, FrameDecoder, encode_frame
from campaign.wire.messages import (
    Ack,
    Bye,
    Heartbeat,
    Latch,
    Message,
    Query,
    Safe,
    Status,
    decode,
    encode,
)


def heartbeat_frame(counter: int, trial: int, wanted: int, session: int) -> bytes:
    """The host of `session` lives, and has every record of `trial` before number `wanted`."""
    return _frame(Heartbeat(counter, trial, wanted, session))


def safe_frame(session: int = 0, host: str = "", sequence: int = 0) -> bytes:
    """Drive off, now. It is obeyed whoever sends it, whatever its sequence number."""
    return _frame(Safe(session, host), sequence)


def bye_frame(session: int) -> bytes:
    """The host of `session` leaves."""
    return _frame(Bye(session))


def query_frame() -> bytes:
    """How are you, and who holds you?"""
    return _frame(Query())


def is_safe(status: Status) -> bool:
    """Whether the device says that it obeyed, stands still, and has its drive off."""
    return status.state in (State.SAFE, State.FAULT) and status.at_rest and not status.drive_on


class SafeWatch:
    """Reads what a device sends until it says that it is safe.

    What it said before it heard our SAFE counts for nothing: it may have moved since.

    Attributes:
        confirmed: whether its newest word, after it heard our SAFE, is that it is safe.
        acknowledged: whether it has answered a SAFE with the sequence number that is waited for.
        latch: the newest one told since, None before the first.
        last: the newest status, None before the first.
    """

    def __init__(self, sequence: int = 0, told: Callable[[Message], None] | None = None) -> None:
        """`told` is handed every message."""
        self.confirmed = threading.Event()
        self.acknowledged = False
        self.latch: Latch | None = None
        self.last: Status | None = None
        self._sequence = sequence
        self._told = told
        self._decoder = FrameDecoder()

    def feed(self, data: bytes) -> None:
        """Take bytes from the port, damaged or not."""
        for frame in self._decoder.feed(data):
            self._take(frame)

    def _take(self, frame: Frame) -> None:
        try:
            message = decode(frame.kind, frame.body)
        except WireError:
            return
        if self._told is not None:
            self._told(message)
        if isinstance(message, Ack):
            ours = message.kind is Kind.SAFE and message.sequence == self._sequence
            self.acknowledged = self.acknowledged or ours
        elif isinstance(message, Latch) and self.acknowledged:
            self.latch = message
        elif isinstance(message, Status):
            self.last = message
            if self.acknowledged and is_safe(message):
                self.confirmed.set()
            else:
                self.confirmed.clear()


def _frame(message: Message, sequence: int = 0) -> bytes:
    kind, body = encode(message)
    return encode_frame(kind, sequence, body)
