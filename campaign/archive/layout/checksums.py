"""The tree of checksums: samples, channels, trials, run.

Its leaves are logical: the samples of a series as numbers, in blocks, independent of the layout in
HDF5. A trial's record names every series with its unit and its leaf; the run's seal names the
digest of every record and of every text. So the digest of the seal determines the whole run and the
order in it. `docs/developers/archive-format.md` defines each digest for other programs.
"""

from __future__ import annotations

import hashlib

import numpy as np

from campaign.recording import Array

BLOCK = 32_768
"""Samples per block."""


def text_digest(text: str) -> str:
    """Digest of a text: SHA-256 of its UTF-8 bytes, hexadecimal."""
    return hashlib.sha256(text.encode()).hexdigest()


class SeriesDigest:
    """Digest of a series: SHA-256 over the SHA-256 of each of its blocks, in order.

    Blocks hold `BLOCK` little-endian 64-bit floats; the last one may hold fewer.
    """

    def __init__(self) -> None:
        self._blocks = hashlib.sha256()
        self._block = hashlib.sha256()
        self._filled = 0

    def update(self, samples: Array) -> None:
        """Add samples, shape (n,)."""
        start = 0
        while start < len(samples):
            part = samples[start : start + BLOCK - self._filled]
            self._block.update(np.ascontiguousarray(part, dtype="<f8").data)
            self._filled += len(part)
            start += len(part)
            if self._filled == BLOCK:
                self._end_block()

    def hexdigest(self) -> str:
        """Digest of all samples so far. Do not add samples afterwards."""
        if self._filled:
            self._end_block()
        return self._blocks.hexdigest()

    def _end_block(self) -> None:
        self._blocks.update(self._block.digest())
        self._block, self._filled = hashlib.sha256(), 0


def series_digest(samples: Array) -> str:
    """Digest of a whole series, shape (n,)."""
    digest = SeriesDigest()
    digest.update(samples)
    return digest.hexdigest()
