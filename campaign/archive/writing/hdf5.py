"""Writing HDF5 the way every NeXus reader understands, in flat memory.

Sample datasets are one-dimensional, chunked, and pass HDF5's two standard filters, shuffle and
deflate, or deflate alone where that is smaller. The chunks are compressed here, by ISA-L outside
HDF5's global lock, and handed over ready: a file like the one HDF5's own filters would write,
several times faster. Objects are made through h5py's low-level interface, which costs a fifth of
the other: a campaign has tens of thousands of them. No object notes when it was made, so equal
content makes equal bytes.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from h5py import h5a, h5d, h5ds, h5f, h5g, h5o, h5p, h5s, h5t
from numpy.typing import NDArray

from campaign.archive.layout.checksums import SeriesDigest
from campaign.archive.layout.files import keep_umask
from campaign.archive.layout.storage import CHECKSUM, CHUNK, LEVEL, SAMPLE, pack, storable

Array = NDArray[np.float64]


_TRIED = 4096  # samples on which both ways of storing a series are tried ...
_DIFFER = 1024  # ... unless so many of them all differ, as those of no converter do
_COMPACT = 32_000  # bytes of a text that lies in its own header; HDF5 allows 64 kB with attributes
_STRING = h5py.string_dtype()
_TEXT = h5t.py_create(_STRING, logical=True)
_SAMPLE = h5t.IEEE_F64LE
_SCALAR = h5s.create(h5s.SCALAR)
_SCALES = (b"CLASS", b"NAME", b"REFERENCE_LIST", b"DIMENSION_LIST")  # what dimension scales leave


def create_file(path: Path) -> h5py.File:
    """A new file that HDF5 1.10 and everything since reads; nothing in it notes its time."""
    access = h5p.create(h5p.FILE_ACCESS)
    access.set_fclose_degree(h5f.CLOSE_STRONG)
    # Since 1.10 headers are a third as large, with checksums, and one chunk needs no index.
    access.set_libver_bounds(h5f.LIBVER_V110, h5f.LIBVER_V110)
    access.set_file_locking(False, False)
    plan = h5p.create(h5p.FILE_CREATE)
    plan.set_obj_track_times(False)
    keep_umask()
    return h5py.File(h5f.create(os.fsencode(path), h5f.ACC_TRUNC, plan, access))


@contextlib.contextmanager
def closing(file: h5py.File) -> Iterator[h5py.File]:
    """Closes `file`; after an error its handle is let go of without a second error on top."""
    try:
        yield file
    except BaseException:
        with contextlib.suppress(OSError, RuntimeError, ValueError):
            file.close()
        raise
    file.close()


def make_group(parent: h5py.Group, name: str, nx_class: str) -> h5py.Group:
    """A group of a NeXus class."""
    plan = h5p.create(h5p.GROUP_CREATE)
    plan.set_obj_track_times(False)
    group = h5py.Group(h5g.create(parent.id, name.encode(), gcpl=plan))
    put_attribute(group, "NX_class", nx_class)
    return group


def link(source: h5py.Group, name: str, target: h5py.Group, new_name: str) -> None:
    """Let what `source` has as `name` be found in `target`, too: a second name, not a copy."""
    target.id.links.create_hard(new_name.encode(), source.id, name.encode())


def put_attribute(item: h5py.HLObject, name: str, value: str) -> None:
    """A text attribute of variable length."""
    attribute = h5a.create(item.id, name.encode(), _TEXT, _SCALAR)
    attribute.write(np.array(value, dtype=_STRING))


def put_text(group: h5py.Group, name: str, text: str, **attributes: str) -> None:
    """A text as a scalar of fixed length, so that a reader knows its size before reading it."""
    raw = storable(text).encode("utf-8")
    kind = h5t.C_S1.copy()
    kind.set_size(max(1, len(raw)))
    kind.set_strpad(h5t.STR_NULLPAD)
    kind.set_cset(h5t.CSET_UTF8)
    dataset = _put_scalar(group, name, kind, np.array(raw, dtype=f"S{max(1, len(raw))}"), raw)
    for key, value in attributes.items():
        put_attribute(dataset, key, value)


def put_integer(group: h5py.Group, name: str, value: int) -> None:
    """A whole number as a 64-bit scalar."""
    number = np.array(value, dtype="<i8")
    _put_scalar(group, name, h5t.STD_I64LE, number, number.tobytes())


def put_number(group: h5py.Group, name: str, value: float, **attributes: str) -> None:
    """A number as a 64-bit float scalar."""
    number = np.array(value, dtype=SAMPLE)
    dataset = _put_scalar(group, name, _SAMPLE, number, number.tobytes())
    for key, text in attributes.items():
        put_attribute(dataset, key, text)


def put_series(group: h5py.Group, name: str, values: Array, **attributes: str) -> h5py.Dataset:
    """Numbers, shape (n,), as samples are stored."""
    column = SampleColumns(group, {name: attributes})
    column.append([values])
    column.finish()
    return group[name]


def put_texts(group: h5py.Group, name: str, texts: Sequence[str], **attributes: str) -> None:
    """A list of texts of variable length, for other programs: no reader here opens such a one."""
    told = np.array([storable(text) for text in texts], dtype=_STRING)
    dataset = group.create_dataset(name, data=told, dtype=_STRING, track_times=False)
    for key, value in attributes.items():
        put_attribute(dataset, key, value)


def _put_scalar(
    group: h5py.Group, name: str, kind: h5t.TypeID, value: NDArray[Any], raw: bytes
) -> h5py.Dataset:
    plan = _scalar_plan(compact=len(raw) <= _COMPACT)
    made = h5d.create(group.id, name.encode(), kind, _SCALAR, plan)
    made.write(h5s.ALL, h5s.ALL, value, kind)
    dataset = h5py.Dataset(made)
    put_attribute(dataset, CHECKSUM, hashlib.sha256(raw).hexdigest())
    return dataset


@cache
def _scalar_plan(compact: bool) -> h5p.PropDCID:
    plan = h5p.create(h5p.DATASET_CREATE)
    plan.set_obj_track_times(False)
    if compact:
        plan.set_layout(h5d.COMPACT)
    return plan


def blank_digest(group: h5py.Group, name: str) -> tuple[int, int]:
    """Room for the hash of the file that `group` is in; returns where it stands in the file.

    64 digits `0` until `sealing` puts the hash over them. The only dataset without a checksum
    of its own.
    """
    digits = np.array(b"0" * 64, dtype="S64")
    dataset = group.create_dataset(name, data=digits, track_times=False)
    group.file.flush()
    return dataset.id.get_offset(), 64


def attach_time(group: h5py.Group, time: str = "time") -> None:
    """Make `time`, or another axis, the dimension scale of every series in `group`."""
    scale = h5d.open(group.id, time.encode())
    h5ds.set_scale(scale, time.encode())
    for name in group.id:
        if name not in (time.encode(), b"title"):
            h5ds.attach_scale(h5d.open(group.id, name), scale, 0)


def copy_entry(source: h5py.File, name: str, target: h5py.File, new_name: str) -> None:
    """Copy an entry to another file; chunks are not recompressed.

    Dimension scales refer to objects by address, which changes, so they are attached here.
    """
    h5o.copy(source.id, name.encode(), target.id, new_name.encode())
    for data in _plotted(target[new_name]):
        attach_time(data)


def copy_entry_back(
    source: h5py.File, name: str, target: h5py.File, new_name: str, members: Iterable[str]
) -> None:
    """Copy some members of an entry out of a sealed file, without dimension scales."""
    entry = make_group(target, new_name, "NXentry")
    if "default" in source[name].attrs:
        put_attribute(entry, "default", source[name].attrs["default"])
    for member in members:
        h5o.copy(source[name].id, member.encode(), entry.id, member.encode())
    for data in _plotted(entry):
        if "title" in data:  # a second name, of which copying made a second text
            del data["title"]
            link(entry, "title", data, "title")
        for item in data.values():
            for attribute in _SCALES:
                if h5a.exists(item.id, attribute):
                    h5a.delete(item.id, attribute)


def _plotted(entry: h5py.Group) -> list[h5py.Group]:
    return [entry[name] for name in ("data", "preview") if name in entry]


class SampleColumns:
    """Datasets of equal length, written as their samples come; one chunk of each is in memory.

    Args:
        group: where they go; None: nowhere, only their digests are wanted.
        attributes: of each dataset, by name, in the order of the rows that `append` takes.
    """

    def __init__(
        self,
        group: h5py.Group | None,
        attributes: Mapping[str, Mapping[str, str]],
        chunk: int = CHUNK,
    ) -> None:
        self._group = group
        self._attributes = attributes
        self._buffer = np.zeros((len(attributes), chunk), dtype=SAMPLE)
        self._filled = 0
        self._written = 0
        self._columns: list[_Column] = []
        self._digests = [SeriesDigest() for _ in attributes]

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

    def finish(self) -> tuple[Array, list[str]]:
        """Write what is left; returns that, shape (rows, m), and the digest of every series."""
        rest = self._buffer[:, : self._filled].copy()
        if self._filled or not self._columns:
            self._write_chunk()
        return rest, [digest.hexdigest() for digest in self._digests]

    def _write_chunk(self) -> None:
        for row, digest in zip(self._buffer, self._digests, strict=True):
            digest.update(row[: self._filled])
        if self._group is not None:
            self._store_chunk(self._group)
        self._written, self._filled = self._written + self._filled, 0

    def _store_chunk(self, group: h5py.Group) -> None:
        if not self._columns:
            # A short recording is one chunk of its own length, and its size is known.
            more = self._filled in (0, self._buffer.shape[1])
            self._columns = [
                _create_column(group, name, attributes, row[: self._filled], more)
                for (name, attributes), row in zip(
                    self._attributes.items(), self._buffer, strict=True
                )
            ]
        length = self._written + self._filled
        self._buffer[:, self._filled :] = 0.0
        for column, row in zip(self._columns, self._buffer, strict=True):
            if self._filled:
                column.write(row, self._written, length)


@dataclass(frozen=True)
class _Column:
    """One dataset of samples. `shuffled` says whether its chunks pass the shuffle filter."""

    dataset: h5py.Dataset
    chunk: int
    shuffled: bool
    grows: bool

    def write(self, row: Array, start: int, length: int) -> None:
        """Write the chunk that begins at `start`; the series then has `length` samples."""
        packed = pack(row[: self.chunk], self.shuffled)
        if self.grows:
            self.dataset.id.set_extent((length,))
        self.dataset.id.write_direct_chunk((start,), packed)


def _create_column(
    group: h5py.Group, name: str, attributes: Mapping[str, str], first: Array, grows: bool
) -> _Column:
    """A dataset for the samples of which `first` are the first chunk."""
    chunk = max(1, len(first))
    shuffled = _shuffling_helps(first[:_TRIED])
    size, limit = ((0,), (h5s.UNLIMITED,)) if grows else (first.shape, first.shape)
    space, plan = h5s.create_simple(size, limit), _series_plan(chunk, shuffled)
    dataset = h5py.Dataset(h5d.create(group.id, name.encode(), _SAMPLE, space, plan))
    for key, value in attributes.items():
        put_attribute(dataset, key, value)
    return _Column(dataset, chunk, shuffled, grows)


@lru_cache(maxsize=16)
def _series_plan(chunk: int, shuffled: bool) -> h5p.PropDCID:
    plan = h5p.create(h5p.DATASET_CREATE)
    plan.set_obj_track_times(False)
    plan.set_chunk((chunk,))
    if shuffled:
        plan.set_shuffle()
    plan.set_deflate(LEVEL)
    return plan


def _shuffling_helps(samples: Array) -> bool:
    """Whether samples are better stored with all first bytes first, then all second ones ...

    They are, but for those of a converter: few values, each of which comes again and again whole.
    """
    told = samples[:_DIFFER]
    if len(np.unique(told)) == len(told):
        return True
    return len(pack(samples, shuffled=True)) <= len(pack(samples, shuffled=False))
