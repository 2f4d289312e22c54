"""Stopping a run from outside: once asks, twice insists."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_NOTICE = "\nstopping: the running trial ends first; Ctrl-C again stops now\n"


class StopSwitch:
    """Calling it says whether somebody asked the run to stop.

    The first SIGINT (Ctrl-C) or SIGTERM only sets it: running trials see it and end, the bench is
    made safe and the archive is closed. A second one raises KeyboardInterrupt where the program
    stands.
    """

    def __init__(self) -> None:
        self._reason = ""

    def __call__(self) -> bool:
        return bool(self._reason)

    @property
    def reason(self) -> str:
        """Who asked, or the empty text."""
        return self._reason

    def request(self, reason: str) -> None:
        """Ask the run to stop; a second request changes nothing."""
        self._reason = self._reason or reason

    @contextmanager
    def on_signals(self) -> Iterator[StopSwitch]:
        """Listen to SIGINT and SIGTERM inside the block. Main thread only."""
        before = {
            number: signal.signal(number, self._handle)
            for number in (signal.SIGINT, signal.SIGTERM)
        }
        try:
            yield self
        finally:
            for number, handler in before.items():
                if handler is not None:  # None: not set from Python, and not ours to put back
                    signal.signal(number, handler)

    def _handle(self, number: int, frame: FrameType | None) -> None:
        if self():
            raise KeyboardInterrupt
        self.request("Ctrl-C" if number == signal.SIGINT else signal.Signals(number).name)
        # Not through sys.stderr: its buffer may be what the signal has interrupted.
        os.write(sys.__stderr__.fileno() if sys.__stderr__ else 2, _NOTICE.encode())
