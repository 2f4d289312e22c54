"""All of a table at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from campaign.importing.interface import Array, Table


def whole(table: Table, places: Sequence[int] | None = None) -> Array:
    """All rows of some columns, or of every numeric one: shape (n, columns)."""
    wanted = [k for k, c in enumerate(table.columns) if c.numeric] if places is None else places
    blocks = list(table.read(wanted))
    return np.concatenate(blocks) if blocks else np.empty((0, len(wanted)))
