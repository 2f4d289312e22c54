"""The latch: after a stop by another host the controller refuses to arm.

It is written to permanent memory, here a file, before it is reported. A controller without such
memory does not know whether it was stopped, so it starts latched. A missing file is no memory: only
a file can state that the controller was never stopped.
"""

from __future__ import annotations

import contextlib
import errno
import os
import time
from collections.abc import Callable
from pathlib import Path

from pydantic import BaseModel, Field, FiniteFloat, StrictBool

from campaign.archive.layout.files import write_atomically
from campaign.plain_text import printable
from campaign.wire.device import Latch
from campaign.wire.fields import clipped
from campaign.wire.messages import LatchCause

MOST = 2**32


class Stop(BaseModel, frozen=True):
    """Content of the permanent memory, as JSON.

    Attributes:
        count: number of stops so far, required to clear the latest one.
        by: sender of the SAFE.
        at: its time on the wall clock (s since 1970), the only clock that continues over a reset;
            None if unknown.
    """

    latched: StrictBool
    count: int = Field(strict=True, ge=0, lt=MOST)
    cause: LatchCause
    by: str
    at: FiniteFloat | None


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
        self.stop = _read(file) or Stop(
            latched=True, count=boot, cause=LatchCause.NO_MEMORY, by="", at=None
        )

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
        at = self._wall_clock()
        self.stop = Stop(latched=True, count=count, cause=LatchCause.STOPPED, by=by, at=at)
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
        cleared = {"latched": False, "cause": LatchCause.NONE}
        self._keep(self.stop.model_copy(update=cleared))
        self._session = 0
        return True

    def _keep(self, stop: Stop) -> None:
        if self._file is not None:
            write_atomically(self._file, stop.model_dump_json())
        self.stop = stop
        self._remembered = True


def new_memory(file: Path) -> None:
    """Write the memory of a controller that was never stopped.

    Raises FileExistsError if the path exists, because it may contain a stop; OSError.
    """
    if os.path.lexists(file):
        raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(file))
    never = Stop(latched=False, count=0, cause=LatchCause.NONE, by="", at=None)
    write_atomically(file, never.model_dump_json())


def _read(file: Path | None) -> Stop | None:
    """Content of the file; None if it is missing or invalid."""
    if file is None:
        return None
    try:
        stop = Stop.model_validate_json(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return stop.model_copy(update={"by": clipped(printable(stop.by))})
