"""Access of `campaign stop` and `campaign status` to a drive, and the latch that a drive lacks.

Both commands use the frames of the serial protocol. This module answers them for a drive: in the
process that owns the bus, at a local TCP port, or, without one, in the command itself.
"""

from __future__ import annotations

import contextlib
import os
import socketserver
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from campaign.canopen_drive.address import Address, read_tree, write_whole
from campaign.canopen_drive.drive import REST_TIME, Drive, DriveError, RestWatch
from campaign.canopen_drive.state import State as DriveState
from campaign.plain_text import printable
from campaign.wire.codes import Fault, Kind, LatchCause, State, WireError
from campaign.wire.frames import FrameDecoder
from campaign.wire.messages import Ack, Holder, Query, Safe, Status, decode, framed
from campaign.wire.messages import Latch as LatchMessage

POLL = 0.05
"""s; longest wait of a read."""
STOPPING = 2.0
"""s; duration of one attempt to bring the drive to rest."""
UNREADABLE = "a file of this computer that cannot be read"


class Latch:
    """Latch of the last external stop, in a file of this computer: a drive has none."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._kept: dict[str, Any] = {}  # a stop that is perhaps not in the file
        self._changing = threading.Lock()  # clearing a stop must not lose the next one
        self._at_work: threading.Thread | None = None

    def stop(self, by: str) -> None:
        """Latch a stop in this process; `write` stores it in the file."""
        with self._changing:
            count = int(self._tree().get("count", 0)) + 1
            self._kept = {"latched": True, "count": count, "by": by, "at": time.time()}

    def hold(self, bring_to_rest: Callable[[float], object]) -> None:
        """Bring the drive to rest in a separate thread, unless the stop is cleared."""
        with self._changing:
            if self.now() and (self._at_work is None or not self._at_work.is_alive()):
                work = threading.Thread(target=bring_to_rest, args=(STOPPING,), daemon=True)
                self._at_work = work
                work.start()

    def wait(self) -> None:
        """Wait for the end of the attempt to bring the drive to rest."""
        if self._at_work is not None:
            self._at_work.join()

    def write(self) -> None:
        """Store the stop in the file. Raises OSError."""
        with self._changing:
            if self._kept:
                write_whole(self._path, self._kept)

    def now(self) -> tuple[int, str, float | None] | None:
        """Count, source, and age (s) of the latched stop; None without one."""
        tree = self._tree()
        if not tree.get("latched"):
            return None
        at = tree.get("at")
        age = max(0.0, time.time() - at) if isinstance(at, int | float) else None
        return int(tree.get("count", 0)), str(tree.get("by", "")), age

    def clear(self, count: int) -> bool:
        """Clear the stop, so that the drive can move again; False if it is not the latest stop."""
        with self._changing:
            latched = self.now()
            if latched is None or latched[0] != count:
                return False
            write_whole(self._path, {"latched": False, "count": count})
            self._kept = {}
        self.wait()  # a late quick stop would end the next trial
        return True

    def _tree(self) -> dict[str, Any]:
        try:
            tree = read_tree(self._path) or {}
            int(tree.get("count", 0))
        except (OSError, ValueError, TypeError):
            tree = {"latched": True, "by": UNREADABLE}
        newer = self._kept.get("count", 0) > tree.get("count", 0)
        return self._kept if newer else tree


@dataclass
class Desk:
    """Answers QUERY and SAFE for one drive. One thread at a time.

    Attributes:
        running: whether a trial moves the drive now.
        stop: ends that trial immediately; its argument is the source of the stop.
        host: host that runs trials, or empty.
    """

    drive: Drive
    latch: Latch
    running: Callable[[], bool] = lambda: False
    stop: Callable[[str], None] = lambda by: None
    host: str = ""

    def __post_init__(self) -> None:
        self._decoder = FrameDecoder()
        self._stopped = 0  # session whose SAFE is latched

    def feed(self, data: bytes) -> bytes:
        """The answers to received frames, one per kind of message."""
        answers = {}
        for frame in self._decoder.feed(data):
            with contextlib.suppress(WireError):
                answers[frame.kind] = frame.sequence, decode(frame.kind, frame.body)
        reply = b""
        for sequence, message in answers.values():
            if isinstance(message, Safe):
                self._safe(message)
                reply += framed(Ack(sequence, Kind.SAFE, State.SAFE, 1))
            elif isinstance(message, Query):
                reply += framed(Holder(bool(self.host), 0.0 if self.host else None, self.host))
        return reply + framed(self._status()) + framed(self._latched()) if reply else b""

    def _safe(self, message: Safe) -> None:
        by = printable(message.host) or "an unnamed host"
        if not self._stopped or message.session != self._stopped:
            self._stopped = message.session
            self.latch.stop(by)
            self.stop(by)
        self.latch.hold(self.drive.bring_to_rest)
        self.latch.write()  # last: a full disk must not prevent the stop

    def _status(self) -> Status:
        running, state, at_rest = self.running(), None, False
        if not running:
            with contextlib.suppress(DriveError):
                watch = RestWatch(self.drive.address.rest)
                watch.seen(self.drive.look()[1])
                time.sleep(REST_TIME)
                state, position = self.drive.look()
                at_rest = watch.seen(position)
        on = running or state is None or not state.off
        shown_state, fault = State.RUNNING if on else State.IDLE, Fault.NONE
        if state is DriveState.FAULT:
            shown_state, fault = State.FAULT, Fault.DRIVE
        elif not on and self.latch.now() is not None:
            shown_state = State.SAFE
        return Status(shown_state, fault, at_rest, on, 1, time.monotonic(), 0, 0.0, 0, 0, 0, 0)

    def _latched(self) -> LatchMessage:
        latched = self.latch.now()
        if latched is None:
            return LatchMessage(latched=False, count=0, cause=LatchCause.NONE, age=None)
        count, by, age = latched
        return LatchMessage(latched=True, count=count, cause=LatchCause.STOPPED, age=age, by=by)


class DirectLine:
    """Port with the bytes of the serial protocol, for a drive that no other process serves."""

    def __init__(self, address: Address) -> None:
        """Raises UsageError."""
        self._drive = Drive(address)
        self._latch = Latch(address.file("latch"))
        self._desk = Desk(self._drive, self._latch)
        self._answers = b""

    def read(self) -> bytes:
        """The answers, after at most `POLL`."""
        if not self._answers:
            time.sleep(POLL)
        answers, self._answers = self._answers, b""
        return answers

    def write(self, data: bytes) -> None:
        """Receive a command and execute it."""
        self._answers += self._desk.feed(data)

    def close(self) -> None:
        """Release the bus after the drive is stopped; an error of the disk may close it earlier."""
        self._latch.wait()
        self._drive.close()


class Counter(socketserver.ThreadingTCPServer):
    """Serves a desk at a local TCP port; `campaign stop` reads the port number from a file."""

    daemon_threads = True

    def __init__(self, address: Address, make: Callable[[], Desk]) -> None:
        class Answering(socketserver.BaseRequestHandler):
            def handle(self) -> None:
                desk = make()
                with contextlib.suppress(OSError):
                    while data := self.request.recv(65536):
                        self.request.sendall(desk.feed(data))

        super().__init__(("127.0.0.1", 0), Answering)
        self._file = address.file("port")
        write_whole(self._file, {"port": self.server_address[1], "pid": os.getpid()})
        threading.Thread(target=self.serve_forever, args=(POLL,), daemon=True).start()

    def close(self) -> None:
        """Remove the file and stop serving."""
        self._file.unlink(missing_ok=True)
        self.shutdown()
        self.server_close()
