"""Frames that need no session, and watching for the answer that the bench is safe."""

from __future__ import annotations

import threading

from campaign.wire.codes import Kind, State, WireError
from campaign.wire.frames import FrameDecoder, encode_frame
from campaign.wire.messages import Heartbeat, Safe, Status, decode, encode


def heartbeat_frame(counter: int, trial: int, wanted: int) -> bytes:
    """The host lives, and has every record of `trial` before number `wanted`."""
    return encode_frame(*_parted(Heartbeat(counter, trial, wanted)))


def safe_frame() -> bytes:
    """Drive off, now. It is obeyed whoever sends it, whatever its sequence number."""
    return encode_frame(*_parted(Safe()))


def is_safe(status: Status) -> bool:
    """Whether the device says that it obeyed, stands still, and has its drive off."""
    return status.state in (State.SAFE, State.FAULT) and status.at_rest and not status.drive_on


class SafeWatch:
    """Reads what a device sends until it says that it is safe.

    Attributes:
        confirmed: set when it has.
        last: the newest status, None before the first.
    """

    def __init__(self) -> None:
        self.confirmed = threading.Event()
        self.last: Status | None = None
        self._decoder = FrameDecoder()

    def feed(self, data: bytes) -> None:
        """Take bytes from the port, damaged or not."""
        for frame in self._decoder.feed(data):
            if frame.kind != Kind.STATUS:
                continue
            try:
                status = decode(frame.kind, frame.body)
            except WireError:
                continue
            if isinstance(status, Status):
                self.last = status
                if is_safe(status):
                    self.confirmed.set()


def _parted(message: Heartbeat | Safe) -> tuple[Kind, int, bytes]:
    kind, body = encode(message)
    return kind, 0, body
