"""A drive as `campaign stop` and `campaign status` reach it, and the latch it does not have.

Both commands use the frames of the serial protocol. Here they are answered for a drive: by the
process that owns the bus, at a local TCP port, or, without one, by the command itself.
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
from campaign.wire.frames import FrameDecoder, encode_frame
from campaign.wire.messages import Ack, Holder, Message, Query, Safe, Status, decode, encode
from campaign.wire.messages import Latch as LatchMessage

POLL = 0.05
"""s that a read waits."""
STOPPING = 2.0
"""s of one attempt to bring the drive to rest."""
UNREADABLE = "a file of this computer that cannot be read"


class Latch:
    """The last stop from outside, in a file of this computer: a drive cannot hold one."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._kept: dict[str, Any] = {}  # a stop that may not be in the file
        self._changing = threading.Lock()  # who clears a stop must not lose the next one
        self._at_work: threading.Thread | None = None

    def stop(self, by: str) -> None:
        """Keep the drive off from now on: in this process at once, then in the file."""
        with self._changing:
            count = int(self._tree().get("count", 0)) + 1
            self._kept = {"latched": True, "count": count, "by": by, "at": time.time()}

    def hold(self, bring_to_rest: Callable[[float], object]) -> None:
        """Bring the drive to rest beside the caller, while the stop is not cleared."""
        with self._changing:
            if self.now() and (self._at_work is None or not self._at_work.is_alive()):
                work = threading.Thread(target=bring_to_rest, args=(STOPPING,), daemon=True)
                self._at_work = work
                work.start()

    def wait(self) -> None:
        """Until the attempt to bring the drive to rest has ended."""
        if self._at_work is not None:
            self._at_work.join()

    def write(self) -> None:
        """Remember the stop beyond this process. Raises OSError."""
        with self._changing:
            if self._kept:
                write_whole(self._path, self._kept)

    def now(self) -> tuple[int, str, float | None] | None:
        """Count, who it was, and the time since (s); None when nothing was stopped."""
        tree = self._tree()
        if not tree.get("latched"):
            return None
        at = tree.get("at")
        age = max(0.0, time.time() - at) if isinstance(at, int | float) else None
        return int(tree.get("count", 0)), str(tree.get("by", "")), age

    def clear(self, count: int) -> bool:
        """Let the drive move again; False when this is not the latest stop."""
        with self._changing:
            found = self.now()
            if found is None or found[0] != count:
                return False
            write_whole(self._path, {"latched": False, "count": count})
            self._kept = {}
        self.wait()  # a quick stop that is still sent would end the next trial
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
        stop: ends that trial at once, whoever says so.
        host: who runs trials, or empty.
    """

    drive: Drive
    latch: Latch
    running: Callable[[], bool] = lambda: False
    stop: Callable[[str], None] = lambda by: None
    host: str = ""

    def __post_init__(self) -> None:
        self._decoder = FrameDecoder()
        self._stopped = 0  # the session whose SAFE has been latched

    def feed(self, data: bytes) -> bytes:
        """The answers to what has come: one for all of a kind."""
        answers = {}
        for frame in self._decoder.feed(data):
            with contextlib.suppress(WireError):
                answers[frame.kind] = frame.sequence, decode(frame.kind, frame.body)
        told = b""
        for sequence, message in answers.values():
            if isinstance(message, Safe):
                self._safe(message)
                told += _frame(Ack(sequence, Kind.SAFE, State.SAFE, 1))
            elif isinstance(message, Query):
                told += _frame(Holder(bool(self.host), 0.0 if self.host else None, self.host))
        return told + _frame(self._status()) + _frame(self._latched()) if told else b""

    def _safe(self, message: Safe) -> None:
        by = printable(message.host) or "an unnamed host"
        if not self._stopped or message.session != self._stopped:
            self._stopped = message.session
            self.latch.stop(by)
            self.stop(by)
        self.latch.hold(self.drive.bring_to_rest)
        self.latch.write()  # last: a full disk must not keep the drive moving

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
        said, fault = State.RUNNING if on else State.IDLE, Fault.NONE
        if state is DriveState.FAULT:
            said, fault = State.FAULT, Fault.DRIVE
        elif not on and self.latch.now() is not None:
            said = State.SAFE
        return Status(said, fault, at_rest, on, 1, time.monotonic(), 0, 0.0, 0, 0, 0, 0)

    def _latched(self) -> LatchMessage:
        found = self.latch.now()
        if found is None:
            return LatchMessage(latched=False, count=0, cause=LatchCause.NONE, age=None)
        count, by, age = found
        return LatchMessage(latched=True, count=count, cause=LatchCause.STOPPED, age=age, by=by)


def _frame(message: Message) -> bytes:
    kind, body = encode(message)
    return encode_frame(kind, 0, body)


class DirectLine:
    """A drive that no other process serves, as a port with the bytes of the serial protocol."""

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
        """Take a command, and carry it out."""
        self._answers += self._desk.feed(data)

    def close(self) -> None:
        """Let go of the bus, once the drive was stopped: a full disk may end the line before."""
        self._latch.wait()
        self._drive.close()


class Counter(socketserver.ThreadingTCPServer):
    """Serves a desk at a local TCP port, which a file tells to `campaign stop`."""

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
        """No more."""
        self._file.unlink(missing_ok=True)
        self.shutdown()
        self.server_close()
