"""Storage of values: sample types, chunks, compression, texts, digests."""

from __future__ import annotations

import numpy as np
from isal import isal_zlib

from campaign.archive.layout.checksums import BLOCK
from campaign.recording import Array

CHUNK = BLOCK
"""Samples per chunk, equal to a block of `checksums`. A power of two (see `preview`). The window of
deflate is 32 768 bytes: one byte of each of 32 768 shuffled samples. Shorter chunks compress worse,
longer ones hardly better."""

CHECKSUM = "sha256"
"""Attribute of every text and number: SHA-256 of its raw bytes, little endian (text: UTF-8).
The digests of samples are in the record of their trial."""

SAMPLE = np.dtype("<f8")

LARGEST_CHUNK = 1 << 22
"""Largest chunk that a reader accepts (samples)."""

LEVEL = 3
"""ISA-L's highest: twice the time of level 1, and up to half the size (4 % of simulated trials)."""
_TRIED = 1024  # samples for a trial of both storage forms ...
_DIFFER = 256  # ... unless this number of samples are all distinct, so not from a converter


def storable(text: str) -> str:
    """A text with NUL characters replaced, because NUL pads a stored text."""
    return text.replace("\0", "\N{REPLACEMENT CHARACTER}")


def pack(samples: Array, shuffled: bool) -> bytes:
    """Compress a chunk to the output format of HDF5's deflate filter, with or without shuffle."""
    raw = samples.view(np.uint8)
    raw = raw.reshape(-1, samples.itemsize).T if shuffled else raw
    packed: bytes = isal_zlib.compress(raw.tobytes(), LEVEL)
    return packed


def shuffling_helps(samples: Array) -> bool:
    """Whether samples compress better shuffled: all first bytes, then all second bytes ...

    True except for samples of a converter, which repeat few values. Examines the beginning of
    `samples`, shape (n,).
    """
    first = samples[:_DIFFER]
    if len(np.unique(first)) == len(first):
        return True
    tried = samples[:_TRIED]
    return len(pack(tried, shuffled=True)) <= len(pack(tried, shuffled=False))


def unpack(packed: bytes, count: int, shuffled: bool) -> Array | None:
    """The `count` samples of a chunk from `pack`; None if it holds anything else.

    Memory is limited to the size of these samples, even if the chunk would expand to more.
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
