"""Texts with the size of a run, in pieces: never complete in memory."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

SHORT = 32_000
"""Largest text in an object header (bytes); HDF5 allows 64 kB with attributes."""

_BLOCK = 1 << 20


@dataclass(frozen=True)
class LongText:
    """A text by its pieces (UTF-8), which each call of `pieces` generates again."""

    pieces: Callable[[], Iterable[bytes]]
    size: int
    sha256: str


def text_of(pieces: Callable[[], Iterable[bytes]]) -> str | LongText:
    """The text itself if it is short, else a `LongText`."""
    digest, size, short = hashlib.sha256(), 0, b""
    for piece in pieces():
        digest.update(piece)
        size += len(piece)
        short = short + piece if size <= SHORT else b""
    return LongText(pieces, size, digest.hexdigest()) if size > SHORT else short.decode()


def file_pieces(path: Path, size: int | None = None) -> Iterator[bytes]:
    """The first `size` bytes of a file of JSON lines, or the whole file; contains no NUL."""
    with path.open("rb") as file:
        left = path.stat().st_size if size is None else size
        while block := file.read(min(_BLOCK, left)):
            left -= len(block)
            yield block
