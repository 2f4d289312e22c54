"""Reading series of samples that nobody vouches for: chunk by chunk, with checked sizes.

The chunks are unpacked here and not by HDF5, which takes half as long again.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import h5py
import numpy as np
from h5py import h5d, h5t

from campaign.archive.layout import storage
from campaign.archive.layout.checksums import SeriesDigest, series_digest
from campaign.archive.reading.guarded import own_id
from campaign.errors import ArchiveError
from campaign.recording import Array

_LARGEST_CHUNK = 1 << 22  # samples
_SHUFFLED = [h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_DEFLATE]
_DEFLATED = [h5py.h5z.FILTER_DEFLATE]
_NO_SERIES = "is not a chunked series of float64"


@dataclass(frozen=True)
class Series:
    """A dataset of samples in a file, none of which was read yet.

    Attributes:
        dataset: of HDF5's low-level interface: a campaign has tens of thousands of them.
        parent, name: where it is.
        length: samples that it states.
        chunk: samples of a chunk.
        shuffled: whether its chunks passed the shuffle filter.
    """

    dataset: h5d.DatasetID
    parent: h5py.Group
    name: str
    length: int
    chunk: int
    shuffled: bool

    def blocks(self) -> Iterator[Array]:
        """The samples, chunk by chunk. Raises ArchiveError."""
        for start in range(0, self.length, self.chunk):
            skipped, packed = self.dataset.read_direct_chunk((start,))
            samples = None if skipped else storage.unpack(packed, self.chunk, self.shuffled)
            if samples is None:
                raise ArchiveError(f"{self.place}: cannot be read: a chunk is damaged")
            yield samples[: self.length - start]

    def read(self, digest: str) -> Array:
        """All samples, shape (length,). Raises ArchiveError unless they have the digest."""
        found = list(self.blocks())
        values = found[0] if len(found) == 1 else np.concatenate(found or [np.empty(0)])
        self._compare(series_digest(values), digest)
        return values

    def check(self, digest: str) -> None:
        """Read them in flat memory. Raises ArchiveError unless they have the digest."""
        found = SeriesDigest()
        for block in self.blocks():
            found.update(block)
        self._compare(found.hexdigest(), digest)

    @cached_property
    def hdf5(self) -> h5py.Dataset:
        """As h5py's other interface knows it, for attributes."""
        return h5py.Dataset(self.dataset)

    @property
    def place(self) -> str:
        """File and path, for messages."""
        return _place(self.parent, self.name)

    @property
    def stored(self) -> int:
        """Bytes that it takes in the file."""
        return int(self.dataset.get_storage_size())

    def _compare(self, found: str, digest: str) -> None:
        if found != digest:
            raise ArchiveError(f"{self.place}: {MISMATCH}")


MISMATCH = "does not match its checksum; it was damaged or changed"


def series_at(parent: h5py.Group, name: str, length: int) -> Series:
    """A series of `length` samples that `parent` itself holds. Raises ArchiveError."""
    found = own_id(parent, name)
    plan = found.get_create_plist() if isinstance(found, h5d.DatasetID) else None
    shape: tuple[int, ...] = found.shape if plan is not None else ()
    if plan is None or plan.get_layout() != h5d.CHUNKED or len(shape) != 1:
        raise ArchiveError(f"{_place(parent, name)}: {_NO_SERIES}")
    filters = [plan.get_filter(number)[0] for number in range(plan.get_nfilters())]
    if filters not in (_SHUFFLED, _DEFLATED):
        what = "is stored with a filter other than shuffle and deflate"
        raise ArchiveError(f"{_place(parent, name)}: {what}")
    (stated,), (chunk,) = shape, plan.get_chunk()
    if not found.get_type().equal(h5t.IEEE_F64LE):
        raise ArchiveError(f"{_place(parent, name)}: {_NO_SERIES}")
    if not 0 < chunk <= _LARGEST_CHUNK:
        raise ArchiveError(f"{_place(parent, name)}: has chunks of {chunk} samples")
    if stated != length:
        what = f"has {stated} samples, and {length} were recorded"
        raise ArchiveError(f"{_place(parent, name)}: {what}")
    return Series(found, parent, name, length, chunk, filters == _SHUFFLED)


def layout_of(dataset: h5d.DatasetID) -> tuple[tuple[int, int], ...]:
    """Where in the file the chunks of a series lie: offset and bytes of each."""
    chunks = map(dataset.get_chunk_info, range(dataset.get_num_chunks()))
    return tuple((chunk.byte_offset, chunk.size) for chunk in chunks)


def _place(parent: h5py.Group, name: str) -> str:
    return f"{parent.file.filename}: {parent.name.rstrip('/')}/{name}"
