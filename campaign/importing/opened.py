"""Files of one recording, opened: which column is meant by a name, and its values."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from campaign.errors import Problem
from campaign.importing.described import Cells
from campaign.importing.formats import open_recordings
from campaign.importing.interface import Array, Column, RecordingError, Table
from campaign.importing.mapping import ColumnPlace
from campaign.importing.spool import Spool

NAMED = 12
"""columns that a message lists."""


class OpenedFiles:
    """The tables of some files. Used as a context manager.

    Making one raises RecordingError with everything that is wrong with the files.
    """

    def __init__(self, paths: Sequence[Path]) -> None:
        self.paths = tuple(paths)
        found: list[Sequence[Table]] = []
        problems: list[Problem] = []
        for path in paths:
            try:
                found.append(open_recordings(path)[1])
            except RecordingError as error:
                problems += error.problems
        if problems:
            raise RecordingError(problems)
        self.tables = tuple(found)
        self._spools: dict[tuple[int, int], Spool] = {}
        self._closing = ExitStack()
        self._wanted: dict[tuple[int, int], dict[int, None]] = {}

    def __enter__(self) -> OpenedFiles:
        return self

    def __exit__(self, *exception: object) -> None:
        self._closing.close()

    def table(self, file: int, table: int) -> Table:
        return self.tables[file][table]

    def find(self, wanted: ColumnPlace, table: str = "") -> Cells:
        """The column that is meant. Raises ValueError with the names there are.

        Args:
            table: the one to look in where `wanted` names none.
        """
        table = wanted.table or table
        among = [
            Cells(file=file, table=number, column=place, name=column.name)
            for file, tables in enumerate(self.tables)
            for number, each in enumerate(tables)
            for place, column in enumerate(each.columns)
            if table in ("", each.name) and wanted.file in (None, file + 1)
        ]
        if not among:
            names = dict.fromkeys(t.name for tables in self.tables for t in tables if t.name)
            raise ValueError(
                f"there is no table {table!r}; there are {', '.join(map(repr, names))}"
                if table and names
                else "there is no such table"
            )
        if isinstance(wanted.column, int):
            found = [each for each in among if each.column == wanted.column - 1]
        else:
            found = [each for each in among if each.name == wanted.column]
            written = _plain(wanted.column or "")
            found = found or [each for each in among if written in _spellings(self.column(each))]
        if len(found) > 1:
            where = "; ".join(self._told(each) for each in found[:NAMED])
            raise ValueError(
                f"there are {len(found)} columns {wanted.column!r}: {where}; say which by 'table', "
                "'file' or its place"
            )
        if not found:
            raise ValueError(_no_such(wanted.column, [each.name for each in among]))
        if not self.column(found[0]).numeric:
            raise ValueError(f"column {found[0].name!r} holds text and no numbers")
        return found[0]

    def column(self, cells: Cells) -> Column:
        return self.table(*cells.rows_of).columns[cells.column]

    def want(self, cells: Cells) -> None:
        """This column will be read; said before the first of its table is."""
        self._wanted.setdefault(cells.rows_of, {})[cells.column] = None

    def part(self, cells: Cells, first: int, stop: int) -> Array:
        """Rows [first, stop) of a column. Raises RecordingError where it cannot be read."""
        return self._spool(*cells.rows_of).part(cells.column, first, stop)

    def rows(self, file: int, table: int) -> int:
        """How many rows a table has."""
        known = self.table(file, table).rows
        return self._spool(file, table).rows if known is None else known

    def _spool(self, file: int, table: int) -> Spool:
        key = (file, table)
        if key not in self._spools:
            places = self._wanted.get(key) or [0]
            self._spools[key] = Spool(self.table(file, table), places, self._closing)
        return self._spools[key]

    def _told(self, each: Cells) -> str:
        table = self.table(*each.rows_of).name
        in_table = f" of table {table!r}" if table else ""
        of = f" in {self.paths[each.file].name}" if len(self.paths) > 1 else ""
        return f"place {each.column + 1}{in_table}{of}"


def _no_such(wanted: str | int | None, columns: Sequence[str]) -> str:
    names = list(dict.fromkeys(columns))
    close = difflib.get_close_matches(str(wanted), names, 1)
    listed = ", ".join(map(repr, names[:NAMED]))
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    hint = f"; did you mean {close[0]!r}?" if close else ""
    what = f"column {wanted!r}" if isinstance(wanted, str) else f"column of place {wanted}"
    return f"there is no {what}; there are {listed}{more}{hint}"


def _spellings(column: Column) -> set[str]:
    """How a heading may stand in the file that a reader has parted into name and unit."""
    name, unit = column.name, column.unit
    headings = {name}
    if unit:
        headings |= {
            f"{name}{how.format(unit)}" for how in (" [{}]", " ({})", "/{}", " / {}", "_{}")
        }
    return {_plain(heading) for heading in headings}


def _plain(name: str) -> str:
    return " ".join(name.split()).casefold()
