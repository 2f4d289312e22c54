"""Published values as columns beside findings of a table.

A column has a quantity, and a row has the conditions of its number. A published cell of the same
quantity and conditions is added to the row, in a column of its own. This column is the last of the
CSV file; on the page it stands before the number to compare.
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
from campaign.text import capitalized

NUMBERS = ("equal", "near")
"""Relations of cells that are numbers and not claims."""


def with_published(
    table: Table, published: Sequence[PublishedTable], known: Mapping[str, Value]
) -> Table:
    """Add a last column of published values; the same table if no row has any.

    Args:
        published: tables that its test reproduces. The first matching cell of a row counts.
        known: default conditions of every row that does not state them.
    """
    column = next((each for each in table.columns if each.quantity), None)
    if column is None:
        return table
    cells = [
        cell_of(column.quantity, {n: bare(v) for n, v in row.items()}, published, known)
        for row in table.rows
    ]
    matches = [cell for cell in cells if cell is not None]
    if not matches:
        return table
    decimals = max(cell.decimals or 0 for cell in matches)
    added = Column(
        PUBLISHED, "Published", column.unit, column.display, exact=True, decimals=decimals
    )
    rows = (
        {**row, PUBLISHED: None if cell is None else cell.in_unit(column.unit)}
        for row, cell in zip(table.rows, cells, strict=True)
    )
    return replace(
        table,
        columns=(*table.columns, added),
        rows=tuple(rows),
        note=" ".join(filter(None, (table.note, *_sources(matches)))),
    )


def as_compared(table: Table) -> Table:
    """Move the published column before the column to compare, for the page."""
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
    """First published number of a quantity under these conditions; None without any."""
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


def _sources(cells: Sequence[PublishedCell]) -> Iterator[str]:
    """Sentences on the tables of these cells, and on cells with a mark of the document."""
    headings = dict.fromkeys(heading_of(cell.table) for cell in cells)
    yield f"Published: {', '.join(headings)}."
    doubtful: dict[str, list[str]] = {}
    for cell in cells:
        if cell.status:
            doubtful.setdefault(cell.status, []).append(cell_name(cell))
    for status, names in doubtful.items():
        yield f"{capitalized(status)} among them: {', '.join(dict.fromkeys(names))}."
