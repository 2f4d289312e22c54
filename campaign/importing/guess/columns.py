"""Draft facts of columns, tables and files."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path

import numpy as np

TIME, INDEX, UNKNOWN = "time", "index", "unknown"
"""Roles that are no channels."""


class Basis(StrEnum):
    """Evidence for a unit."""

    STATED = "stated"  # by the file
    LIKELY = "likely"  # the numbers suggest it
    UNKNOWN = "not stated"


@dataclass(frozen=True)
class ColumnGuess:
    """A column of a table with its likely role and unit.

    Attributes:
        role: a channel of the vocabulary, or `time`, `index`, `unknown`.
        why: evidence for the role; "" if the name gives none.
        unit: in the spelling of `parse_unit`; "" if unknown.
        doubts: what the user should check, in sentences.
        low, high: range of the examined rows; NaN without numbers.
        tag: words and numbers of the name that indicate no role; with several axes, their names.
        axis: axis of the column; "" if common to all axes.
        sided: False if the side of the gear is unknown.
    """

    name: str
    place: str
    role: str
    why: str = ""
    unit: str = ""
    basis: Basis = Basis.UNKNOWN
    unit_why: str = ""
    doubts: tuple[str, ...] = ()
    low: float = np.nan
    high: float = np.nan
    tag: tuple[str, ...] = ()
    axis: str = ""
    sided: bool = True

    @property
    def is_channel(self) -> bool:
        """Whether the role is a channel."""
        return self.role not in (TIME, INDEX, UNKNOWN)

    def likely(self, unit: str, why: str) -> ColumnGuess:
        """A copy with a likely unit and its evidence; unchanged if `unit` is empty."""
        return replace(self, unit=unit, basis=Basis.LIKELY, unit_why=why) if unit else self


@dataclass(frozen=True)
class TableGuess:
    """A table of a file.

    Attributes:
        rows: number of examined rows.
        step: time between samples (s); None if the unit of the times is unknown.
        clock: whether the file states the clock, without a column of times.
        restarts: number of restarts of its time.
        doubts: problems of the table as a whole.
    """

    file: Path
    format: str
    name: str
    columns: tuple[ColumnGuess, ...]
    rows: int
    step: float | None
    clock: bool
    restarts: int
    doubts: tuple[str, ...]
