"""Files of one recording, opened: which column is meant by a name, and its values."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from campaign.errors import Problem
from campaign.importing.described import Cells
from campaign.importing.interface import Array, Column, RecordingError, Table
from campaign.importing.opening import open_recordings
from campaign.importing.spool import Spool

NAMED = 12
"""columns that a message lists."""


class AmbiguousError(ValueError):
    """A column that is not there, or of which there are several."""


class Wanted(Protocol):
    """What tells a column: see `mapping.ColumnPlace`."""

    @property
    def column(self) -> str | int | None: ...

    @property
    def table(self) -> str: ...

    @property
    def file(self) -> int | None: ...


@dataclass(frozen=True)
class _Candidate:
    file: int
    table: int
    place: int
    column: Column


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
        self._wanted: dict[tuple[int, int], dict[int, None]] = {}

    def __enter__(self) -> OpenedFiles:
        return self

    def __exit__(self, *exception: object) -> None:
        for spool in self._spools.values():
            spool.close()

    def table(self, file: int, table: int) -> Table:
        return self.tables[file][table]

    def find(self, wanted: Wanted, table: str = "") -> Cells:
        """The column that is meant. Raises AmbiguousError with the names there are.

        Args:
            table: the one to look in where `wanted` names none.
        """
        table = wanted.table or table
        among = [
            each
            for each in self._candidates()
            if (not table or self.table(each.file, each.table).name == table)
            and (wanted.file is None or each.file == wanted.file - 1)
        ]
        if not among:
            names = dict.fromkeys(t.name for tables in self.tables for t in tables if t.name)
            raise AmbiguousError(
                f"there is no table {table!r}; there are {', '.join(map(repr, names))}"
                if table and names
                else "there is no such table"
            )
        if isinstance(wanted.column, int):
            found = [each for each in among if each.place == wanted.column - 1]
        else:
            found = [each for each in among if each.column.name == wanted.column]
            written = _plain(wanted.column or "")
            found = found or [each for each in among if written in _spellings(each.column)]
        if len(found) == 1:
            (one,) = found
            if not one.column.numeric:
                raise AmbiguousError(f"column {one.column.name!r} holds text and no numbers")
            return Cells(file=one.file, table=one.table, column=one.place, name=one.column.name)
        if found:
            where = "; ".join(self._told(each) for each in found[:NAMED])
            raise AmbiguousError(
                f"there are {len(found)} columns {wanted.column!r}: {where}; say which by 'table', "
                "'file' or its place"
            )
        raise AmbiguousError(self._no_such(wanted.column, among))

    def column(self, cells: Cells) -> Column:
        return self.table(cells.file, cells.table).columns[cells.column]

    def want(self, cells: Cells) -> None:
        """This column will be read; said before the first of its table is."""
        self._wanted.setdefault((cells.file, cells.table), {})[cells.column] = None

    def part(self, cells: Cells, first: int, stop: int) -> Array:
        """Rows [first, stop) of a column. Raises RecordingError where it cannot be read."""
        return self._spool(cells.file, cells.table).part(cells.column, first, stop)

    def rows(self, file: int, table: int) -> int:
        """How many rows a table has."""
        known = self.table(file, table).rows
        return self._spool(file, table).rows if known is None else known

    def _spool(self, file: int, table: int) -> Spool:
        key = (file, table)
        if key not in self._spools:
            places = list(self._wanted.get(key, {})) or [0]
            self._spools[key] = Spool(self.table(file, table), places)
        return self._spools[key]

    def _candidates(self) -> Iterator[_Candidate]:
        for file, tables in enumerate(self.tables):
            for number, table in enumerate(tables):
                for place, column in enumerate(table.columns):
                    yield _Candidate(file, number, place, column)

    def _told(self, each: _Candidate) -> str:
        table = self.table(each.file, each.table).name
        in_table = f" of table {table!r}" if table else ""
        of = f" in {self.paths[each.file].name}" if len(self.paths) > 1 else ""
        return f"place {each.place + 1}{in_table}{of}"

    def _no_such(self, wanted: str | int | None, among: Sequence[_Candidate]) -> str:
        names = list(dict.fromkeys(each.column.name for each in among))
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
