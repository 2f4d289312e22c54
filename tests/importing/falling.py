"""A reader that does what its file says: for tests of what becomes of those that fall."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from campaign.errors import Problem
from campaign.importing.interface import Array, Clock, Column, RecordingError, Table


def tables(path: Path) -> list[Table]:
    told = path.read_text()
    if told == "falls":
        os.abort()
    if told == "hangs":
        time.sleep(600)
    if told == "refuses":
        raise RecordingError([Problem(path, 0, 0, "no such luck")])

    def read(places: Sequence[int]) -> Iterator[Array]:
        for first in range(0, 30, 10):
            if told == "falls later" and first == 20:
                os.abort()
            if told == "refuses later" and first == 20:
                raise RecordingError([Problem(path, 0, 0, "no such luck")])
            yield np.arange(first, first + 10.0)[:, None] + 100.0 * np.array(places)

    columns = (Column("a", "N m", "1"), Column("b", "", "2"))
    return [Table("one", columns, read, Clock(0.1), ("odd",))]
