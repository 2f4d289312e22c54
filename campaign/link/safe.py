"""The wait for a confirmed safe state.

The relay imports this module: it must import quickly.
"""

from __future__ import annotations

import threading
from collections.abc import Callable

from campaign.wire.codes import Kind, State, WireError
from campaign.wire.frames import Frame, FrameDecoder
from campaign.wire.messages import Ack, Latch, Message, Status, decode


def is_safe(status: Status) -> bool:
    """Whether the device reports a safe or fault state, at rest, with its drive off."""
    return status.state in (State.SAFE, State.FAULT) and status.at_rest and not status.drive_on


class SafeWatch:
    """Parser of a device's messages that waits for a report of the safe state.

    Reports before the acknowledgment of SAFE are ignored: the device may have moved since.

    Attributes:
        confirmed: set while the newest status after the acknowledgment reports the safe state.
        acknowledged: whether the device has answered a SAFE with the expected sequence number.
        latch: the newest latch since then, None before the first.
        last: the newest status, None before the first.
    """

    def __init__(self, sequence: int = 0, told: Callable[[Message], None] | None = None) -> None:
        """`told` is called with every message."""
        self.confirmed = threading.Event()
        self.acknowledged = False
        self.latch: Latch | None = None
        self.last: Status | None = None
        self._sequence = sequence
        self._told = told
        self._decoder = FrameDecoder()

    def feed(self, data: bytes) -> None:
        """Parse bytes from the port, damaged or not."""
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
