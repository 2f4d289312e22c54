"""Reading untrusted HDF5 files: checked structure, bounded sizes.

A file may be truncated, damaged or malicious. Nothing outside the file is followed (external and
soft links, external storage, virtual datasets). No filter is loaded (only shuffle and deflate are
allowed). Only fixed-length text, 64-bit integers and float64 are read, never an object type. Every
size is compared with the stored bytes before memory is allocated. Every dataset must match its
checksum.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Iterator, Mapping
from contextvars import ContextVar
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from h5py import h5a, h5d, h5f, h5g, h5i, h5o, h5s, h5t

from campaign.archive.layout.files import lines_of, sha256_of, sha256_of_part, why
from campaign.archive.layout.storage import CHECKSUM, SAMPLE
from campaign.archive.reading.global_heap_check import heaps_are_sound
from campaign.errors import ArchiveError

MISMATCH = "does not match its checksum; it was damaged or changed"
_ALLOWED_FILTERS = {h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_DEFLATE}
_LARGEST_ATTRIBUTE = 1 << 16  # bytes
_TEXT = h5py.string_dtype()

_SOUND: dict[bytes, bool] = {}
"""Whether the heaps of an open file are undamaged, by file name; only files checked so far."""

# Exceptions of h5py on damage: not documented, so all kinds.
_DAMAGE = (
    OSError,
    RuntimeError,
    ValueError,
    TypeError,
    LookupError,
    AttributeError,
    ArithmeticError,
    MemoryError,
    SystemError,
)


@contextlib.contextmanager
def guarded(path: Path, place: str = "") -> Iterator[None]:
    """Convert any failure in the block to an ArchiveError with the file and the place in it."""
    try:
        yield
    except ArchiveError:
        raise
    except _DAMAGE as error:
        where = f"{path}: {place}" if place else str(path)
        raise ArchiveError(f"{where}: cannot be read: {why(error)}") from None


_HELD: ContextVar[Mapping[Path, h5py.File]] = ContextVar("held files", default={})  # noqa: B039
"""Files of this thread that stay open until the end of their `held_open` block."""


@contextlib.contextmanager
def held_open(path: Path) -> Iterator[None]:
    """Keep the file open in the block, so that this thread reads all its trials from one handle.

    Opening takes more time than reading a channel of a short trial. A file that cannot be opened
    is not held; the reader gets the error.
    """
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(ArchiveError):
            file = stack.enter_context(open_file(path))
            token = _HELD.set({**_HELD.get(), path: file})
            stack.callback(_HELD.reset, token)
        yield


@contextlib.contextmanager
def open_file(path: Path) -> Iterator[h5py.File]:
    """Open an HDF5 file for reading; raises ArchiveError if it is missing, cut off or not HDF5."""
    if (held := _HELD.get().get(path)) is not None:
        yield held
        return
    with guarded(path):
        if not path.is_file():
            raise ArchiveError(f"{path}: there is no such file")
        if not h5py.is_hdf5(path):
            raise ArchiveError(f"{path}: is not an archive (not HDF5, or its beginning is damaged)")
        size, stated = path.stat().st_size, _stated_size(path)
        if size < stated:
            raise ArchiveError(
                f"{path}: is cut off: {size} of {stated} bytes are there; copy it again"
            )
        with h5py.File(path, "r", locking=False) as file:
            _SOUND.pop(h5f.get_name(file.id), None)
            yield file


def _stated_size(path: Path) -> int:
    """End of an HDF5 file from its superblock of version 2 or 3 (format specification, II.A)."""
    with path.open("rb") as file:
        begin = file.read(36)
    return int.from_bytes(begin[28:36], "little") if begin[8:10] in (b"\2\x08", b"\3\x08") else 0


def group_at(parent: h5py.Group, name: str, nx_class: str) -> h5py.Group:
    """The group `name`, stored in this file, of the NeXus class."""
    group = inner_group(parent, name)
    if attribute(group, "NX_class") != nx_class:
        raise ArchiveError(f"{place_of(parent, name)}: is not of class {nx_class}")
    return group


def inner_group(parent: h5py.Group, name: str) -> h5py.Group:
    """The group `name`, stored in this file, of any class."""
    group = member(parent, name)
    if group is None:
        raise ArchiveError(f"{place_of(parent, name)}: is not a group")
    return group


def member(parent: h5py.Group, name: str) -> h5py.Group | None:
    """The group `name`, of any class; None if it is a dataset. No link is followed."""
    item = own_id(parent, name)
    if isinstance(item, h5d.DatasetID):
        return None
    if not isinstance(item, h5g.GroupID):
        raise ArchiveError(f"{place_of(parent, name)}: is neither a group nor a dataset")
    return h5py.Group(item)


def check_dataset(parent: h5py.Group, name: str) -> int:
    """Compare a text or number with its checksum; return its size in the file (bytes)."""
    dataset = _dataset_at(parent, name)
    if dataset.shape == () and dataset.dtype.kind == "S":
        text_at(parent, name)
    elif dataset.shape == () and dataset.dtype in (np.dtype("<i8"), SAMPLE):
        _check(dataset.id, np.asarray(dataset[()], dtype=dataset.dtype).tobytes())
    else:
        raise ArchiveError(f"{place_of(parent, name)}: is neither a text nor a number")
    return int(dataset.id.get_storage_size())


def names(group: h5py.Group) -> list[str]:
    """Names of the members of `group`, sorted."""
    return sorted(name.decode("utf-8", "surrogateescape") for name in group.id)


def text_at(parent: h5py.Group, name: str, digest: str | None = None) -> str:
    """A text, checked against `digest`, or against its own attribute if None."""
    return raw_text_at(parent, name, digest).decode("utf-8")


def raw_text_at(parent: h5py.Group, name: str, digest: str | None = None) -> bytes:
    """As `text_at`, in UTF-8."""
    dataset, raw = _raw_text(parent, name)
    _check(dataset, raw, digest)
    return raw


def check_text_at(parent: h5py.Group, name: str, digest: str | None = None) -> None:
    """As `text_at`, in constant memory."""
    dataset = _text_id(parent, name)
    if (place := _place_in_file(dataset)) is None:
        text_at(parent, name, digest)
    else:
        _compare(dataset, sha256_of_part(*place), digest)


def unchecked_text_at(parent: h5py.Group, name: str) -> str:
    """A text without a check; it may be damaged."""
    return unchecked_raw_text_at(parent, name).decode("utf-8", "replace")


def unchecked_raw_text_at(parent: h5py.Group, name: str) -> bytes:
    """As `unchecked_text_at`, in UTF-8."""
    return _raw_text(parent, name)[1]


def _raw_text(parent: h5py.Group, name: str) -> tuple[h5d.DatasetID, bytes]:
    dataset = _text_id(parent, name)
    if (place := _place_in_file(dataset)) is None:
        value = np.empty((), dtype=dataset.dtype)
        dataset.read(h5s.ALL, h5s.ALL, value)
        return dataset, value.tobytes().rstrip(b"\0")
    path, offset, size = place
    with path.open("rb") as file:  # without HDF5's copy: an index may be large
        file.seek(offset)
        return dataset, file.read(size).rstrip(b"\0")


def line_digests_at(parent: h5py.Group, name: str) -> Iterator[str]:
    """SHA-256 of each complete line of a text, without its end; the text may be damaged."""
    place = _place_in_file(_text_id(parent, name))
    lines = _raw_text(parent, name)[1].split(b"\n")[:-1] if place is None else lines_of(*place)
    return (hashlib.sha256(line).hexdigest() for line in lines)


def _place_in_file(dataset: h5d.DatasetID) -> tuple[Path, int, int] | None:
    """File, offset and size (bytes) of a contiguous dataset; None if in its object header."""
    offset = dataset.get_offset()
    if offset is None:
        return None
    return Path(os.fsdecode(h5f.get_name(dataset))), offset, dataset.get_storage_size()


def _text_id(parent: h5py.Group, name: str) -> h5d.DatasetID:
    dataset, plan = _dataset_id(parent, name)
    kind = dataset.dtype
    if dataset.rank or kind.kind != "S" or plan.get_layout() == h5d.CHUNKED:
        raise ArchiveError(f"{place_of(parent, name)}: is not a text of fixed length")
    if dataset.get_storage_size() != kind.itemsize:
        raise ArchiveError(f"{place_of(parent, name)}: is not stored whole")
    return dataset


def digest_at(parent: h5py.Group, path: str) -> tuple[str, tuple[int, int]]:
    """The file's own hash, and its offset and length in the file."""
    *groups, name = path.split("/")
    for group in groups:
        parent = inner_group(parent, group)
    dataset = _dataset_at(parent, name)
    offset = dataset.id.get_offset()
    if dataset.shape != () or dataset.dtype != np.dtype("S64") or offset is None:
        raise ArchiveError(f"{place_of(parent, name)}: is not a hash")
    return bytes(dataset[()]).decode("ascii", "replace"), (offset, 64)


def check_file_hash(parent: h5py.Group, path: str) -> None:
    """Compare the whole file with its own hash. Raises ArchiveError if it differs."""
    digest, place = digest_at(parent, path)
    file = Path(parent.file.filename)
    if sha256_of(file, place) != digest:
        raise ArchiveError(f"{file}: does not match its own hash; it was damaged or changed")


def integer_at(parent: h5py.Group, name: str, digest: str | None = None) -> int:
    """An integer, checked against the digest of its decimal digits, or its own attribute."""
    dataset = _dataset_at(parent, name)
    if dataset.shape != () or dataset.dtype != np.dtype("<i8"):
        raise ArchiveError(f"{place_of(parent, name)}: is not a 64-bit whole number")
    value = np.asarray(dataset[()], dtype="<i8")
    if digest is None:
        _check(dataset.id, value.tobytes())
    else:
        _check(dataset.id, str(int(value)).encode(), digest)
    return int(value)


def attribute(item: h5py.HLObject, name: str) -> str:
    """A text attribute; raises ArchiveError if it is missing."""
    return _text_attribute(item.id, name)


def check_attribute(item: h5d.DatasetID, name: str, recorded: str) -> None:
    """Raise ArchiveError if a text attribute differs from the recorded text."""
    if (actual := _text_attribute(item, name)) != recorded:
        raise ArchiveError(f"{_named(item)}@{name}: is {actual!r}, and {recorded!r} was recorded")


def _text_attribute(item: h5g.GroupID | h5d.DatasetID, name: str) -> str:
    identifier = _attribute(item, name)
    kind = identifier.get_type()
    if not isinstance(kind, h5t.TypeStringID):
        raise ArchiveError(f"{_named(item)}@{name}: is not a text")
    value = np.empty((), dtype=_TEXT if kind.is_variable_str() else kind.dtype)
    identifier.read(value)
    return bytes(value[()]).decode("utf-8")


def text_list(item: h5py.HLObject, name: str) -> list[str]:
    """An attribute that is a list of texts; empty if it is missing."""
    if name not in item.attrs:
        return []
    identifier = _attribute(item.id, name)
    if len(identifier.shape) != 1 or h5py.check_string_dtype(identifier.dtype) is None:
        raise ArchiveError(f"{item.file.filename}: {item.name}@{name}: is not a list of texts")
    return [str(text) for text in item.attrs[name]]


def _attribute(item: h5g.GroupID | h5d.DatasetID, name: str) -> h5a.AttrID:
    try:
        identifier = h5a.open(item, name.encode())
    except KeyError:
        raise ArchiveError(f"{_named(item)}@{name}: is missing") from None
    if identifier.get_storage_size() > _LARGEST_ATTRIBUTE:
        raise ArchiveError(f"{_named(item)}@{name}: is too large")
    kind = identifier.get_type()
    if not isinstance(kind, h5t.TypeStringID) or kind.is_variable_str():  # it is in a heap
        file = h5f.get_name(item)
        if file not in _SOUND:
            _SOUND[file] = heaps_are_sound(Path(os.fsdecode(file)))
        if not _SOUND[file]:
            what = "cannot be read: its attributes are damaged"
            raise ArchiveError(f"{os.fsdecode(file)}: {what}")
    return identifier


def own_id(parent: h5py.Group, name: str) -> Any:
    """The direct member `name` of `parent`; no link is followed.

    It is an object of HDF5's low-level interface: faster for tens of thousands of objects.
    """
    raw = name.encode()
    if "/" in name or name == ".":  # of a path, only the last link would be checked
        raise ArchiveError(f"{place_of(parent, name)}: is a path, not a name")
    group = parent.id
    try:
        link = group.links.get_info(raw) if raw else None
    except _DAMAGE:
        if raw in group:
            raise
        link = None
    if link is None:
        raise ArchiveError(f"{place_of(parent, name)}: is missing")
    if link.type != h5py.h5l.TYPE_HARD:
        raise ArchiveError(f"{place_of(parent, name)}: is a link, and links are not followed")
    return h5o.open(group, raw)


def _dataset_at(parent: h5py.Group, name: str) -> h5py.Dataset:
    return h5py.Dataset(_dataset_id(parent, name)[0])


def _dataset_id(parent: h5py.Group, name: str) -> tuple[h5d.DatasetID, h5py.h5p.PropDCID]:
    """A dataset stored in this file, and its creation properties (layout, filters)."""
    dataset = own_id(parent, name)
    if not isinstance(dataset, h5d.DatasetID):
        raise ArchiveError(f"{place_of(parent, name)}: is not a dataset")
    plan = dataset.get_create_plist()
    layout = plan.get_layout()
    if layout == h5d.VIRTUAL or (layout == h5d.CONTIGUOUS and plan.get_external_count()):
        raise ArchiveError(f"{place_of(parent, name)}: lies in another file, which is not opened")
    filters = {plan.get_filter(number)[0] for number in range(plan.get_nfilters())}
    if not filters <= _ALLOWED_FILTERS:
        raise ArchiveError(
            f"{place_of(parent, name)}: is stored with a filter other than shuffle and deflate"
        )
    return dataset, plan


def _check(dataset: h5d.DatasetID, raw: Any, digest: str | None = None) -> None:
    _compare(dataset, hashlib.sha256(raw).hexdigest(), digest)


def _compare(dataset: h5d.DatasetID, found: str, digest: str | None = None) -> None:
    """Raise ArchiveError if `found` differs from `digest`, or from the dataset's attribute."""
    if (_text_attribute(dataset, CHECKSUM) if digest is None else digest) != found:
        raise ArchiveError(f"{_named(dataset)}: {MISMATCH}")


def _named(item: h5g.GroupID | h5d.DatasetID) -> str:
    """File and path, for messages."""
    return f"{os.fsdecode(h5f.get_name(item))}: {os.fsdecode(h5i.get_name(item))}"


def place_of(parent: h5py.Group, name: str) -> str:
    """File and path of a member of a group, for messages."""
    return f"{parent.file.filename}: {parent.name.rstrip('/')}/{name}"
