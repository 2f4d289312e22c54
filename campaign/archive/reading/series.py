"""Reading untrusted series of samples: chunk by chunk, with checked sizes.

Chunks are decompressed here: HDF5 takes 1.5 times as long.
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
from campaign.archive.reading.safe_hdf5 import MISMATCH, own_id, place_of
from campaign.errors import ArchiveError
from campaign.recording import Array

_SHUFFLED = [h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_DEFLATE]
_DEFLATED = [h5py.h5z.FILTER_DEFLATE]
_NO_SERIES = "is not a chunked series of float64"


@dataclass(frozen=True)
class Series:
    """Samples in a file, read on request.

    Attributes:
        length: stated number of samples.
        chunk: samples per chunk.
        shuffled: whether its chunks passed the shuffle filter.
        packed: reads a chunk by number, as compressed bytes; None if a filter was skipped.
        place: file and path, for messages.
    """

    length: int
    chunk: int
    shuffled: bool
    packed: Callable[[int], bytes | None]
    place: Callable[[], str]

    def read(self, digest: str | None = None) -> Array:
        """All samples, shape (length,). Raises ArchiveError if they do not match the digest."""
        blocks = [samples for samples, _ in self._blocks()]
        values = blocks[0] if len(blocks) == 1 else np.concatenate(blocks or [np.empty(0)])
        if digest is not None:
            self._compare(series_digest(values), digest)
        return values

    def check(self, digest: str) -> int:
        """Compare them with the digest in constant memory. Raises ArchiveError if it differs.

        Returns:
            Number of bytes read.
        """
        actual, size = SeriesDigest(), 0
        for samples, packed in self._blocks():
            actual.update(samples)
            size += packed
        self._compare(actual.hexdigest(), digest)
        return size

    def _blocks(self) -> Iterator[tuple[Array, int]]:
        """Samples and compressed size (bytes) of each chunk."""
        for number, start in enumerate(range(0, self.length, self.chunk)):
            packed = self.packed(number)
            samples = None if packed is None else storage.unpack(packed, self.chunk, self.shuffled)
            if packed is None or samples is None:
                raise ArchiveError(f"{self.place()}: cannot be read: a chunk is damaged")
            yield samples[: self.length - start], len(packed)

    def _compare(self, found: str, digest: str) -> None:
        if found != digest:
            raise ArchiveError(f"{self.place()}: {MISMATCH}")


def series_at(
    parent: h5py.Group, name: str, length: int | None = None
) -> tuple[h5d.DatasetID, Series]:
    """A dataset directly in `parent`, and its series; must have `length` samples, if given.

    Raises ArchiveError.
    """
    dataset = own_id(parent, name)
    plan = dataset.get_create_plist() if isinstance(dataset, h5d.DatasetID) else None
    shape: tuple[int, ...] = dataset.shape if plan is not None else ()
    if plan is None or plan.get_layout() != h5d.CHUNKED or len(shape) != 1:
        raise ArchiveError(f"{place_of(parent, name)}: {_NO_SERIES}")
    filters = [plan.get_filter(number)[0] for number in range(plan.get_nfilters())]
    if filters not in (_SHUFFLED, _DEFLATED):
        what = "is stored with a filter other than shuffle and deflate"
        raise ArchiveError(f"{place_of(parent, name)}: {what}")
    (stated,), (chunk,) = shape, plan.get_chunk()
    if not dataset.get_type().equal(h5t.IEEE_F64LE):
        raise ArchiveError(f"{place_of(parent, name)}: {_NO_SERIES}")
    if not 0 < chunk <= storage.LARGEST_CHUNK:
        raise ArchiveError(f"{place_of(parent, name)}: has chunks of {chunk} samples")
    if length is not None and stated != length:
        what = f"has {stated} samples, and {length} were recorded"
        raise ArchiveError(f"{place_of(parent, name)}: {what}")
    return dataset, dataset_series(dataset, parent, name, stated, chunk, filters == _SHUFFLED)


def dataset_series(
    dataset: h5d.DatasetID, parent: h5py.Group, name: str, length: int, chunk: int, shuffled: bool
) -> Series:
    """The series of a dataset that was checked before."""

    def packed(number: int) -> bytes | None:
        skipped, content = dataset.read_direct_chunk((number * chunk,))
        return None if skipped else bytes(content)

    return Series(length, chunk, shuffled, packed, lambda: place_of(parent, name))


def file_series(file: BinaryIO, place: str, length: int, stored: PackedSeries) -> Series:
    """A series of a trial's own file."""

    def packed(number: int) -> bytes | None:
        offset, size = stored.chunks[number]
        file.seek(offset)
        return file.read(size)

    if len(stored.chunks) != -(-length // stored.chunk):
        raise ArchiveError(f"{place}: has {len(stored.chunks)} chunks of {stored.chunk} samples")
    return Series(length, stored.chunk, stored.shuffled, packed, lambda: place)


def layout_of(dataset: h5d.DatasetID) -> tuple[Place, ...]:
    """Place of each chunk of a series in the file: offset and size in bytes."""
    chunks = map(dataset.get_chunk_info, range(dataset.get_num_chunks()))
    return tuple((chunk.byte_offset, chunk.size) for chunk in chunks)
