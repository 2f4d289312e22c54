"""Stopping a run from outside: once asks, twice insists."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType

_NOTICE = (
    "\nstopping: the running trial is stopped, then the archive is closed, which can take some "
    "seconds; Ctrl-C again leaves it unclosed\n"
)
_HANG_UP: signal.Signals | None = getattr(signal, "SIGHUP", None)  # Windows has none


class StopSwitch:
    """Calling it says whether somebody asked the run to stop.

    The first SIGINT (Ctrl-C), SIGTERM or SIGHUP (the terminal is gone) only sets it: running trials
    see it and end, the bench is made safe and the archive is closed. A second SIGINT or SIGTERM
    raises KeyboardInterrupt where the program stands; a second SIGHUP does not, because shell and
    kernel both send one when a terminal closes, and nobody insists.
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
        """Listen to SIGINT, SIGTERM and SIGHUP inside the block. Main thread only.

        A SIGHUP that was ignored before stays ignored: that is what nohup is for.
        """
        before = {number: signal.signal(number, self._handle) for number in _stopping_signals()}
        try:
            yield self
        finally:
            for number, handler in before.items():
                if handler is not None:  # None: not set from Python, and not ours to put back
                    signal.signal(number, handler)

    def _handle(self, number: int, frame: FrameType | None) -> None:
        if self():
            if number == _HANG_UP:
                return
            raise KeyboardInterrupt
        self.request("Ctrl-C" if number == signal.SIGINT else signal.Signals(number).name)
        # Not through sys.stderr: its buffer may be what the signal has interrupted.
        with suppress(OSError):  # nobody may be there to read it
            os.write(sys.__stderr__.fileno() if sys.__stderr__ else 2, _NOTICE.encode())


def _stopping_signals() -> list[signal.Signals]:
    numbers = [signal.SIGINT, signal.SIGTERM]
    if _HANG_UP is not None and signal.getsignal(_HANG_UP) is not signal.SIG_IGN:
        numbers.append(_HANG_UP)
    return numbers
