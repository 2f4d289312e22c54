"""Writing HDF5 for NeXus readers in bounded memory.

Sample datasets are one-dimensional, chunked, and use HDF5's two standard filters, shuffle and
deflate, or only deflate if that is smaller. ISA-L compresses the chunks outside HDF5's global lock:
the file is equivalent to one from HDF5's filters, and written several times faster. Objects are
created through h5py's low-level interface, which takes a fifth of the time: a campaign has tens of
thousands of them. No object stores its creation time, so equal content gives equal bytes.
"""

from __future__ import annotations

import contextlib
import hashlib
import itertools
import os
from collections.abc import Iterator, Mapping, Sequence
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from h5py import h5a, h5d, h5ds, h5f, h5g, h5p, h5s, h5t
from numpy.typing import NDArray

from campaign.archive.layout.files import keep_umask, sha256_of
from campaign.archive.layout.storage import (
    CHECKSUM,
    CHUNK,
    LEVEL,
    SAMPLE,
    pack,
    shuffling_helps,
    storable,
)
from campaign.archive.writing.long_text import SHORT, LongText
from campaign.recording import Array

_MEMORY_FILES = itertools.count(1)
_STRING = h5py.string_dtype()
_TEXT = h5t.py_create(_STRING, logical=True)
_SAMPLE = h5t.IEEE_F64LE
_SCALAR = h5s.create(h5s.SCALAR)


def create_file(path: Path) -> h5py.File:
    """Create a file for HDF5 1.10 and later, without a creation time."""
    access = h5p.create(h5p.FILE_ACCESS)
    access.set_fclose_degree(h5f.CLOSE_STRONG)
    # In 1.10, headers have a third of the size, and checksums; a single chunk needs no index.
    access.set_libver_bounds(h5f.LIBVER_V110, h5f.LIBVER_V110)
    access.set_file_locking(False, False)
    plan = h5p.create(h5p.FILE_CREATE)
    plan.set_obj_track_times(False)
    keep_umask()
    return h5py.File(h5f.create(os.fsencode(path), h5f.ACC_TRUNC, plan, access))


def memory_file(label: str) -> h5py.File:
    """Create a file in memory, for groups to copy: a copy takes a tenth of the time of creation."""
    access = h5p.create(h5p.FILE_ACCESS)
    access.set_fapl_core(1 << 14, False)
    access.set_libver_bounds(h5f.LIBVER_V110, h5f.LIBVER_V110)
    name = f"{label}-{next(_MEMORY_FILES)}"  # HDF5 identifies files in memory by name
    return h5py.File(h5f.create(name.encode(), h5f.ACC_TRUNC, fapl=access))


@contextlib.contextmanager
def closing(file: h5py.File) -> Iterator[h5py.File]:
    """Close `file` after the block; after an error, suppress a second error of the closing."""
    try:
        yield file
    except BaseException:
        with contextlib.suppress(OSError, RuntimeError, ValueError):
            file.close()
        raise
    file.close()


def make_group(parent: h5py.Group, name: str, nx_class: str) -> h5py.Group:
    """Create a group of a NeXus class."""
    plan = h5p.create(h5p.GROUP_CREATE)
    plan.set_obj_track_times(False)
    group = h5py.Group(h5g.create(parent.id, name.encode(), gcpl=plan))
    put_attribute(group, "NX_class", nx_class)
    return group


def link(source: h5py.Group, name: str, target: h5py.Group, new_name: str) -> None:
    """Create a hard link in `target` to the member `name` of `source`."""
    target.id.links.create_hard(new_name.encode(), source.id, name.encode())


def put_attribute(item: h5py.HLObject, name: str, value: str) -> None:
    """Write a text attribute of variable length."""
    attribute = h5a.create(item.id, name.encode(), _TEXT, _SCALAR)
    attribute.write(np.array(value, dtype=_STRING))


def put_attributes(item: h5py.HLObject, attributes: Mapping[str, str]) -> None:
    """Write text attributes, in their order."""
    for name, value in attributes.items():
        put_attribute(item, name, value)


def put_root(file: h5py.File, version: str, time: str, default: str) -> None:
    """Write the attributes of a file's root; `default` is the entry that viewers open first."""
    root = {"NX_class": "NXroot", "creator": "campaign", "creator_version": version}
    put_attributes(file, {**root, "file_time": time, **({"default": default} if default else {})})


def put_text(group: h5py.Group, name: str, text: str, **attributes: str) -> None:
    """Write a text as a scalar of fixed length, so a reader knows its size before reading it."""
    raw = storable(text).encode("utf-8")
    size = max(1, len(raw))
    dataset = _put_scalar(group, name, _text_kind(size), np.array(raw, dtype=f"S{size}"), raw)
    put_attributes(dataset, attributes)


def put_integer(group: h5py.Group, name: str, value: int) -> None:
    """Write an integer as a 64-bit scalar."""
    number = np.array(value, dtype="<i8")
    _put_scalar(group, name, h5t.STD_I64LE, number, number.tobytes())


def put_number(group: h5py.Group, name: str, value: float, **attributes: str) -> None:
    """Write a number as a 64-bit float scalar."""
    number = np.array(value, dtype=SAMPLE)
    dataset = _put_scalar(group, name, _SAMPLE, number, number.tobytes())
    put_attributes(dataset, attributes)


def put_series(group: h5py.Group, name: str, values: Array, **attributes: str) -> None:
    """Write numbers, shape (n,), in the storage form of samples."""
    samples = np.ascontiguousarray(values, dtype=SAMPLE)
    chunk, shuffled = max(1, min(len(samples), CHUNK)), shuffling_helps(samples)
    dataset = create_series(group, name, len(samples), chunk, shuffled)
    put_attributes(h5py.Dataset(dataset), attributes)
    for start in range(0, len(samples), chunk):
        part = samples[start : start + chunk]
        whole = np.concatenate((part, np.zeros(chunk - len(part)))) if len(part) < chunk else part
        dataset.write_direct_chunk((start,), pack(whole, shuffled))


def put_texts(group: h5py.Group, name: str, texts: Sequence[str], **attributes: str) -> None:
    """Write a list of texts of variable length, for other programs: no reader here accepts it."""
    values = np.array([storable(text) for text in texts], dtype=_STRING)
    dataset = group.create_dataset(name, data=values, dtype=_STRING, track_times=False)
    put_attributes(dataset, attributes)


def _put_scalar(
    group: h5py.Group, name: str, kind: h5t.TypeID, value: NDArray[Any], raw: bytes
) -> h5py.Dataset:
    plan = _scalar_plan(compact=len(raw) <= SHORT)
    made = h5d.create(group.id, name.encode(), kind, _SCALAR, plan)
    made.write(h5s.ALL, h5s.ALL, value, kind)
    _put_checksum(made, hashlib.sha256(raw).hexdigest())
    return h5py.Dataset(made)


def _put_checksum(dataset: h5d.DatasetID, digest: str) -> None:
    """Write a checksum as a text of fixed length, which is not in a global heap: before it reads
    a heap, a reader scans the whole file (`global_heap_check`).
    """
    kind = _text_kind(len(digest))
    attribute = h5a.create(dataset, CHECKSUM.encode(), kind, _SCALAR)
    attribute.write(np.array(digest, dtype="S"), kind)


@cache
def _scalar_plan(compact: bool) -> h5p.PropDCID:
    plan = h5p.create(h5p.DATASET_CREATE)
    plan.set_obj_track_times(False)
    if compact:
        plan.set_layout(h5d.COMPACT)
    return plan


def put_long_text(group: h5py.Group, name: str, text: LongText) -> int:
    """Allocate a text in the form of `put_text`; return its offset, for writing after closing."""
    plan = h5p.create(h5p.DATASET_CREATE)
    plan.set_obj_track_times(False)
    plan.set_alloc_time(h5d.ALLOC_TIME_EARLY)
    plan.set_fill_time(h5d.FILL_TIME_NEVER)
    made = h5d.create(group.id, name.encode(), _text_kind(text.size), _SCALAR, plan)
    _put_checksum(made, text.sha256)
    return int(made.get_offset())


def _text_kind(size: int) -> h5t.TypeID:
    kind = h5t.C_S1.copy()
    kind.set_size(size)
    kind.set_strpad(h5t.STR_NULLPAD)
    kind.set_cset(h5t.CSET_UTF8)
    return kind


def blank_digest(group: h5py.Group, name: str) -> tuple[int, int]:
    """Allocate the hash of the file of `group`; return its offset and length in the file.

    Contains 64 digits `0` until sealing overwrites them. The only dataset without its own checksum.
    """
    digits = np.array(b"0" * 64, dtype="S64")
    dataset = group.create_dataset(name, data=digits, track_times=False)
    group.file.flush()
    return dataset.id.get_offset(), 64


def put_file_hash(path: Path, place: tuple[int, int]) -> None:
    """Write the hash of a closed file at the place from `blank_digest`, whose bytes count as 0.

    It stays in the file, is unaffected by a viewer that opens the file for writing without changes,
    and detects any changed byte.
    """
    digest = sha256_of(path, place)
    with path.open("r+b") as file:
        file.seek(place[0])
        file.write(digest.encode("ascii"))


def attach_time(group: h5py.Group, time: str = "time") -> None:
    """Attach the axis `time` as the dimension scale to every series in `group`."""
    scale = h5d.open(group.id, time.encode())
    h5ds.set_scale(scale, time.encode())
    for name in group.id:
        if name not in (time.encode(), b"title"):
            h5ds.attach_scale(h5d.open(group.id, name), scale, 0)


def create_series(
    group: h5py.Group, name: str, length: int, chunk: int, shuffled: bool
) -> h5d.DatasetID:
    """Create a dataset for samples; the caller writes compressed chunks."""
    size, limit = (length,), (max(length, chunk),)
    space = h5s.create_simple(size, limit)
    return h5d.create(group.id, name.encode(), _SAMPLE, space, _series_plan(chunk, shuffled))


@lru_cache(maxsize=16)
def _series_plan(chunk: int, shuffled: bool) -> h5p.PropDCID:
    plan = h5p.create(h5p.DATASET_CREATE)
    plan.set_obj_track_times(False)
    plan.set_chunk((chunk,))
    if shuffled:
        plan.set_shuffle()
    plan.set_deflate(LEVEL)
    return plan
