"""The one part of HDF5's own bookkeeping that has no checksum and must be looked at beforehand.

Texts of attributes lie in global heap collections (`GCOL`). HDF5 walks through the objects of one
by their sizes; where damage made the size of the free space zero, it walks on the spot for ever.
"""

from __future__ import annotations

import mmap
from functools import lru_cache
from pathlib import Path

_HEAD = b"GCOL\x01\x00\x00\x00"
_HEADER = 16  # bytes, of a collection as well as of an object in it


def heaps_are_sound(path: Path) -> bool:
    """Whether HDF5 gets through every heap of the file; read once while the file is the same."""
    stat = path.stat()
    return _sound(path, stat.st_size, stat.st_mtime_ns)


@lru_cache(maxsize=64)
def _sound(path: Path, size: int, _changed: int) -> bool:
    if size == 0:
        return True
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        start = content.find(_HEAD)
        while start >= 0:
            if not _collection_ends(content, start):
                return False
            start = content.find(_HEAD, start + 8)
    return True


def _number(content: mmap.mmap, start: int, length: int) -> int:
    return int.from_bytes(content[start : start + length], "little")


def _collection_ends(content: mmap.mmap, start: int) -> bool:
    end = start + _number(content, start + 8, 8)
    if end > len(content):
        return True  # HDF5 refuses it
    place = start + _HEADER
    while place + _HEADER <= end:
        size = _number(content, place + 8, 8)
        if _number(content, place, 2):
            place += _HEADER + (size + 7) // 8 * 8
        elif size < _HEADER:
            return False
        else:
            place += size
    return True
