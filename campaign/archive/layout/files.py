"""Atomic file names, and writing that reaches the disk (fsync)."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import BinaryIO

PART = ".part"
"""Ending of a file that is still being written. No reader takes such a file for an archive."""

_BLOCK = 1 << 20
_UMASK = os.umask(0o022)
os.umask(_UMASK)
_REASON = re.compile(r"errno = \d+, error message = '([^']+)'")


def why(error: Exception) -> str:
    """What went wrong, in a line: HDF5 tells a page about a full disk."""
    if isinstance(error, OSError) and error.errno:
        return os.strerror(error.errno)
    told = " ".join(str(error).split())
    if reason := _REASON.search(told):
        return reason[1]
    return told[:300] or type(error).__name__


def keep_umask() -> None:
    """Give a file that is made next the mode that this process began with, whatever a plug-in did.

    To be called right before: other code of the process can change it at any time.
    """
    os.umask(_UMASK)


def sync_file(path: Path) -> None:
    """Put the content of `path` on the disk."""
    with path.open("r+b") as file:  # Windows puts nothing there that is open for reading alone
        os.fsync(file.fileno())


def sync_folder(folder: Path) -> None:
    """Put the names in `folder` on the disk. Windows has no such thing, and needs none."""
    if os.name == "nt":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def publish(part: Path, final: Path) -> None:
    """Give a finished, closed `part` its real name, so that it is there whole or not at all."""
    publish_all([(part, final)])


def publish_all(files: Sequence[tuple[Path, Path]]) -> None:
    """The same of several files of one folder, whose names are put on the disk together."""
    for part, _ in files:
        sync_file(part)
    for part, final in files:
        part.replace(final)
    if files:
        sync_folder(files[0][1].parent)


def write_atomically(path: Path, content: str) -> None:
    """Write a small text file so that it is there whole or not at all."""
    write_lines_atomically(path, [content])


def write_lines_atomically(path: Path, lines: Iterable[str]) -> None:
    """Write lines, each with its end, so that all of them are there or no file at all."""
    part = path.with_name(path.name + PART)
    keep_umask()
    with part.open("w", encoding="utf-8", newline="\n") as file:
        file.writelines(lines)
    publish(part, path)


def sha256_of(
    path: Path,
    blank: tuple[int, int] = (0, 0),
    progress: Callable[[int], object] = lambda count: None,
) -> str:
    """SHA-256 of a file in flat memory.

    Args:
        path: the file.
        blank: offset and length of bytes that count as `0` digits: where the hash itself stands.
        progress: is told how many bytes were read, now and then.
    """
    offset, length = blank
    digest = hashlib.sha256()
    with path.open("rb") as file:
        _digest(file, digest, offset, progress)
        digest.update(b"0" * len(file.read(length)))
        _digest(file, digest, None, progress)
    return digest.hexdigest()


def sha256_of_part(path: Path, offset: int, size: int) -> str:
    """SHA-256 of so many bytes of a file, in flat memory."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        file.seek(offset)
        _digest(file, digest, size, lambda count: None)
    return digest.hexdigest()


def _digest(
    file: BinaryIO,
    digest: hashlib._Hash,
    length: int | None,
    progress: Callable[[int], object],
) -> None:
    """Feed the next `length` bytes, or all that are left."""
    left = length
    while block := file.read(_BLOCK if left is None else min(_BLOCK, left)):
        digest.update(block)
        progress(len(block))
        left = None if left is None else left - len(block)
