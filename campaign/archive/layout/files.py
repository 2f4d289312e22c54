"""Atomic file names, and writing that reaches the disk (fsync)."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from campaign.errors import ArchiveError

PART = ".part"
"""Suffix of a file that is being written. Readers do not accept it as an archive."""

_BLOCK = 1 << 20
_UMASK = os.umask(0o022)
os.umask(_UMASK)
_REASON = re.compile(r"errno = \d+, error message = '([^']+)'")


def why(error: Exception) -> str:
    """Short reason of an error, in one line: HDF5 prints a page for a full disk."""
    if isinstance(error, OSError) and error.errno:
        return os.strerror(error.errno)
    message = " ".join(str(error).split())
    if reason := _REASON.search(message):
        return reason[1]
    return message[:300] or type(error).__name__


@contextmanager
def read_errors(path: Path) -> Iterator[None]:
    """Convert an OSError in the block to an ArchiveError that names the file."""
    try:
        yield
    except OSError as error:
        raise ArchiveError(f"{path}: cannot be read: {why(error)}") from None


def keep_umask() -> None:
    """Restore the umask from the start of this process, in case a plug-in changed it.

    Call it directly before creating a file: other code can change the umask at any time.
    """
    os.umask(_UMASK)


def sync_file(path: Path) -> None:
    """Flush the content of `path` to the disk."""
    with path.open("r+b") as file:  # Windows cannot flush a file opened read-only
        os.fsync(file.fileno())


def sync_folder(folder: Path) -> None:
    """Flush the names in `folder` to the disk; Windows does not need this."""
    if os.name == "nt":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def publish(part: Path, final: Path) -> None:
    """Rename a finished, closed `part` atomically: the file exists completely or not at all."""
    publish_all([(part, final)])


def publish_all(files: Sequence[tuple[Path, Path]]) -> None:
    """As `publish`, for several files of one folder, which is flushed once."""
    for part, _ in files:
        sync_file(part)
    for part, final in files:
        part.replace(final)
    if files:
        sync_folder(files[0][1].parent)


def write_atomically(path: Path, content: str) -> None:
    """Write a small text file completely or not at all."""
    write_lines_atomically(path, [content])


def write_lines_atomically(path: Path, lines: Iterable[str]) -> None:
    """Write a file of lines (with their line ends) completely or not at all."""
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
    """SHA-256 of a file, in constant memory.

    Args:
        path: the file.
        blank: offset and length of the hash itself, whose bytes count as `0` digits.
        progress: called with the number of bytes of each block read.
    """
    offset, length = blank
    digest = hashlib.sha256()
    with path.open("rb") as file:
        _digest(file, digest, offset, progress)
        digest.update(b"0" * len(file.read(length)))
        _digest(file, digest, None, progress)
    return digest.hexdigest()


def lines_of(path: Path, offset: int, size: int) -> Iterator[bytes]:
    """Complete lines of `size` bytes of a file, without their ends, in constant memory."""
    with path.open("rb", buffering=_BLOCK) as file:
        file.seek(offset)
        for line in file:
            size -= len(line)
            if size < 0 or not line.endswith(b"\n"):
                return
            yield line[:-1]


def sha256_of_part(path: Path, offset: int, size: int) -> str:
    """SHA-256 of `size` bytes of a file, in constant memory."""
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
    """Add the next `length` bytes, or all remaining bytes if None, to the digest."""
    left = length
    while block := file.read(_BLOCK if left is None else min(_BLOCK, left)):
        digest.update(block)
        progress(len(block))
        left = None if left is None else left - len(block)
