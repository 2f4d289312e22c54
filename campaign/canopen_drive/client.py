"""The host's side of the relay: requests, answers, samples."""

from __future__ import annotations

import contextlib
import json
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from typing import Any, BinaryIO, cast

from campaign.canopen_drive.drive import DriveError
from campaign.canopen_drive.objects import Item
from campaign.errors import UsageError

OPENING = 20.0
"""s that the relay may take to open the bus; some adapters wait before they answer."""
LEAVING = 3.5
"""s that it may take to leave."""
ANSWER = 10.0
"""s for an answer to a request; the relay asks the drive twice."""
GONE = "the process that owns the bus has ended"

Start = Callable[[str], tuple[BinaryIO, BinaryIO, Callable[[float], None]]]
"""Starts a relay for an address: its input, its output, and what waits for its end (s)."""


def start_process(address: str) -> tuple[BinaryIO, BinaryIO, Callable[[float], None]]:
    """A relay as a process of its own."""
    # A session of its own: Ctrl-C in a terminal is for the host, which then stops in order.
    # -P: nothing in the user's folder can stand in for a module of ours.
    process = subprocess.Popen(  # noqa: S603 - our own program, no shell
        [sys.executable, "-P", "-m", "campaign.canopen_drive.relay", address],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        start_new_session=True,
    )

    def wait(patience: float) -> None:
        try:
            process.wait(patience)
        except subprocess.TimeoutExpired:
            process.kill()  # the drive stops when its heartbeat ends
            process.wait()

    return cast(BinaryIO, process.stdin), cast(BinaryIO, process.stdout), wait


class Client:
    """An open relay. Any thread may ask; one trial at a time is played.

    Attributes:
        played: what comes during a trial: samples, lost samples, and its end (None: no relay).
    """

    def __init__(self, address: str, start: Start = start_process) -> None:
        """Raises UsageError when the bus cannot be opened."""
        self._out, self._in, self._wait = start(address)
        self._sending, self._number = threading.Lock(), 0
        self._answers: dict[int, queue.SimpleQueue[dict[str, Any]]] = {}
        self._lost = False
        self.played: queue.SimpleQueue[dict[str, Any] | None] = queue.SimpleQueue()
        opened: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
        self._opened = opened
        self._reader = threading.Thread(target=self._read, name="can", daemon=True)
        self._reader.start()
        try:
            first = opened.get(timeout=OPENING)
        except queue.Empty:
            first = {"error": f"port {address!r} did not open in time"}
        if not first.get("opened"):
            self.close()
            raise UsageError(str(first.get("error") or GONE))

    def read(self, item: Item) -> int:
        """An object of the drive. Raises DriveError."""
        return int(self.ask("read", **_told(item)))

    def write(self, item: Item, value: int) -> None:
        """Raises DriveError."""
        self.ask("write", value=value, **_told(item))

    def ask(self, what: str, wait: float = ANSWER, **arguments: Any) -> Any:
        """The answer to a request within `wait` (s). Raises DriveError."""
        answers: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
        number = self.tell(what, answers, **arguments)
        deadline = time.monotonic() + wait
        try:
            while True:
                with contextlib.suppress(queue.Empty):
                    answer = answers.get(timeout=0.1)
                    break
                if self._lost or time.monotonic() > deadline:
                    raise DriveError(GONE if self._lost else f"no answer to {what}", silent=True)
        finally:
            self._answers.pop(number, None)
        if "error" in answer:
            raise DriveError(answer["error"], silent=bool(answer.get("silent")))
        return answer["is"]

    def tell(
        self, what: str, answers: queue.SimpleQueue[Any] | None = None, **arguments: Any
    ) -> int:
        """Send a request; its answer goes to `answers`. Raises DriveError."""
        with self._sending:
            self._number += 1
            number = self._number
            if answers is not None:
                self._answers[number] = answers
            try:
                self._out.write(json.dumps({"id": number, "do": what, **arguments}).encode())
                self._out.write(b"\n")
                self._out.flush()
            except (OSError, ValueError):
                self._lost = True
                raise DriveError(GONE, silent=True) from None
        return number

    def play(self, job: dict[str, Any]) -> None:
        """Begin a trial; `played` has what comes of it. Raises DriveError."""
        self.played = queue.SimpleQueue()
        self.tell("play", self.played, **job)

    def close(self) -> None:
        """Let the relay go; it brings the drive to rest."""
        with contextlib.suppress(OSError):
            self._out.close()
        self._wait(LEAVING)
        self._reader.join(LEAVING)
        with contextlib.suppress(OSError):
            self._in.close()

    def _read(self) -> None:
        with contextlib.suppress(OSError, ValueError):
            for line in self._in:
                answer = json.loads(line)
                if "opened" in answer:
                    self._opened.put(answer)
                elif "id" in answer:
                    # An answer that is late, and awaited no more, is dropped.
                    if (asked := self._answers.pop(answer["id"], None)) is not None:
                        asked.put(answer)
                else:
                    self.played.put(answer)
        self._lost = True
        self._opened.put({"error": GONE})
        self.played.put(None)


def _told(item: Item) -> dict[str, Any]:
    return {"index": item.index, "sub": item.sub, "code": item.code, "name": item.name}
