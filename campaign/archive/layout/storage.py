"""How values are stored: sample types, chunks, compression, texts, digests."""

from __future__ import annotations

import numpy as np
from isal import isal_zlib
from numpy.typing import NDArray

from campaign.archive.layout.checksums import BLOCK

Array = NDArray[np.float64]

CHUNK = BLOCK
"""Samples per chunk, as many as a block of `checksums` has. A power of two (see `preview`); deflate
looks back 32 768 bytes, which is a byte of each of so many samples: shorter chunks compress worse,
longer ones hardly better."""

CHECKSUM = "sha256"
"""Attribute of every text and number: SHA-256 of its raw bytes, little endian (text: UTF-8).
Samples have theirs in their trial's record."""

SAMPLE = np.dtype("<f8")

LARGEST_CHUNK = 1 << 22
"""Samples of a chunk that a reader accepts."""

LEVEL = 3  # ISA-L's highest: twice the time of level 1, and up to half the size


_TRIED = 4096  # samples on which both ways of storing a series are tried ...
_DIFFER = 1024  # ... unless so many of them all differ, as those of no converter do


def storable(text: str) -> str:
    """A text as it can be stored: zeros pad one there, so none can be part of it."""
    return text.replace("\0", "\N{REPLACEMENT CHARACTER}")


def pack(samples: Array, shuffled: bool) -> bytes:
    """A chunk as HDF5's deflate filter would leave it, behind its shuffle filter or without."""
    raw = samples.view(np.uint8)
    raw = raw.reshape(-1, samples.itemsize).T if shuffled else raw
    packed: bytes = isal_zlib.compress(raw.tobytes(), LEVEL)
    return packed


def shuffling_helps(samples: Array) -> bool:
    """Whether samples are better stored with all first bytes first, then all second ones ...

    They are, but for those of a converter: few values, each of which comes again and again whole.
    Looks at the beginning of `samples`, shape (n,).
    """
    told = samples[:_DIFFER]
    if len(np.unique(told)) == len(told):
        return True
    tried = samples[:_TRIED]
    return len(pack(tried, shuffled=True)) <= len(pack(tried, shuffled=False))


def unpack(packed: bytes, count: int, shuffled: bool) -> Array | None:
    """The `count` samples of a chunk that `pack` made; None when it holds something else.

    No more memory is taken than so many samples need, whatever the chunk would expand to.
    """
    size = count * SAMPLE.itemsize
    inflating = isal_zlib.decompressobj()
    try:
        raw = inflating.decompress(packed, size)
        more = b"" if inflating.eof else inflating.decompress(b"", 1)
    except isal_zlib.error:  # type: ignore[misc] # its types call the class an instance
        return None
    if len(raw) != size or more or not inflating.eof or inflating.unused_data:
        return None
    if not shuffled:
        return np.frombuffer(bytearray(raw), dtype=SAMPLE)  # writable, as the others
    planes = np.frombuffer(raw, dtype=np.uint8).reshape(SAMPLE.itemsize, count)
    return np.ascontiguousarray(planes.T).view(SAMPLE).reshape(count)
