"""MAT files of version 4 to 7.2: variables, Simulink structures, dSPACE X and Y.

Version 7.3 is HDF5 (`hdf5.py`). Objects of MATLAB's classes (timeseries, table, datetime) have no
documented format; if a file holds nothing else, the error says how to save their content.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from campaign.importing.arrays import OPAQUE, NamedArray, named, table_of, tables_of
from campaign.importing.interface import (
    LARGEST_PART,
    MOST_UNPACKED,
    RecordingError,
    RecordingFormat,
    Table,
    read_by,
)
from campaign.importing.subprocess_reader import tables_streamed

MOST_TIMES = 100
"""Largest ratio of unpacked to file size: measurements contain noise and compress less."""
_COMPRESSED, _BLOCK = 15, 1 << 20
DEEPEST = 8
"""Maximum depth of nested structures."""


def tables(path: Path) -> Sequence[Table]:
    """The tables of a MAT file, read in this process. Raises RecordingError."""
    from scipy.io import loadmat

    _check_size(path)
    with read_by("scipy", path, "MAT file of version 4 to 7.2"):
        # mat_dtype: MATLAB may store integral numbers as bytes, whose differences wrap around.
        variables = loadmat(path, mat_dtype=True, struct_as_record=False, squeeze_me=True)
    whole: list[Table] = []
    arrays: list[NamedArray] = []
    objects: list[str] = []
    for name, value in variables.items():
        if not name.startswith("__") and name != "None":
            _sort_out(name, value, whole, arrays, objects)
    whole += tables_of(arrays)
    if not whole:
        nameless = not {"None", "__function_workspace__"}.isdisjoint(variables)
        if not objects and not nameless:
            raise RecordingError.of(path, "no variable of it is a series of numbers")
        raise RecordingError.of(path, f"{(*objects, 'a variable')[0]} {OPAQUE}")
    return whole


def _check_size(path: Path) -> None:
    """Raises RecordingError for a file that unpacks to too many bytes; counts without storing."""
    unpacked = 0
    with suppress(OSError, zlib.error), path.open("rb") as file:  # the reader reports these
        most = min(MOST_UNPACKED, max(LARGEST_PART, MOST_TIMES * path.stat().st_size))
        for count in _unpacking(file):
            unpacked += count
            if unpacked > most:
                message = f"it unpacks to more than {most / 1e9:.3g} GB, which is too much"
                raise RecordingError.of(path, message)


def _unpacking(file: BinaryIO) -> Iterator[int]:
    """Number of bytes from each step of unpacking the variables of a version 5 file."""
    head = file.read(128)
    order = ">" if head[126:] == b"MI" else "<"
    while head[:6] == b"MATLAB" and len(tag := file.read(8)) == 8:
        kind, size = struct.unpack(f"{order}2I", tag)
        end = file.tell() + size
        unpack = zlib.decompressobj()
        while kind == _COMPRESSED and not unpack.eof and file.tell() < end:
            packed = file.read(min(_BLOCK, end - file.tell()))
            if not packed:
                return
            while packed and not unpack.eof:
                yield len(unpack.decompress(packed, _BLOCK))
                packed = unpack.unconsumed_tail
        file.seek(end)


def _sort_out(
    name: str,
    value: Any,
    tables: list[Table],
    arrays: list[NamedArray],
    objects: list[str],
    deep: int = 0,
) -> None:
    """Add a variable to the tables, the arrays or the names of objects, recursively."""
    if deep > DEEPEST:
        return
    if _is_opaque(value):
        objects.append(name)
        return
    parts = {}
    if (fields := _fields(value)) is not None:
        if own := [*_dspace(name, fields)] or [*_with_time(name, fields)]:
            tables += own
            return
        parts = {f".{field}": item for field, item in fields.items()}
    elif isinstance(value, np.ndarray) and value.dtype == object:
        parts = {f"({k})": item for k, item in enumerate(value.ravel(), start=1)}
    for part, item in parts.items():
        _sort_out(f"{name}{part}", item, tables, arrays, objects, deep + 1)
    if fields is not None or parts:
        return
    if (series := named(name, np.asarray(value))) is not None:
        arrays.append(series)


def _fields(value: Any) -> Mapping[str, Any] | None:
    """The fields of a structure; None for anything else."""
    names = getattr(value, "_fieldnames", None)
    return None if names is None else {name: getattr(value, name) for name in names}


def _structures(value: Any) -> list[Mapping[str, Any]]:
    """The fields of each structure in an array, or of a single structure."""
    listed = value.ravel() if isinstance(value, np.ndarray) else [value]
    return [fields for each in listed if (fields := _fields(each)) is not None]


def _text(value: Any) -> str:
    return value.strip() if isinstance(value, str) else ""


def _dspace(name: str, fields: Mapping[str, Any]) -> Iterator[Table]:
    """Tables of ControlDesk: times in `X`, each signal in `Y` with the index of its times."""
    clocks, signals = (
        [each for each in _structures(fields.get(key)) if "Data" in each] for key in "XY"
    )
    lengths = [np.size(each["Data"]) for each in clocks]
    groups: dict[int, list[NamedArray]] = {}
    for k, of in enumerate(signals if clocks else (), start=1):
        data = np.atleast_1d(of["Data"])
        index = of.get("XIndex")
        if not (isinstance(index, int | float) and 1 <= index <= len(clocks)):
            if lengths.count(len(data)) != 1:
                # Ambiguous if two clocks have this length; a parameter if none has.
                continue
            index = lengths.index(len(data)) + 1
        series = named(_text(of.get("Name")) or f"Y({k})", data, _text(of.get("Unit")))
        if series is not None and series.length == lengths[int(index) - 1]:
            groups.setdefault(int(index), []).append(series)
    for index, series_list in sorted(groups.items()):
        times = named("time", np.atleast_1d(clocks[index - 1]["Data"]), "s")
        if times is not None:
            part = name if len(groups) == 1 else f"{name}.X({index})"
            yield table_of([times, *series_list], part)


def _with_time(name: str, fields: Mapping[str, Any]) -> Iterator[Table]:
    """Table of Simulink's structure with time: `time`, and `signals` of values and labels."""
    times = named("time", np.atleast_1d(np.asarray(fields.get("time", ()))), "s")
    signals = enumerate(_structures(fields.get("signals")), start=1)
    series = [
        named(_text(of.get("label")) or f"signals({k})", np.asarray(of.get("values", ())))
        for k, of in signals
    ]
    matching = [one for one in series if one is not None and times and one.length == times.length]
    if times is not None and matching:
        yield table_of([times, *matching], name)


def _is_opaque(value: Any) -> bool:
    names = getattr(getattr(value, "dtype", None), "names", None) or ()
    return type(value).__name__ == "MatlabOpaque" or "MCOS" in names or "_TypeSystem" in names


def _recognises(head: bytes) -> bool:
    versions = (b"\x00\x01IM", b"\x01\x00MI")  # as little and as big machines write 0x0100
    return (head[:6] == b"MATLAB" and head[124:128] in versions) or _version_4(head)


def _version_4(head: bytes) -> bool:
    """A header of five numbers: type below 5000, size, whether complex, length of the name."""
    if len(head) < 21:
        return False
    for order in "<>":
        kind, rows, columns, imaginary, length = np.frombuffer(head[:20], f"{order}i4")
        sizes = 0 <= rows < 1 << 30 and 0 <= columns < 1 << 30 and 1 < length <= 64
        if 0 <= kind < 5000 and sizes and imaginary in (0, 1):
            return head[20 : 20 + length - 1].decode("ascii", "replace").isidentifier()
    return False


FORMAT = RecordingFormat(
    "mat",
    "MAT file of version 4 to 7.2",
    (".mat",),
    _recognises,
    partial(tables_streamed, __name__),
)
