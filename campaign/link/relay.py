"""The process that owns the port: `python -m campaign.link.relay PORT BAUD SESSION`.

The host starts it. It is a process of its own so that no analysis, disk or crash of the host can
starve the heartbeats, and so that somebody is left to send SAFE when the host is killed. It imports
neither numpy nor pydantic, forwards bytes both ways, and speaks the protocol itself only for
heartbeats and its last words.
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
from campaign.link.safe import SafeWatch, bye_frame, heartbeat_frame, safe_frame

HEARTBEAT_INTERVAL = 0.025
"""s; a controller stops by itself after 100 ms without one."""
LAST_WORDS = 2.0
"""s for which an orphaned relay goes on sending SAFE unless it is confirmed before."""
SAFE_INTERVAL = 0.02
LAPSE = 0.05
"""s that a heartbeat may be late; later, a controller may have taken it for silence."""
ECHO = 0.3
"""s in which the controller says whose it is."""
BEATS = 400
"""Heartbeats whose echo is remembered."""


class Relay:
    """Bytes both ways between an open port and the parent, with heartbeats beside them."""

    def __init__(self, port: Port, parent: BinaryIO, session: int) -> None:
        """`session`: the host's, which the heartbeats and the last words carry."""
        self._port = port
        self._session = session
        self._holds = False  # whether the controller has accepted the session
        self._parent: BinaryIO | None = parent
        self._writing, self._telling = threading.RLock(), threading.RLock()
        self._wanted = (0, 0)  # trial, record
        self._counter = random.SystemRandom().randrange(2**32)  # no other relay's echo is ours
        self._lapsed = False  # whether heartbeats were late enough to lose the controller
        self._beats: deque[tuple[int, float]] = deque(maxlen=BEATS)
        self._watch: SafeWatch | None = None
        self._quiet = threading.Event()  # set: no more heartbeats
        self._lost = threading.Event()

    def start(self) -> None:
        """Begin to read the port and to send heartbeats."""
        for work in (self._read, self._beat):
            threading.Thread(target=work, daemon=True).start()

    def serve(self, commands: BinaryIO) -> None:
        """Do what the parent says until its pipe closes or the line is lost."""
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
        """Nobody is left to command: send SAFE until it is confirmed; False when it never was.

        Nothing is sent to a controller that has not accepted the session, or no longer answers it:
        a SAFE would be a stranger's there, and stop another host's run.
        """
        self._quiet.set()
        if not self._holds or (self._lapsed and self._is_anothers()):
            return True
        seen = self._seen_safe()
        self._write(bye_frame(self._session))
        return seen

    def _is_anothers(self) -> bool:
        """Whether the controller answers a heartbeat of ours with the counter of another host's."""
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
            self._write(safe_frame(self._session))
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
        """Here and not where they are sent: a host that hangs must not stop the heartbeats."""
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
            self._write(heartbeat_frame(self._counter, *self._wanted, self._session))

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
            self._parent = None  # it has gone; what is left to do needs no listener


def main(name: str, baud: int, session: int) -> int:
    """Serve one parent until it goes; 0 when the bench was then seen safe, else 5 (2: no port)."""
    # Ctrl-C and a closing terminal are the parent's business: it stops in order, with our help.
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

    # Not sys.exit: a thread that waits for a port or a pipe must not keep the process.
    os._exit(main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3])))
