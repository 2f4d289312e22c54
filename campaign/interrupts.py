"""Ctrl-C outside of a run: immediate exit, or orderly cleanup.

An exception out of a signal handler breaks whatever it meets: an import that turns it into another
error, a weak reference's callback that drops it. So the program is left at once wherever there is
nothing to clean up, which is nearly everywhere; what writes files asks for KeyboardInterrupt. While
a run executes, `campaign.execution.stop` listens in its own way.
"""

from __future__ import annotations

import os
import signal
import sys
from contextlib import contextmanager, suppress

# Imported first of all, so nothing heavy here: no `typing`.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Iterator
    from sys import UnraisableHookArgs
    from types import FrameType
    from typing import NoReturn

INTERRUPTED = 130
_unwinds = False
_listens = False


def listen() -> None:
    """Leave at Ctrl-C, from now on. Main thread only."""
    global _listens
    _listens = True
    signal.signal(signal.SIGINT, _handle)
    sys.unraisablehook = _unraisable


def is_program() -> bool:
    """Whether this process is the command line, and no other program that uses its modules."""
    return _listens


@contextmanager
def unwinding() -> Iterator[None]:
    """Inside the block Ctrl-C is a KeyboardInterrupt; a second one leaves at once."""
    global _unwinds
    before, _unwinds = _unwinds, True
    try:
        yield
    finally:
        _unwinds = before


def deaf() -> None:
    """All is done but for ending: Ctrl-C changes nothing any more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def leave() -> NoReturn:
    """Say that somebody interrupted, and end."""
    with suppress(OSError):  # nobody may be there to read it
        os.write(2, b"campaign: interrupted\n")
    os._exit(INTERRUPTED)


def _handle(number: int, frame: FrameType | None) -> None:
    global _unwinds
    if not _unwinds:
        leave()
    _unwinds = False
    raise KeyboardInterrupt


def _unraisable(unraisable: UnraisableHookArgs) -> None:
    if unraisable.exc_type is KeyboardInterrupt:
        leave()  # dropped where nothing can be raised
    sys.__unraisablehook__(unraisable)
