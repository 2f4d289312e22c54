"""The host's side of the relay: requests, answers, samples."""

from __future__ import annotations

import contextlib
import json
import queue
import threading
from collections.abc import Callable
from dataclasses import astuple
from functools import partial
from typing import Any, BinaryIO, cast

from campaign.canopen_drive.drive import DriveError
from campaign.canopen_drive.objects import Item
from campaign.errors import UsageError
from campaign.processes import end_relay, start_relay

OPENING = 20.0
"""s; time limit of the relay to open the bus; some adapters are slow."""
LEAVING = 3.5
"""s; time limit of the relay to exit."""
ANSWER = 10.0
"""s; time limit of an answer; the relay tries an access to the drive twice."""
GONE = "the process that owns the bus has ended"

Answers = queue.SimpleQueue[dict[str, Any]]
Start = Callable[[str], tuple[BinaryIO, BinaryIO, Callable[[float], None]]]
"""Starts a relay for an address; its input, its output, a function that waits for its end (s)."""


def start_process(address: str) -> tuple[BinaryIO, BinaryIO, Callable[[float], None]]:
    """Start a relay in a separate process. If it is killed, the drive stops without heartbeat."""
    process = start_relay("campaign.canopen_drive.relay", address)
    ends = cast(BinaryIO, process.stdin), cast(BinaryIO, process.stdout)
    return *ends, partial(end_relay, process)


class Client:
    """Connection to a relay. Any thread may use it."""

    def __init__(self, address: str, start: Start = start_process) -> None:
        """Start a relay. Raises UsageError if the bus cannot be opened."""
        self._out, self._in, self._wait = start(address)
        self._sending, self._number, self._lost = threading.Lock(), 0, False
        opened: Answers = queue.SimpleQueue()
        self._answers = {0: opened}
        self._reader = threading.Thread(target=self._read, name="can", daemon=True)
        self._reader.start()
        try:
            first = opened.get(timeout=OPENING)
        except queue.Empty:
            first = {"error": f"port {address!r} did not open in time"}
        if "error" in first:
            self.close()
            raise UsageError(first["error"])

    def read(self, item: Item) -> int:
        """Read an object of the drive. Raises DriveError."""
        return int(self.ask("read", item=astuple(item)))

    def write(self, item: Item, value: int) -> None:
        """Write an object of the drive. Raises DriveError."""
        self.ask("write", value=value, item=astuple(item))

    def ask(self, what: str, wait: float = ANSWER, **arguments: Any) -> Any:
        """Send a request; its answer within `wait` (s). Raises DriveError."""
        answers: Answers = queue.SimpleQueue()
        number = self.tell(what, answers, **arguments)
        try:
            return checked(answers.get(timeout=wait))["is"]
        except queue.Empty:
            raise DriveError(f"no answer to {what}", silent=True) from None
        finally:
            self._answers.pop(number, None)

    def tell(self, what: str, answers: Answers | None = None, **arguments: Any) -> int:
        """Send a request; its number. The relay's answers go to `answers`. Raises DriveError.

        The last answer has the key `is` or `error`; samples of a trial precede it.
        """
        with self._sending:
            self._number += 1
            number = self._number
            if answers is not None:
                self._answers[number] = answers
            try:
                if self._lost:
                    raise OSError
                self._out.write(json.dumps({"id": number, "do": what, **arguments}).encode())
                self._out.write(b"\n")
                self._out.flush()
            except (OSError, ValueError):
                self._lost = True
                raise DriveError(GONE, silent=True) from None
        return number

    def close(self) -> None:
        """End the relay, which first brings the drive to rest."""
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
                asked = self._answers.get(answer["id"])
                if asked is not None:  # None: too late
                    asked.put(answer)
                if "is" in answer or "error" in answer:
                    self._answers.pop(answer["id"], None)
        self._lost = True
        for asked in list(self._answers.values()):
            asked.put({"error": GONE, "silent": True})


def checked(answer: dict[str, Any]) -> dict[str, Any]:
    """`answer`, unless it is an error. Raises DriveError."""
    if "error" in answer:
        raise DriveError(answer["error"], silent=bool(answer.get("silent")))
    return answer
