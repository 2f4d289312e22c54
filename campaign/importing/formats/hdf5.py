"""HDF5 files, including MATLAB version 7.3: datasets by path, read in parts.

Nothing outside the file is opened: links to other files and datasets with external data are
omitted.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from campaign.importing.arrays import OPAQUE, WIDEST, NamedArray, tables_of
from campaign.importing.interface import Array, RecordingError, RecordingFormat, Table, read_by
from campaign.importing.subprocess_reader import tables_streamed

MAGIC = b"\x89HDF\r\n\x1a\n"
MOST = 10_000
"""Maximum number of objects of a file that are examined."""
CLASS = "MATLAB_class"
PLAIN = {"double", "single", "logical", "int8", "int16", "int32", "int64"}
PLAIN |= {"uint8", "uint16", "uint32", "uint64"}
"""MATLAB's classes of numbers."""


def tables(path: Path) -> Sequence[Table]:
    """The tables of a file, read in this process; a broken file can crash it."""
    import h5py

    arrays: list[NamedArray] = []
    objects: list[str] = []
    with read_by("h5py", path, "HDF5 file"), h5py.File(path, "r") as file:
        for name, dataset in _datasets(file):
            _sort_out(path, name, dataset, arrays, objects)
    if not arrays:
        message = f"{objects[0]} {OPAQUE}" if objects else "no dataset of it is a series of numbers"
        raise RecordingError.of(path, message)
    return tables_of(arrays)


def _datasets(file: Any) -> Iterator[tuple[str, Any]]:
    """Every dataset in the file itself, by dotted path, in the order of names."""
    import h5py

    waiting = [("", file)]
    seen, looked = {h5py.h5o.get_info(file.id).addr}, 0
    while waiting:
        prefix, here = waiting.pop()
        for name in sorted(here):
            looked += 1
            if looked > MOST:
                return
            link = here.get(name, getlink=True)
            path = f"{prefix}{name}"
            if not isinstance(link, h5py.HardLink) or name == "#refs#":
                continue
            item = here[name]
            address = h5py.h5o.get_info(item.id).addr
            if isinstance(item, h5py.Dataset):
                yield path, item
            elif isinstance(item, h5py.Group) and address not in seen:
                seen.add(address)
                waiting.append((f"{path}.", item))


def _sort_out(
    path: Path, name: str, dataset: Any, arrays: list[NamedArray], objects: list[str]
) -> None:
    kind = dataset.attrs.get(CLASS, b"")
    kind = kind.decode("ascii", "replace") if isinstance(kind, bytes) else str(kind)
    if dataset.shape is None or dataset.is_virtual or dataset.external:
        return  # without numbers, or with numbers in other files
    if kind and kind not in PLAIN:
        if kind not in ("char", "cell", "struct", "function_handle"):
            objects.append(name)
    elif "MATLAB_empty" not in dataset.attrs and dataset.dtype.kind in "fiub" and dataset.size > 1:
        shape = [length for length in dataset.shape if length > 1]
        if len(shape) in (1, 2) and (len(shape) == 1 or min(shape) <= WIDEST):
            arrays.append(_named(path, name, dataset, bool(kind)))


def _named(path: Path, name: str, dataset: Any, matlab: bool) -> NamedArray:
    """The array of a dataset; MATLAB's arrays are transposed in the file."""
    along = int(np.argmax(dataset.shape))
    unit = dataset.attrs.get("units", dataset.attrs.get("unit", ""))
    unit = unit.decode("utf-8", "replace") if isinstance(unit, bytes) else unit
    return NamedArray(
        name,
        tuple(length for length in dataset.shape if length > 1),
        partial(_part, path, dataset.name, along),
        unit if isinstance(unit, str) else "",
        by_rows=(along == 0) == matlab and dataset.ndim > 1,
    )


def _part(path: Path, name: str, along: int, start: int, stop: int) -> Array:
    import h5py

    what = f"HDF5 file: {name}, from sample {start},"
    with read_by("h5py", path, what), h5py.File(path, "r") as file:
        dataset = file[name]
        where = [slice(None)] * dataset.ndim
        where[along] = slice(start, stop)
        values = np.moveaxis(dataset[tuple(where)], along, 0)
    series: Array = values.reshape(stop - start, -1).astype(np.float64)
    return series


FORMAT = RecordingFormat(
    "hdf5",
    "HDF5, and MAT files of version 7.3",
    (".h5", ".hdf5", ".hdf", ".mat", ".nxs"),
    lambda head: head.startswith(MAGIC) or head[512 : 512 + len(MAGIC)] == MAGIC,
    partial(tables_streamed, __name__),
)
