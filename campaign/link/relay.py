"""The process that owns the port: `python -m campaign.link.relay PORT BAUD SESSION`.

The host starts it. As a separate process, it sends heartbeats independent of analyses, disk access
and crashes of the host, and it sends SAFE if the host is killed. It imports neither numpy nor
pydantic, and forwards bytes in both directions. Its own messages are only heartbeats and the last
ones (SAFE, BYE).
"""

from __future__ import annotations

import random
import signal
import sys
import threading
import time
from collections import deque
from typing import BinaryIO

from campaign.errors import UsageError
from campaign.link.pipe import BEAT, WANTED, Kind, receive, send
from campaign.link.port import Port, open_port
from campaign.link.safe import SafeWatch
from campaign.wire.messages import Bye, Heartbeat, Safe, framed

HEARTBEAT_INTERVAL = 0.025
"""s; a controller stops after 100 ms without a heartbeat."""
LAST_WORDS = 2.0
"""Longest time (s) for which an orphaned relay sends SAFE until it is confirmed."""
SAFE_INTERVAL = 0.02
LAPSE = 0.05
"""Longest delay (s) of a heartbeat; after a longer one, the controller may have timed out."""
ECHO = 0.3
"""Time limit (s) for the controller to echo a heartbeat of its host."""
BEATS = 400
"""Number of latest heartbeats whose echo is recognized."""


class Relay:
    """Forwarder of bytes between an open port and the parent, with heartbeats."""

    def __init__(self, port: Port, parent: BinaryIO, session: int) -> None:
        """`session`: session of the host, sent in heartbeats and last messages."""
        self._port = port
        self._session = session
        self._holds = False  # whether the controller has accepted the session
        self._parent: BinaryIO | None = parent
        self._writing, self._telling = threading.RLock(), threading.RLock()
        self._wanted = (0, 0)  # trial, record
        self._counter = random.SystemRandom().randrange(2**32)  # differs from other relays'
        self._lapsed = False  # whether heartbeats were so late that the controller may be lost
        self._beats: deque[tuple[int, float]] = deque(maxlen=BEATS)
        self._watch: SafeWatch | None = None
        self._quiet = threading.Event()  # set: no more heartbeats
        self._lost = threading.Event()

    def start(self) -> None:
        """Start reading the port and sending heartbeats."""
        for work in (self._read, self._beat):
            threading.Thread(target=work, daemon=True).start()

    def serve(self, commands: BinaryIO) -> None:
        """Execute commands of the parent until its pipe closes or the line is lost."""
        while not self._lost.is_set():
            item = receive(commands)
            if item is None:
                return
            kind, payload = item
            if kind is Kind.WRITE:
                self._write(payload)
            elif kind is Kind.WANTED:
                trial, record, at_once = WANTED.unpack(payload)
                self._wanted = trial, record
                if at_once:
                    self._heartbeat()
            elif kind is Kind.HOLDS:
                self._holds = bool(payload[0])

    def make_safe(self) -> bool:
        """Send SAFE without a host until it is confirmed, then BYE; return whether it was.

        Sends nothing, and returns True, if the controller has not accepted the session, or another
        host holds it now: SAFE would stop that host's run.
        """
        self._quiet.set()
        if not self._holds or (self._lapsed and self._is_anothers()):
            return True
        seen = self._seen_safe()
        self._write(framed(Bye(self._session)))
        return seen

    def _is_anothers(self) -> bool:
        """Whether the controller echoes heartbeats of another host, not of this relay."""
        watch = SafeWatch()
        self._watch = watch
        end = time.monotonic() + ECHO
        while not self._lost.is_set() and time.monotonic() < end:
            self._heartbeat()
            time.sleep(SAFE_INTERVAL)
            if watch.last is not None and (self._counter - watch.last.heartbeat) % 2**32 < BEATS:
                return False
        return watch.last is not None

    def _seen_safe(self) -> bool:
        watch = SafeWatch()
        self._watch = watch
        end = time.monotonic() + LAST_WORDS
        while not self._lost.is_set() and time.monotonic() < end:
            self._write(framed(Safe(self._session)))
            if watch.confirmed.wait(SAFE_INTERVAL):
                return True
        return False

    def _read(self) -> None:
        try:
            while True:
                data = self._port.read()
                if data and self._watch is not None:
                    self._watch.feed(data)
                if data:
                    self._tell_beats()
                    self._tell(Kind.BYTES, data)
        except OSError as error:
            self._lose(error)

    def _tell_beats(self) -> None:
        """Report sent heartbeats, in the reading thread: a hanging host must not block sending."""
        while self._beats:
            self._tell(Kind.BEAT, BEAT.pack(*self._beats.popleft()))

    def _beat(self) -> None:
        due = time.monotonic()
        while not self._quiet.is_set() and not self._lost.is_set():
            self._lapsed = self._lapsed or time.monotonic() > due + LAPSE
            self._heartbeat()
            due = max(due + HEARTBEAT_INTERVAL, time.monotonic())
            self._quiet.wait(max(0.0, due - time.monotonic()))

    def _heartbeat(self) -> None:
        with self._writing:
            self._counter = (self._counter + 1) % 2**32
            self._beats.append((self._counter, time.monotonic()))
            self._write(framed(Heartbeat(self._counter, *self._wanted, self._session)))

    def _write(self, data: bytes) -> None:
        try:
            with self._writing:
                self._port.write(data)
        except OSError as error:
            self._lose(error)

    def _lose(self, error: OSError) -> None:
        if not self._lost.is_set():
            self._lost.set()
            self._tell(Kind.LOST, (error.strerror or str(error)).encode())

    def _tell(self, kind: Kind, payload: bytes) -> None:
        if self._parent is None:
            return
        try:
            with self._telling:
                send(self._parent, kind, payload)
        except (OSError, ValueError):
            self._parent = None  # the parent has exited; the remaining work does not need it


def main(name: str, baud: int, session: int) -> int:
    """Serve one parent until it exits; return 0 if the bench is then safe, else 5 (2: no port)."""
    # The parent handles Ctrl-C and a closing terminal: it stops in order, through this relay.
    for stop in ("SIGINT", "SIGHUP"):
        if hasattr(signal, stop):
            signal.signal(getattr(signal, stop), signal.SIG_IGN)
    commands, parent = sys.stdin.buffer, sys.stdout.buffer
    try:
        port = open_port(name, baud, exclusive=True)
    except UsageError as error:
        send(parent, Kind.REFUSED, str(error).encode())
        return 2
    send(parent, Kind.OPENED)
    relay = Relay(port, parent, session)
    relay.start()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0 if relay.make_safe() else 5))
    relay.serve(commands)
    return 0 if relay.make_safe() else 5


if __name__ == "__main__":
    import os

    # Not sys.exit: a thread that waits for a port or a pipe must not keep the process alive.
    os._exit(main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3])))
