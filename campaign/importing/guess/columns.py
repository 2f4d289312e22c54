"""Draft facts of columns, tables and files."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path

import numpy as np

TIME, INDEX, UNKNOWN = "time", "index", "unknown"
"""Roles that are no channels."""


class Basis(StrEnum):
    """What a unit rests on."""

    STATED = "stated"  # the file says so
    LIKELY = "likely"  # the numbers suggest it
    UNKNOWN = "not stated"


@dataclass(frozen=True)
class ColumnGuess:
    """A column of a table, and what it may be.

    Attributes:
        role: a channel of the vocabulary, or `time`, `index`, `unknown`.
        why: what the role rests on; "" where the name says nothing.
        unit: as `parse_unit` has it; "" where unknown.
        doubts: what its reader should check, in sentences.
        low, high: the range of what was looked at; NaN where it holds no numbers.
        tag: words and numbers of its name that say no role; of several axes they are the name.
        axis: which of several it is of; "" where it is of all of them.
        sided: False where nothing says which side of the gear it is of.
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
        """Whether it was taken for one."""
        return self.role not in (TIME, INDEX, UNKNOWN)

    def likely(self, unit: str, why: str) -> ColumnGuess:
        """With a unit that numbers suggest, and why; as it was where they suggest none."""
        return replace(self, unit=unit, basis=Basis.LIKELY, unit_why=why) if unit else self


@dataclass(frozen=True)
class TableGuess:
    """A table of a file.

    Attributes:
        rows: how many were looked at.
        step: s between samples, as far as the unit of times is known; None where it is not.
        clock: whether the file states the clock, without a column of times.
        restarts: how often its time begins anew.
        doubts: what is wrong with it as a whole.
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
