"""The latch: after a stop by another host the controller refuses to arm.

It is written to permanent memory, here a file, before it is reported. A controller without such
memory does not know whether it was stopped, so it starts latched. A missing file is no memory: only
a file can state that the controller was never stopped.
"""

from __future__ import annotations

import contextlib
import errno
import json
import math
import os
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from campaign.archive.layout.files import write_atomically
from campaign.plain_text import printable
from campaign.wire.device import Latch
from campaign.wire.fields import clipped
from campaign.wire.messages import LatchCause

MOST = 2**32


@dataclass(frozen=True)
class Stop:
    """Content of the permanent memory.

    Attributes:
        count: number of stops so far, required to clear the latest one.
        by: sender of the SAFE.
        at: its time on the wall clock (s since 1970), the only clock that continues over a reset;
            None if unknown.
    """

    latched: bool = False
    count: int = 0
    cause: LatchCause = LatchCause.NONE
    by: str = ""
    at: float | None = None


class LatchMemory:
    """The latch of one controller, in a file or, without a file, in no permanent memory."""

    def __init__(
        self, file: Path | None, boot: int, wall_clock: Callable[[], float] = time.time
    ) -> None:
        """Start as after a reset. Without memory, the stop has the number `boot`, new each time."""
        self._file = file
        self._wall_clock = wall_clock
        self._session = 0  # session of the last stop, to recognize its repetition
        self._remembered = True
        self.stop = _read(file) or Stop(True, boot, LatchCause.NO_MEMORY)

    @property
    def latched(self) -> bool:
        """Whether arming is refused."""
        return self.stop.latched

    def message(self) -> Latch:
        """Message to a host."""
        stop = self.stop
        age = None if stop.at is None else max(0.0, self._wall_clock() - stop.at)
        return Latch(stop.latched, stop.count, stop.cause, age, stop.by)

    def set(self, session: int, by: str) -> bool:
        """Register a stop by SAFE; return whether it is a new one.

        Repeated SAFE messages of one session are one stop. Each SAFE without a session is a new
        stop: it may be from another sender, and not yet noticed by a user.
        """
        again = self.latched and session != 0 and session == self._session
        self._session = session
        if again:
            self.remember()
            return False
        count = (self.stop.count + 1) % MOST
        self.stop = Stop(True, count, LatchCause.STOPPED, by, self._wall_clock())
        self._remembered = False
        self.remember()
        return True

    def remember(self) -> None:
        """Retry a failed write: a full disk must not prevent a stop, which remains in effect
        until the controller is switched off.
        """
        if not self._remembered:
            with contextlib.suppress(OSError):
                self._keep(self.stop)

    def clear(self, count: int) -> bool:
        """Clear stop number `count`; return False if it is not the present one.

        Raises OSError if the write fails: it then stays latched.
        """
        if not self.latched or count != self.stop.count:
            return False
        self._keep(replace(self.stop, latched=False, cause=LatchCause.NONE))
        self._session = 0
        return True

    def _keep(self, stop: Stop) -> None:
        if self._file is not None:
            write_atomically(self._file, json.dumps(asdict(stop)))
        self.stop = stop
        self._remembered = True


def new_memory(file: Path) -> None:
    """Write the memory of a controller that was never stopped.

    Raises FileExistsError if the path exists, because it may contain a stop; OSError.
    """
    if os.path.lexists(file):
        raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(file))
    write_atomically(file, json.dumps(asdict(Stop())))


def _read(file: Path | None) -> Stop | None:
    """Content of the file; None if it is missing or invalid."""
    if file is None:
        return None
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return None
    try:
        tree = json.loads(text)
        at = None if tree["at"] is None else float(tree["at"])
        if at is not None and not math.isfinite(at):
            return None
        cause, count = LatchCause(tree["cause"]), tree["count"]
        if not (isinstance(tree["latched"], bool) and type(count) is int and 0 <= count < MOST):
            return None
        return Stop(tree["latched"], count, cause, clipped(printable(str(tree["by"]))), at)
    except (ValueError, TypeError, KeyError, OverflowError, RecursionError):
        return None
