"""What a piece of code asks of the disk, in its order: calls of `os` that write, sync, rename.

Recorded inside the process, so it works wherever the tests do. HDF5 writes by calls of its own:
what is seen of its files is that they are synced, renamed and removed.
"""

from __future__ import annotations

import io
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from unittest.mock import patch


@dataclass(frozen=True)
class Call:
    """One call.

    Attributes:
        name: `write`, `fsync`, `rename`, `truncate`, `unlink`, `mkdir` or `rmdir`.
        path: of the file or folder, as it was called then.
        to: the new name of a rename.
        data: what was written.
    """

    name: str
    path: Path
    to: Path | None = None
    data: bytes = b""

    def __str__(self) -> str:
        return f"{self.name} {self.path.name}{f' -> {self.to.name}' if self.to else ''}"


@dataclass
class Calls:
    """The calls so far, in their order.

    Attributes:
        listed: all of them.
    """

    listed: list[Call] = field(default_factory=list)

    def add(self, name: str, path: Any, to: Any = None, data: bytes = b"") -> None:
        target = None if to is None else Path(os.fsdecode(to))
        self.listed.append(Call(name, Path(os.fsdecode(path)), target, data))

    def index(self, name: str, path: Path, after: int = -1) -> int:
        """Number of the first such call after number `after`; AssertionError when there is none.

        A rename is found by its new name.
        """
        for number, call in enumerate(self.listed):
            at = call.to if call.to is not None else call.path
            if number > after and call.name == name and at == path:
                return number
        raise AssertionError(f"no {name} of {path} after number {after} in:\n{self}")

    def in_order(self, *wanted: tuple[str, Path]) -> None:
        """Each of these calls is there, after the one before it."""
        number = -1
        for name, path in wanted:
            number = self.index(name, path, number)

    def synced_before(self, number: int, path: Path) -> bool:
        """Whether what was written to `path` before call `number` was synced before it, too."""
        before = [call for call in self.listed[:number] if call.path == path]
        changes = [n for n, call in enumerate(before) if call.name in ("write", "truncate")]
        syncs = [n for n, call in enumerate(before) if call.name == "fsync"]
        return bool(syncs) and (not changes or syncs[-1] > changes[-1])

    def __str__(self) -> str:
        return "\n".join(f"{number:3} {call}" for number, call in enumerate(self.listed))


@contextmanager
def recorded() -> Iterator[Calls]:
    """Records what happens within; nothing is done otherwise than without it.

    Calls through `os`, `pathlib` and `open` are seen, of every thread. Text and buffered files are
    noted as written when they are closed or flushed to the system, whichever is first.
    """
    calls, names = Calls(), _Names()

    def path_of(where: Any) -> Any:
        return names.of(where) if isinstance(where, int) else where

    def noting(name: str, real: Any, *, second: bool = False) -> Any:
        def call(path: Any, *more: Any, **options: Any) -> Any:
            at = path_of(path)
            result = real(path, *more, **options)
            calls.add(name, at, more[0] if second else None)
            return result

        return call

    def write(descriptor: int, data: Any) -> int:
        at = names.of(descriptor)
        count = real_write(descriptor, data)
        calls.add("write", at, data=bytes(data)[:count])
        return count

    def open_file(file: Any, mode: str = "r", *more: Any, **options: Any) -> Any:
        opened = real_open(file, mode, *more, **options)
        if set(mode) & set("wax+") and not isinstance(file, int):
            emptied = bool(set(mode) & set("wx"))
            _note_writes(opened, calls, Path(os.fsdecode(file)), changed=emptied)
        return opened

    real_write, real_open = os.write, io.open
    with (
        patch.object(os, "write", write),
        patch.object(os, "fsync", noting("fsync", os.fsync)),
        patch.object(os, "ftruncate", noting("truncate", os.ftruncate)),
        patch.object(os, "truncate", noting("truncate", os.truncate)),
        patch.object(os, "rename", noting("rename", os.rename, second=True)),
        patch.object(os, "replace", noting("rename", os.replace, second=True)),
        patch.object(os, "unlink", noting("unlink", os.unlink)),
        patch.object(os, "remove", noting("unlink", os.remove)),
        patch.object(os, "mkdir", noting("mkdir", os.mkdir)),
        patch.object(os, "rmdir", noting("rmdir", os.rmdir)),
        patch.object(io, "open", open_file),
        patch("builtins.open", open_file),
    ):
        yield calls


class _Names:
    """What an open descriptor is called now."""

    def of(self, descriptor: int) -> Path:
        for folder in ("/proc/self/fd", "/dev/fd"):
            try:
                return Path(os.readlink(f"{folder}/{descriptor}"))  # noqa: PTH115
            except OSError:
                continue
        raise AssertionError("the name of an open file cannot be had on this system")


def _note_writes(opened: Any, calls: Calls, path: Path, *, changed: bool) -> None:
    """Have a file object note that it wrote, when that is flushed or the file is closed."""
    write, flush, close = opened.write, opened.flush, opened.close

    def writing(data: Any) -> Any:
        nonlocal changed
        changed = True
        return write(data)

    def noting(act: Callable[[], None]) -> Callable[[], None]:
        def acting() -> None:
            nonlocal changed
            act()
            if changed:
                calls.add("write", path)
            changed = False

        return acting

    opened.write, opened.flush, opened.close = writing, noting(flush), noting(close)
