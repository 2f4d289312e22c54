"""Columns of tables at random access: read once, in memory while they are small, else on disk.

Whoever checks, cuts and serves a recording reads parts of it many times, and text is slow to read.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import ExitStack
from tempfile import SpooledTemporaryFile

import numpy as np

from campaign.importing.interface import Array, Table

IN_MEMORY = 1 << 24
"""Bytes of a column; a longer one goes to a temporary file."""
_BYTES = 8  # of a float64


class Spool:
    """Some columns of one table. Raises RecordingError, when it is made, as the table does.

    Attributes:
        rows: how many there are.
    """

    def __init__(self, table: Table, places: Iterable[int], closing: ExitStack) -> None:
        """`places`: of the columns, from 0; what is kept is let go of with `closing`."""
        self._files = {
            place: closing.enter_context(SpooledTemporaryFile(IN_MEMORY))  # noqa: SIM115
            for place in places
        }
        self.rows = 0
        for block in table.read(list(self._files)):
            self.rows += len(block)
            for file, column in zip(self._files.values(), block.T, strict=True):
                file.write(np.ascontiguousarray(column, dtype=np.float64).tobytes())

    def part(self, place: int, first: int, stop: int) -> Array:
        """Rows [first, stop) of a column, shape (stop - first,)."""
        file = self._files[place]
        file.seek(first * _BYTES)
        return np.frombuffer(file.read((stop - first) * _BYTES), dtype=np.float64)
