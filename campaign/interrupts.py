"""Ctrl-C outside of a run: immediate exit, or orderly cleanup.

An exception from a signal handler is unreliable: an import converts it into another error, a weak
reference's callback drops it. The program therefore exits immediately if it has nothing to clean
up; code that writes files requests KeyboardInterrupt by `unwinding`. During a run,
`campaign.execution.stop` handles the signals.
"""

from __future__ import annotations

import os
import signal
import sys
from contextlib import contextmanager, suppress

# The first import of the program: no heavy modules here, not even `typing`.
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
    """Install the handler that exits at Ctrl-C. Main thread only."""
    global _listens
    _listens = True
    signal.signal(signal.SIGINT, _handle)
    sys.unraisablehook = _unraisable


def is_program() -> bool:
    """Whether this process is the command line, not another program that uses its modules."""
    return _listens


@contextmanager
def unwinding() -> Iterator[None]:
    """Inside the block Ctrl-C raises KeyboardInterrupt; a second one exits immediately."""
    global _unwinds
    before, _unwinds = _unwinds, True
    try:
        yield
    finally:
        _unwinds = before


def deaf() -> None:
    """Ignore Ctrl-C from now on, while the program exits."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def leave() -> NoReturn:
    """Report the interruption, and exit."""
    with suppress(OSError):  # stderr may be closed
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
        leave()  # Python dropped it in a place that cannot raise
    sys.__unraisablehook__(unraisable)
