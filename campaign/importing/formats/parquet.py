"""Parquet: columns by name, read in batches; needs pyarrow (`pip install 'campaign[parquet]'`)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from campaign.importing.interface import (
    ROWS,
    Array,
    Column,
    RecordingError,
    RecordingFormat,
    Table,
    read_by,
)

if TYPE_CHECKING:
    import pyarrow as pa

MAGIC = b"PAR1"
_reading = partial(read_by, "pyarrow", what="Parquet file", extra="parquet")


def _tables(path: Path) -> Sequence[Table]:
    with _reading(path):
        from pyarrow import parquet

        with parquet.ParquetFile(path) as file:
            schema = file.schema_arrow
    columns = tuple(
        Column(each.name, _unit(each), f"column {place}", _is_numeric(each))
        for place, each in enumerate(schema, start=1)
    )
    if not any(column.numeric for column in columns):
        raise RecordingError.of(path, "no column of it holds numbers")
    return [Table("", columns, partial(_read, path))]


def _read(path: Path, places: Sequence[int]) -> Iterator[Array]:
    with _reading(path):
        import pyarrow as pa
        from pyarrow import parquet

        with parquet.ParquetFile(path) as file:
            # By place: two columns may have one name.
            for batch in file.iter_batches(ROWS, use_threads=False):
                columns = (batch.column(place).cast(pa.float64(), safe=False) for place in places)
                yield np.column_stack([each.to_numpy(zero_copy_only=False) for each in columns])


def _is_numeric(field: pa.Field) -> bool:
    from pyarrow import types

    kinds = (types.is_floating, types.is_integer, types.is_boolean)
    return any(is_kind(field.type) for is_kind in kinds)


def _unit(field: pa.Field) -> str:
    metadata: dict[bytes, bytes] = field.metadata or {}
    return (metadata.get(b"units") or metadata.get(b"unit", b"")).decode("utf-8", "replace")


FORMAT = RecordingFormat(
    "parquet",
    "Parquet, by pyarrow",
    (".parquet", ".pq"),
    lambda head: head.startswith(MAGIC),
    _tables,
)
