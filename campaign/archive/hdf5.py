"""Writing HDF5 the way every NeXus reader understands, in flat memory.

Sample datasets are one-dimensional, chunked, and pass HDF5's two standard filters, shuffle and
deflate. The chunks are compressed here, by ISA-L outside HDF5's global lock, and handed over ready:
a file like the one HDF5's own filters would write, several times faster. No object notes when it
was made, so equal content makes equal bytes.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from typing import Any

import h5py
import numpy as np
from isal import isal_zlib
from numpy.typing import NDArray

Array = NDArray[np.float64]

CHUNK = 16_384
"""Samples per chunk. A power of two (see `preview`); short chunks compress worse."""

CHECKSUM = "sha256"
"""Attribute of every dataset: SHA-256 of its raw bytes, little endian (text: UTF-8)."""

SAMPLE = np.dtype("<f8")
_LEVEL = 1  # ISA-L's level 2 wins nothing on recordings, its level 3 costs twice the time
_DIMENSION_SCALE_ATTRIBUTES = {"CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST"}


def make_group(parent: h5py.Group, name: str, nx_class: str) -> h5py.Group:
    """A group of a NeXus class."""
    group = parent.create_group(name)
    group.attrs["NX_class"] = nx_class
    return group


def put_text(group: h5py.Group, name: str, text: str, **attributes: str) -> None:
    """A text as a scalar of fixed length, so that a reader knows its size before reading it."""
    raw = text.replace("\0", "\N{REPLACEMENT CHARACTER}").encode("utf-8")  # zeros pad a text
    kind = h5py.string_dtype("utf-8", max(1, len(raw)))
    dataset = group.create_dataset(name, data=np.array(raw, dtype=kind), track_times=False)
    dataset.attrs.update(attributes)
    dataset.attrs[CHECKSUM] = hashlib.sha256(raw).hexdigest()


def put_integer(group: h5py.Group, name: str, value: int) -> None:
    """A whole number as a 64-bit scalar."""
    number = np.array(value, dtype="<i8")
    dataset = group.create_dataset(name, data=number, track_times=False)
    dataset.attrs[CHECKSUM] = hashlib.sha256(number.tobytes()).hexdigest()


def blank_digest(group: h5py.Group, name: str) -> tuple[int, int]:
    """Room for the hash of the file that `group` is in; returns where it stands in the file.

    64 digits `0` until `campaign.archive.sealing` puts the hash over them. The only dataset without
    a checksum of its own.
    """
    digits = np.array(b"0" * 64, dtype="S64")
    dataset = group.create_dataset(name, data=digits, track_times=False)
    group.file.flush()
    return dataset.id.get_offset(), 64


def attach_time(group: h5py.Group, time: str = "time") -> None:
    """Make `time` the dimension scale of the other sample datasets in `group`."""
    group[time].make_scale(time)
    for name, dataset in group.items():
        if name != time and dataset.ndim == 1:
            dataset.dims[0].attach_scale(group[time])


class SampleColumns:
    """Datasets of equal length, written as their samples come; one chunk of each is in memory.

    Args:
        group: where they go.
        attributes: of each dataset, by name, in the order of the rows that `append` takes.
    """

    def __init__(
        self, group: h5py.Group, attributes: Mapping[str, Mapping[str, Any]], chunk: int = CHUNK
    ) -> None:
        self._group = group
        self._attributes = attributes
        self._buffer = np.zeros((len(attributes), chunk), dtype=SAMPLE)
        self._filled = 0
        self._written = 0
        self._datasets: list[h5py.Dataset] = []
        self._digests = [hashlib.sha256() for _ in attributes]

    @property
    def length(self) -> int:
        """Samples appended so far."""
        return self._written + self._filled

    @property
    def buffered_bytes(self) -> int:
        """Memory that waits for its chunk to fill; constant."""
        return self._buffer.nbytes

    def append(self, rows: Sequence[Array]) -> list[Array]:
        """Add samples, one row per dataset; returns the whole chunks written, as new arrays."""
        total = len(rows[0])
        taken = 0
        chunks = []
        while taken < total:
            count = min(total - taken, self._buffer.shape[1] - self._filled)
            for row, samples in zip(self._buffer, rows, strict=True):
                row[self._filled : self._filled + count] = samples[taken : taken + count]
            self._filled += count
            taken += count
            if self._filled == self._buffer.shape[1]:
                chunks.append(self._buffer.copy())
                self._write_chunk()
        return chunks

    def finish(self) -> Array:
        """Write what is left and the checksums; returns what was left, shape (rows, m)."""
        rest = self._buffer[:, : self._filled].copy()
        if self._filled or not self._datasets:
            self._write_chunk()
        for dataset, digest in zip(self._datasets, self._digests, strict=True):
            dataset.attrs[CHECKSUM] = digest.hexdigest()
        return rest

    def _write_chunk(self) -> None:
        if not self._datasets:
            # A short recording is one chunk of its own length.
            self._datasets = [self._create(name) for name in self._attributes]
        length = self._written + self._filled
        self._buffer[:, self._filled :] = 0.0
        for dataset, row, digest in zip(self._datasets, self._buffer, self._digests, strict=True):
            digest.update(row[: self._filled].data)
            if self._filled:
                packed = pack(row[: dataset.chunks[0]])
                dataset.resize((length,))
                dataset.id.write_direct_chunk((self._written,), packed)
        self._written, self._filled = length, 0

    def _create(self, name: str) -> h5py.Dataset:
        dataset = self._group.create_dataset(
            name,
            shape=(0,),
            maxshape=(None,),
            chunks=(max(1, self._filled),),
            dtype=SAMPLE,
            shuffle=True,
            compression="gzip",
            compression_opts=_LEVEL,
            track_times=False,
        )
        for key, value in self._attributes[name].items():
            dataset.attrs[key] = value
        return dataset


def pack(samples: Array) -> bytes:
    """A chunk as HDF5's shuffle and deflate filters would leave it."""
    shuffled = samples.view(np.uint8).reshape(-1, samples.itemsize).T.tobytes()
    packed: bytes = isal_zlib.compress(shuffled, _LEVEL)
    return packed


def copy_group(source: h5py.Group, target: h5py.Group) -> None:
    """Copy a group's content into an empty group of another file; chunks are not recompressed.

    Dimension scales refer to objects by address, so they are attached anew.
    """
    _copy_attributes(source, target)
    for name, item in source.items():
        if isinstance(item, h5py.Group):
            copy_group(item, target.create_group(name))
        else:
            _copy_dataset(item, target, name)
    if "axes" in source.attrs:
        attach_time(target, str(source.attrs["axes"][0]))


def _copy_dataset(source: h5py.Dataset, target: h5py.Group, name: str) -> None:
    plan = source.id.get_create_plist()
    plan.set_obj_track_times(False)
    copy = h5py.Dataset(
        h5py.h5d.create(target.id, name.encode(), source.id.get_type(), source.id.get_space(), plan)
    )
    if source.chunks is None:
        copy[()] = source[()]
    else:
        for start in range(0, len(source), source.chunks[0]):
            mask, packed = source.id.read_direct_chunk((start,))
            copy.id.write_direct_chunk((start,), packed, filter_mask=mask)
    _copy_attributes(source, copy)


def _copy_attributes(source: h5py.HLObject, target: h5py.HLObject) -> None:
    for name in source.attrs:
        if name not in _DIMENSION_SCALE_ATTRIBUTES:
            kind = source.attrs.get_id(name).dtype
            target.attrs.create(name, source.attrs[name], dtype=kind)
