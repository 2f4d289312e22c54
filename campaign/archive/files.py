"""Files that are either whole or visibly not: atomic names, and what was written is on the disk."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

PART = ".part"
"""Ending of a file that is still being written. No reader takes such a file for an archive."""

TRAILER = b"\ncampaign-sha256 %s\n"
TRAILER_LENGTH = len(TRAILER) - 2 + 64
_BLOCK = 1 << 20


def sync_file(path: Path) -> None:
    """Put the content of `path` on the disk."""
    with path.open("rb") as file:
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
    sync_file(part)
    part.replace(final)
    sync_folder(final.parent)


def write_atomically(path: Path, content: str) -> None:
    """Write a small text file so that it is there whole or not at all."""
    part = path.with_name(path.name + PART)
    part.write_text(content, encoding="utf-8", newline="\n")
    publish(part, path)


def sha256_of(path: Path, length: int | None = None) -> str:
    """SHA-256 of a file, or of its first `length` bytes, in flat memory."""
    digest = hashlib.sha256()
    left = path.stat().st_size if length is None else length
    with path.open("rb") as file:
        while left > 0 and (block := file.read(min(_BLOCK, left))):
            digest.update(block)
            left -= len(block)
    return digest.hexdigest()


def append_trailer(path: Path) -> None:
    """Append the hash of everything before it: HDF5 ignores what follows its own end.

    The hash then travels with the file, and any later change of any byte is found.
    """
    digest = sha256_of(path)
    with path.open("ab") as file:
        file.write(TRAILER % digest.encode("ascii"))


def trailer_stands(path: Path) -> bool:
    """Whether the file ends the way a sealed file does: a cut-off one does not (costs nothing)."""
    before, after = TRAILER.split(b"%s")
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - TRAILER_LENGTH))
        trailer = file.read()
    return trailer.startswith(before) and trailer.endswith(after)


def trailer_holds(path: Path) -> bool:
    """Whether the file is byte for byte what was sealed."""
    length = path.stat().st_size - TRAILER_LENGTH
    if length < 0:
        return False
    with path.open("rb") as file:
        file.seek(length)
        trailer = file.read()
    return trailer == TRAILER % sha256_of(path, length).encode("ascii")
