"""Lock of a run: one writing process, until it is sealed or released.

The system gives a lock up when its process ends, however it ends, so a kill leaves at most an empty
hidden file behind, which locks nothing.
"""

from __future__ import annotations

import contextlib
import os
import time
from pathlib import Path
from typing import Self

from campaign.errors import UsageError

_TRIES, _PAUSE = 5, 0.01
"""times, and s between them: who lists runs holds a lock for an instant."""


class RunLock:
    """The right to write the run `name`; `acquire` it, `release` it."""

    def __init__(self, path: Path, name: str, descriptor: int) -> None:
        self.name = name
        self._path = path
        self._descriptor = descriptor

    @classmethod
    def acquire(cls, results: Path, name: str) -> Self:
        """Take the lock of run `name`.

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
            os.close(descriptor)  # its last owner removed the name while we waited for it

    def release(self) -> None:
        """Give it up; the second time nothing happens."""
        if self._descriptor < 0:
            return
        with contextlib.suppress(OSError):  # Windows removes no open file: it stays, unlocked
            self._path.unlink(missing_ok=True)
        os.close(self._descriptor)
        self._descriptor = -1


def _is_still(path: Path, descriptor: int) -> bool:
    """Whether `path` is the file that was locked, and not one made after that was removed."""
    try:
        return os.path.samestat(path.stat(), os.fstat(descriptor))
    except FileNotFoundError:
        return False


def _lock_soon(descriptor: int) -> bool:
    """Whether it could be locked before long."""
    for _ in range(_TRIES):
        if _lock(descriptor):
            return True
        time.sleep(_PAUSE)
    return False


def _lock(descriptor: int) -> bool:
    """Whether it could be locked; a file system that knows no locks does not keep us from work."""
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
