"""Host side of the relay: start, frames out, frames in."""

from __future__ import annotations

import contextlib
import queue
import threading
import time
from typing import BinaryIO, cast

from campaign.errors import UsageError
from campaign.link.errors import SilenceError
from campaign.link.pipe import BEAT, WANTED, Kind, receive, send
from campaign.processes import end_relay, start_relay

OPENING = 15.0
"""Time limit (s) for the relay to open the port, including the start of its process."""
LEAVING = 5.0
"""Time limit (s) for the exit of the relay; it sends SAFE for up to 2 s."""

BEATS = 400
"""Number of stored heartbeats: 10 s."""


class Connection:
    """An open line to a controller, owned by a relay process.

    Any thread may write; one thread at a time may receive.

    Attributes:
        beats: send times (steady clock, s) of the latest heartbeats, by counter.
    """

    def __init__(self, port: str, baud: int, session: int) -> None:
        """Open `port` for the host of `session`. Raises UsageError with the reason."""
        self._incoming: queue.SimpleQueue[tuple[Kind, bytes]] = queue.SimpleQueue()
        self.beats: dict[int, float] = {}
        self._lost = ""
        self._sending = threading.Lock()
        self._relay = start_relay("campaign.link.relay", port, str(baud), str(session))
        self._out = cast(BinaryIO, self._relay.stdin)
        self._in = cast(BinaryIO, self._relay.stdout)
        self._reader = threading.Thread(target=self._read, name="line", daemon=True)
        self._reader.start()
        try:
            kind, payload = self._incoming.get(timeout=OPENING)
        except queue.Empty:
            kind, payload = Kind.REFUSED, f"port {port!r} did not open in time".encode()
        if kind is not Kind.OPENED:
            self.close()
            raise UsageError(payload.decode(errors="replace") or f"port {port!r} cannot be opened")

    def write(self, data: bytes) -> None:
        """Send bytes to the port. Raises SilenceError."""
        self._send(Kind.WRITE, data)

    def wanted(self, trial: int, record: int, *, at_once: bool = False) -> None:
        """Set the next wanted record in all further heartbeats. Raises SilenceError."""
        self._send(Kind.WANTED, WANTED.pack(trial, record, at_once))

    def holds(self, *, held: bool) -> None:
        """Set whether this host holds the controller: only then the relay sends SAFE at exit."""
        self._send(Kind.HOLDS, bytes((held,)))

    def receive(self, timeout: float) -> bytes:
        """Bytes from the port; empty after `timeout` (s). Raises SilenceError."""
        self._check_lost()
        deadline = time.monotonic() + timeout
        while True:
            try:
                kind, payload = self._incoming.get(timeout=max(0.0, deadline - time.monotonic()))
            except queue.Empty:
                return b""
            if kind is Kind.BYTES:
                return payload
            if kind is Kind.BEAT:
                counter, sent = BEAT.unpack(payload)
                self.beats[counter] = sent
                self.beats.pop((counter - BEATS) % 2**32, None)
            if kind is Kind.LOST:
                self._lost = payload.decode(errors="replace") or "the line is lost"
                self._check_lost()

    def close(self, *, last_words: bool = True) -> None:
        """End the relay; with `last_words` it sends SAFE to a controller held by this host."""
        if not last_words:
            with contextlib.suppress(SilenceError):
                self.holds(held=False)
        with contextlib.suppress(OSError):
            self._out.close()
        end_relay(self._relay, LEAVING)
        self._reader.join(LEAVING)  # it drains the pipe until the relay exits
        with contextlib.suppress(OSError):
            self._in.close()

    def _send(self, kind: Kind, payload: bytes) -> None:
        self._check_lost()
        try:
            with self._sending:
                send(self._out, kind, payload)
        except (OSError, ValueError):
            self._lost = "the process that keeps the port has ended"
        self._check_lost()

    def _check_lost(self) -> None:
        if self._lost:
            raise SilenceError(f"the connection was lost: {self._lost}")

    def _read(self) -> None:
        with contextlib.suppress(OSError, ValueError):
            while (item := receive(self._in)) is not None:
                self._incoming.put(item)
        self._incoming.put((Kind.LOST, b"the process that keeps the port has ended"))
