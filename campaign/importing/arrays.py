"""Named arrays of a file as tables: equal lengths form a table with its clock.

MAT and HDF5 files have no tables. Series that were recorded together have one length; the shorter
side of a matrix counts its columns.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from campaign.importing.interface import ROWS, Array, Column, Table

WIDEST = 64
"""Maximum number of columns of a matrix; if both sides are longer, it is an image or a map."""

OPAQUE = (
    "is an object of a MATLAB class; in MATLAB save its numbers, e.g. t = ts.Time; y = ts.Data; "
    "save('file.mat', 't', 'y')"
)


@dataclass(frozen=True)
class NamedArray:
    """An array of one or two dimensions with a name, read in parts.

    Attributes:
        shape: (n,), (n, m) or (m, n).
        part: samples [start, stop) along the longer side, shape (stop - start,) or, for either
            orientation, (stop - start, m).
        by_rows: whether each series is a row of the matrix in its program.
    """

    name: str
    shape: tuple[int, ...]
    part: Callable[[int, int], Array]
    unit: str = ""
    by_rows: bool = False

    @property
    def length(self) -> int:
        """Samples of each series."""
        return max(self.shape)

    @property
    def width(self) -> int:
        """Number of series."""
        return 1 if len(self.shape) == 1 else min(self.shape)


def named(name: str, array: np.ndarray, unit: str = "") -> NamedArray | None:
    """A named array from memory; None if it cannot be a recording over time."""
    array = np.squeeze(array)
    if array.ndim not in (1, 2) or array.dtype.kind not in "fiub" or array.size < 2:
        return None
    by_rows = array.ndim == 2 and array.shape[0] < array.shape[1]
    if by_rows:
        array = array.T
    if array.ndim == 2 and array.shape[1] > WIDEST:
        return None

    def part(start: int, stop: int) -> Array:
        return array[start:stop].astype(np.float64)

    return NamedArray(name, array.shape, part, unit, by_rows)


def tables_of(arrays: Sequence[NamedArray]) -> list[Table]:
    """A table for each length, the longest first."""
    lengths = sorted({each.length for each in arrays}, reverse=True)
    return [
        table_of(
            [each for each in arrays if each.length == length],
            "" if len(lengths) == 1 else f"{length} samples",
        )
        for length in lengths
    ]


def table_of(arrays: Sequence[NamedArray], name: str) -> Table:
    """Arrays of one length as one table."""
    columns: list[Column] = []
    where: list[tuple[NamedArray, int]] = []
    for array in arrays:
        for k in range(array.width):
            of = f"({k + 1},:)" if array.by_rows else f"(:,{k + 1})"
            place = array.name if array.width == 1 else f"{array.name}{of}"
            columns.append(Column(place, array.unit, place))
            where.append((array, k))
    length = arrays[0].length
    return Table(name, tuple(columns), partial(_read, where, length))


def _read(
    where: Sequence[tuple[NamedArray, int]], length: int, places: Sequence[int]
) -> Iterator[Array]:
    for start in range(0, length, ROWS):
        stop = min(start + ROWS, length)
        parts: dict[int, Array] = {}
        chosen = [where[place] for place in places]
        for array, _ in chosen:
            if id(array) not in parts:
                parts[id(array)] = array.part(start, stop).reshape(stop - start, -1)
        yield np.column_stack([parts[id(array)][:, k] for array, k in chosen])
