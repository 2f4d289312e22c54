"""Published values as columns beside findings of a table.

A column says of which quantity its numbers are, and a row holds the conditions of each. A published
cell of that quantity whose conditions the row meets stands beside it: a column of its own, the last
of the CSV file, and on the page before the number that it is to be compared with.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from campaign.published.evidence import concerns
from campaign.published.values import Cell as PublishedCell
from campaign.published.values import PublishedTable, heading_of
from campaign.report.content.lines import cell_name
from campaign.report.content.tables import PUBLISHED
from campaign.result import Column, Finding, Table, Value, bare
from campaign.units import convert

NUMBERS = ("equal", "near")
"""Relations of cells that are numbers, not claims about one."""


def with_published(
    table: Table, published: Sequence[PublishedTable], known: Mapping[str, Value]
) -> Table:
    """With a last column of what is printed of each row; as it is where nothing is.

    Args:
        published: what its test reproduces. Of several cells that speak to a row the first counts.
        known: conditions that hold for every row which does not state them itself.
    """
    column = next((each for each in table.columns if each.quantity), None)
    if column is None:
        return table
    cells = [
        cell_of(column.quantity, {n: bare(v) for n, v in row.items()}, published, known)
        for row in table.rows
    ]
    found = [cell for cell in cells if cell is not None]
    if not found:
        return table
    decimals = max(cell.decimals or 0 for cell in found)
    added = Column(
        PUBLISHED, "Published", column.unit, column.display, exact=True, decimals=decimals
    )
    rows = (
        {**row, PUBLISHED: None if cell is None else value_in(cell, column.unit)}
        for row, cell in zip(table.rows, cells, strict=True)
    )
    return replace(
        table,
        columns=(*table.columns, added),
        rows=tuple(rows),
        note=" ".join(filter(None, (table.note, *_sources(found)))),
    )


def as_compared(table: Table) -> Table:
    """As the page has it: what is published before what it is compared with."""
    published = [each for each in table.columns if each.name == PUBLISHED]
    others = [each for each in table.columns if each.name != PUBLISHED]
    place = next((n for n, each in enumerate(others) if each.quantity), None)
    if place is None:
        return table
    return replace(table, columns=(*others[:place], *published, *others[place:]))


def cell_of(
    quantity: str,
    conditions: Mapping[str, Value],
    published: Iterable[PublishedTable],
    known: Mapping[str, Value],
) -> PublishedCell | None:
    """The first published number of a quantity under these conditions; None without any."""
    finding = Finding(quantity, math.nan, "", conditions)
    return next(
        (
            cell
            for table in published
            for cell in table.cells
            if cell.relation in NUMBERS and concerns(finding, cell, known)
        ),
        None,
    )


def value_in(cell: PublishedCell, unit: str) -> float | None:
    """A published number in another unit; None where that is one of something else."""
    try:
        return float(convert(cell.value, cell.unit, unit))
    except ValueError:
        return None


def _sources(cells: Sequence[PublishedCell]) -> Iterator[str]:
    """Sentences: where these are printed, and which of them the document itself puts in doubt."""
    headings = dict.fromkeys(heading_of(cell.table) for cell in cells)
    yield f"Published: {', '.join(headings)}."
    doubtful: dict[str, list[str]] = {}
    for cell in cells:
        if cell.status:
            doubtful.setdefault(cell.status, []).append(cell_name(cell))
    for status, names in doubtful.items():
        told = f"{status[:1].upper()}{status[1:]} among them"
        yield f"{told}: {', '.join(dict.fromkeys(names))}."
