"""Tables of a file, and all of a table at once."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from campaign.importing.formats import open_recordings
from campaign.importing.interface import Array, Table


def opened(path: Path, format_name: str) -> list[Table]:
    """The tables of a file, which is found to be of this format."""
    found, tables = open_recordings(path)
    assert found.name == format_name
    return list(tables)


def headings(table: Table) -> list[tuple[str, str]]:
    """Name and unit of each column."""
    return [(column.name, column.unit) for column in table.columns]


def whole(table: Table, places: Sequence[int] | None = None) -> Array:
    """All rows of some columns, or of every numeric one: shape (n, columns)."""
    wanted = [k for k, c in enumerate(table.columns) if c.numeric] if places is None else places
    blocks = list(table.read(wanted))
    return np.concatenate(blocks) if blocks else np.empty((0, len(wanted)))
