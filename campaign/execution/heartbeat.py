"""Signs of life to the guardian, from the loops that watch a bench that may move.

Each of these loops sends them itself. A thread of their own would send them while a loop hangs.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from campaign.execution.guardian import BEAT, REST

INTERVAL = 0.5
"""s between two signs of life."""


class Heartbeat:
    """Counts the loops at work. The guardian expects signs of life while there is one."""

    def __init__(self) -> None:
        self._tell: Callable[[bytes], None] = lambda data: None
        self._loops = 0
        self._counting = threading.Lock()
        self._due = 0.0

    def goes_to(self, tell: Callable[[bytes], None]) -> None:
        """Send to a guardian from now on."""
        self._tell = tell

    @contextmanager
    def expected(self) -> Iterator[None]:
        """Inside the block the guardian expects `beat`."""
        with self._counting:
            self._loops += 1
            self._tell(bytes((BEAT,)))
        try:
            yield
        finally:
            with self._counting:
                self._loops -= 1
                if not self._loops:
                    self._tell(bytes((REST,)))

    def beat(self) -> None:
        """One turn of a loop; most turns send nothing."""
        now = time.monotonic()
        if now >= self._due:
            self._due = now + INTERVAL
            self._tell(bytes((BEAT,)))


HEARTBEAT = Heartbeat()
"""Of this process, which has one guardian at most."""
