"""Lock of a run: one writing process, until it is sealed or released.

The system releases a lock when its process ends in any way, so a kill leaves at most an empty
hidden file without a lock.
"""

from __future__ import annotations

import contextlib
import os
import time
from pathlib import Path
from typing import Self

from campaign.errors import UsageError

_TRIES, _PAUSE = 5, 0.01
"""Number of attempts, and pause (s) between them: listing runs holds a lock for an instant."""


class RunLock:
    """The right to write the run `name`: `acquire`, then `release`."""

    def __init__(self, path: Path, name: str, descriptor: int) -> None:
        self.name = name
        self._path = path
        self._descriptor = descriptor

    @classmethod
    def acquire(cls, results: Path, name: str) -> Self:
        """Acquire the lock of run `name`.

        Raises:
            UsageError: another process has it.
            OSError: nothing can be written in `results`.
        """
        path = results / f".{name}.lock"
        while True:
            descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
            if not _lock_soon(descriptor):
                os.close(descriptor)
                raise UsageError(
                    f"{results}: another process is writing the run {name!r}; wait for its end"
                )
            if _is_still(path, descriptor):
                return cls(path, name, descriptor)
            os.close(descriptor)  # its last owner removed the file while this process waited

    def release(self) -> None:
        """Release the lock; a second call does nothing."""
        if self._descriptor < 0:
            return
        with contextlib.suppress(OSError):  # Windows cannot remove an open file: it stays, unlocked
            self._path.unlink(missing_ok=True)
        os.close(self._descriptor)
        self._descriptor = -1


def _is_still(path: Path, descriptor: int) -> bool:
    """Whether `path` is still the locked file, and not a new one after its removal."""
    try:
        return os.path.samestat(path.stat(), os.fstat(descriptor))
    except FileNotFoundError:
        return False


def _lock_soon(descriptor: int) -> bool:
    """Try to lock, several times; return whether it succeeded."""
    for _ in range(_TRIES):
        if _lock(descriptor):
            return True
        time.sleep(_PAUSE)
    return False


def _lock(descriptor: int) -> bool:
    """Try to lock; return False if busy. A file system without locks counts as locked."""
    if os.name == "nt":
        import msvcrt

        lock, busy = msvcrt.locking, (OSError,)  # type: ignore[attr-defined]
        arguments: tuple[int, ...] = (msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
    else:
        import fcntl

        lock, busy = fcntl.flock, (BlockingIOError,)
        arguments = (fcntl.LOCK_EX | fcntl.LOCK_NB,)
    try:
        lock(descriptor, *arguments)
    except busy:
        return False
    except OSError:
        return True
    return True
