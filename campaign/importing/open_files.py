"""Opened files of one recording: columns by name, and their values.

Parts of a recording are read many times, and text is slow to read. Thus the columns of a table are
read once and kept: in memory if small, else on disk.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from tempfile import SpooledTemporaryFile

import numpy as np

from campaign.errors import Problem
from campaign.importing.description import Cells, ClockUsed
from campaign.importing.formats import open_recordings
from campaign.importing.interface import Array, Column, RecordingError, Table
from campaign.importing.mapping import ColumnPlace
from campaign.text import nearest

NAMED = 12
"""Maximum number of columns in a message."""
IN_MEMORY = 1 << 24
"""Bytes of a column in memory; a longer one is in a temporary file."""
_BYTES = 8  # of a float64


class OpenedFiles:
    """The tables of some files, as a context manager.

    The constructor raises RecordingError with all problems of the files.
    """

    def __init__(self, paths: Sequence[Path]) -> None:
        self.paths = tuple(paths)
        tables: list[Sequence[Table]] = []
        problems: list[Problem] = []
        for path in paths:
            try:
                tables.append(open_recordings(path)[1])
            except RecordingError as error:
                problems += error.problems
        if problems:
            raise RecordingError(problems)
        self.tables = tuple(tables)
        self._closing = ExitStack()
        self._wanted: dict[tuple[int, int], dict[int, SpooledTemporaryFile[bytes]]] = {}
        self._rows: dict[tuple[int, int], int] = {}

    def __enter__(self) -> OpenedFiles:
        return self

    def __exit__(self, *exception: object) -> None:
        self._closing.close()

    def table(self, file: int, table: int) -> Table:
        return self.tables[file][table]

    def find(self, wanted: ColumnPlace, table: str = "") -> Cells:
        """Find a column and register it for reading. Raises ValueError with the existing names.

        Args:
            table: the table to search if `wanted` names none.
        """
        table = wanted.table or table
        columns = [
            Cells(file=file, table=number, column=place, name=column.name)
            for file, tables in enumerate(self.tables)
            for number, each in enumerate(tables)
            for place, column in enumerate(each.columns)
            if table in ("", each.name) and wanted.file in (None, file + 1)
        ]
        if not columns:
            names = dict.fromkeys(t.name for tables in self.tables for t in tables if t.name)
            raise ValueError(
                f"there is no table {table!r}; there are {', '.join(map(repr, names))}"
                if table and names
                else "there is no such table"
            )
        if isinstance(wanted.column, int):
            hits = [each for each in columns if each.column == wanted.column - 1]
        else:
            hits = [each for each in columns if each.name == wanted.column]
            written = _plain(wanted.column or "")
            hits = hits or [each for each in columns if written in _spellings(self.column(each))]
        if len(hits) > 1:
            where = "; ".join(self._told(each) for each in hits[:NAMED])
            raise ValueError(
                f"there are {len(hits)} columns {wanted.column!r}: {where}; say which by 'table', "
                "'file' or its place"
            )
        if not hits:
            raise ValueError(_no_such(wanted.column, [each.name for each in columns]))
        if not self.column(hits[0]).numeric:
            raise ValueError(f"column {hits[0].name!r} holds text and no numbers")
        self.want(hits[0])
        return hits[0]

    def column(self, cells: Cells) -> Column:
        return self.table(*cells.rows_of).columns[cells.column]

    def want(self, cells: Cells) -> None:
        """Register a column for reading, before the first column of its table is read."""
        wanted = self._wanted.setdefault(cells.rows_of, {})
        if cells.column not in wanted:
            file = self._closing.enter_context(SpooledTemporaryFile(IN_MEMORY))  # noqa: SIM115
            wanted[cells.column] = file

    def part(self, cells: Cells, first: int, stop: int) -> Array:
        """Rows [first, stop) of a column. Raises RecordingError if it cannot be read."""
        self.rows(*cells.rows_of)
        file = self._wanted[cells.rows_of][cells.column]
        file.seek(first * _BYTES)
        return np.frombuffer(file.read((stop - first) * _BYTES), dtype=np.float64)

    def times(self, clock: ClockUsed, first: int, stop: int) -> Array:
        """Times (s) of rows [first, stop) by a clock, shape (stop - first,)."""
        if clock.cells is not None:
            return clock.factor * self.part(clock.cells, first, stop)
        return clock.start + (clock.step or 1.0) * np.arange(first, stop, dtype=np.float64)

    def rows(self, file: int, table: int) -> int:
        """Number of rows of a table; the first call reads its registered columns."""
        key = file, table
        if key not in self._rows:
            files, rows = self._wanted.get(key, {}), 0
            for block in self.table(*key).read(list(files) or [0]):
                rows += len(block)
                for kept, column in zip(files.values(), block.T, strict=False):
                    kept.write(np.ascontiguousarray(column, dtype=np.float64).tobytes())
            self._rows[key] = rows
        return self._rows[key]

    def _told(self, each: Cells) -> str:
        table = self.table(*each.rows_of).name
        in_table = f" of table {table!r}" if table else ""
        of = f" in {self.paths[each.file].name}" if len(self.paths) > 1 else ""
        return f"place {each.column + 1}{in_table}{of}"


def _no_such(wanted: str | int | None, columns: Sequence[str]) -> str:
    names = list(dict.fromkeys(columns))
    listed = ", ".join(map(repr, names[:NAMED]))
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    what = f"column {wanted!r}" if isinstance(wanted, str) else f"column of place {wanted}"
    return f"there is no {what}; there are {listed}{more}{nearest(wanted, names)}"


def _spellings(column: Column) -> set[str]:
    """Spellings of a heading in the file, before it is split into name and unit."""
    ways = (" [{}]", " ({})", "/{}", " / {}", "_{}") if column.unit else ()
    return {_plain(column.name + how.format(column.unit)) for how in ("", *ways)}


def _plain(name: str) -> str:
    return " ".join(name.split()).casefold()
