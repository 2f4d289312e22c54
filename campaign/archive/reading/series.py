"""Reading untrusted series of samples: chunk by chunk, with checked sizes.

The chunks are unpacked here and not by HDF5, which takes half as long again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import BinaryIO

import h5py
import numpy as np
from h5py import h5d, h5t

from campaign.archive.layout import storage
from campaign.archive.layout.checksums import SeriesDigest, series_digest
from campaign.archive.layout.packed_trial import PackedSeries, Place
from campaign.archive.reading.safe_hdf5 import own_id
from campaign.errors import ArchiveError
from campaign.recording import Array

_SHUFFLED = [h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_DEFLATE]
_DEFLATED = [h5py.h5z.FILTER_DEFLATE]
_NO_SERIES = "is not a chunked series of float64"


@dataclass(frozen=True)
class Series:
    """Samples in a file, none of which was read yet.

    Attributes:
        length: samples that it states.
        chunk: samples of a chunk.
        shuffled: whether its chunks passed the shuffle filter.
        packed: reads a chunk, by its number; None when it is not as the filters leave it.
        place: file and path, for messages.
    """

    length: int
    chunk: int
    shuffled: bool
    packed: Callable[[int], bytes | None]
    place: Callable[[], str]

    def read(self, digest: str | None = None) -> Array:
        """All samples, shape (length,). Raises ArchiveError unless they have the digest, if any."""
        found = [samples for samples, _ in self._blocks()]
        values = found[0] if len(found) == 1 else np.concatenate(found or [np.empty(0)])
        if digest is not None:
            self._compare(series_digest(values), digest)
        return values

    def check(self, digest: str) -> int:
        """Read them in flat memory. Raises ArchiveError unless they have the digest.

        Returns:
            How many bytes were read.
        """
        found, size = SeriesDigest(), 0
        for samples, packed in self._blocks():
            found.update(samples)
            size += packed
        self._compare(found.hexdigest(), digest)
        return size

    def _blocks(self) -> Iterator[tuple[Array, int]]:
        """The samples and the bytes of one chunk after another."""
        for number, start in enumerate(range(0, self.length, self.chunk)):
            packed = self.packed(number)
            samples = None if packed is None else storage.unpack(packed, self.chunk, self.shuffled)
            if packed is None or samples is None:
                raise ArchiveError(f"{self.place()}: cannot be read: a chunk is damaged")
            yield samples[: self.length - start], len(packed)

    def _compare(self, found: str, digest: str) -> None:
        if found != digest:
            raise ArchiveError(f"{self.place()}: {MISMATCH}")


MISMATCH = "does not match its checksum; it was damaged or changed"


def series_at(
    parent: h5py.Group, name: str, length: int | None = None
) -> tuple[h5d.DatasetID, Series]:
    """A dataset that `parent` itself holds, and its samples: `length`, where that is known.

    Raises ArchiveError.
    """
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
    if not 0 < chunk <= storage.LARGEST_CHUNK:
        raise ArchiveError(f"{_place(parent, name)}: has chunks of {chunk} samples")
    if length is not None and stated != length:
        what = f"has {stated} samples, and {length} were recorded"
        raise ArchiveError(f"{_place(parent, name)}: {what}")
    return found, dataset_series(found, parent, name, stated, chunk, filters == _SHUFFLED)


def dataset_series(
    dataset: h5d.DatasetID, parent: h5py.Group, name: str, length: int, chunk: int, shuffled: bool
) -> Series:
    """The series of a dataset that is known to be one."""

    def packed(number: int) -> bytes | None:
        skipped, found = dataset.read_direct_chunk((number * chunk,))
        return None if skipped else bytes(found)

    return Series(length, chunk, shuffled, packed, lambda: _place(parent, name))


def file_series(file: BinaryIO, place: str, length: int, told: PackedSeries) -> Series:
    """A series of a trial's own file."""

    def packed(number: int) -> bytes | None:
        offset, size = told.chunks[number]
        file.seek(offset)
        return file.read(size)

    if len(told.chunks) != -(-length // told.chunk):
        raise ArchiveError(f"{place}: has {len(told.chunks)} chunks of {told.chunk} samples")
    return Series(length, told.chunk, told.shuffled, packed, lambda: place)


def layout_of(dataset: h5d.DatasetID) -> tuple[Place, ...]:
    """Where in the file the chunks of a series lie: offset and bytes of each."""
    chunks = map(dataset.get_chunk_info, range(dataset.get_num_chunks()))
    return tuple((chunk.byte_offset, chunk.size) for chunk in chunks)


def _place(parent: h5py.Group, name: str) -> str:
    return f"{parent.file.filename}: {parent.name.rstrip('/')}/{name}"
