"""Check of HDF5's global heaps, which have no checksum, before HDF5 reads them.

Texts of attributes are stored in global heap collections (`GCOL`). HDF5 steps through the objects
of a collection by their sizes. If damage sets the size of the free space to zero, it never ends.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import BinaryIO

_HEAD = b"GCOL\x01\x00\x00\x00"
_HEADER = 16  # bytes, of a collection and of an object in it
_BLOCK = 1 << 20


Looked = tuple[Path, int, int]
"""State of a checked file: path, size (bytes), time of change (ns)."""
_known: dict[Looked, bool] = {}


def heaps_are_sound(path: Path) -> bool:
    """Whether HDF5 can read every heap of the file; checked once while the file is unchanged."""
    stat = path.stat()
    looked = path, stat.st_size, stat.st_mtime_ns
    if looked not in _known:
        _known[looked] = _sound(path, stat.st_size)
    return _known[looked]


def known_heaps(path: Path) -> dict[Looked, bool]:
    """Results of this process, that of `path` included if it is a file, for other processes."""
    if path.is_file():
        heaps_are_sound(path)
    return dict(_known)


def add_known_heaps(known: Mapping[Looked, bool]) -> None:
    """Add the results of another process."""
    _known.update(known)


def _sound(path: Path, size: int) -> bool:
    with path.open("rb") as file:
        return all(_collection_ends(file, start, size) for start in list(_collections(file)))


def _collections(file: BinaryIO) -> Iterator[int]:
    """Offsets of the collections in the file; reads by blocks, in constant memory."""
    before, tail = 0, b""
    while block := file.read(_BLOCK):
        content = tail + block
        start = content.find(_HEAD)
        while start >= 0:
            yield before + start
            start = content.find(_HEAD, start + len(_HEAD))
        tail = content[1 - len(_HEAD) :]  # a head may lie across two blocks
        before += len(content) - len(tail)


def _collection_ends(file: BinaryIO, start: int, size: int) -> bool:
    end = start + _numbers(file, start)[1]
    if end > size:
        return True  # HDF5 refuses it
    place = start + _HEADER
    while place + _HEADER <= end:
        index, length = _numbers(file, place)
        if index & 0xFFFF:
            place += _HEADER + (length + 7) // 8 * 8
        elif length < _HEADER:
            return False
        else:
            place += length
    return True


def _numbers(file: BinaryIO, place: int) -> tuple[int, int]:
    """The two 64-bit numbers of a header; the low 16 bits of an object's first are its index."""
    file.seek(place)
    head = file.read(_HEADER).ljust(_HEADER, b"\0")
    return int.from_bytes(head[:8], "little"), int.from_bytes(head[8:], "little")
