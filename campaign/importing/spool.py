"""Columns of tables at random access: read once, in memory while they are small, else on disk.

Whoever checks, cuts and serves a recording reads parts of it many times, and text is slow to read.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from typing import IO

import numpy as np

from campaign.importing.interface import Array, Table

IN_MEMORY = 16_000_000
"""Values of all columns together; more are kept in temporary files."""
_BYTES = 8  # of a float64


class Spool:
    """Some columns of one table. Raises RecordingError, when it is made, as the table does.

    Attributes:
        rows: how many there are.
    """

    def __init__(self, table: Table, places: Sequence[int]) -> None:
        """`places`: of the columns, from 0."""
        self._where = {place: k for k, place in enumerate(dict.fromkeys(places))}
        self._blocks: list[Array] = []
        self._files: list[IO[bytes]] = []
        self._memory: Mapping[int, Array] = {}
        self.rows = 0
        held = 0
        for block in table.read(list(self._where)):
            self.rows += len(block)
            if self._files:
                self._put_away(block)
                continue
            self._blocks.append(block)
            held += block.size
            if held > IN_MEMORY:
                self._files = [tempfile.TemporaryFile() for _ in self._where]  # noqa: SIM115 - kept
                for each in self._blocks:
                    self._put_away(each)
                self._blocks = []
        if not self._files and self._where:
            whole = np.concatenate(self._blocks) if self._blocks else np.empty((0, held))
            self._memory = {
                place: np.ascontiguousarray(whole[:, k])
                for place, k in self._where.items()
                if len(whole)
            }
            self._blocks = []

    def part(self, place: int, first: int, stop: int) -> Array:
        """Rows [first, stop) of a column, shape (stop - first,)."""
        if not self._files:
            return self._memory[place][first:stop] if self.rows else np.empty(0)
        file = self._files[self._where[place]]
        file.seek(first * _BYTES)
        return np.frombuffer(file.read((stop - first) * _BYTES), dtype=np.float64)

    def close(self) -> None:
        """Let go of what is kept on disk."""
        for file in self._files:
            file.close()

    def _put_away(self, block: Array) -> None:
        for k, file in enumerate(self._files):
            file.write(np.ascontiguousarray(block[:, k], dtype=np.float64).tobytes())
