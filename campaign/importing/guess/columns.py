"""What a guess says of a column, of a table, of files."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path

import numpy as np


class Basis(StrEnum):
    """What a unit rests on."""

    STATED = "stated"  # the file says so
    LIKELY = "likely"  # the numbers suggest it
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class ColumnGuess:
    """A column of a table, and what it may be.

    Attributes:
        role: a channel of the vocabulary, or `time`, `index`, `unknown`.
        why: what the role rests on.
        unit: as `parse_unit` has it; "" where unknown.
        doubts: what its reader should check, in sentences.
        low, high: the range of what was looked at; NaN where it holds no numbers.
        tag: what its name says besides; see `Named.tag`.
        group: which of several axes it is of; "" where it is of all of them.
        spare: it gives way to another column of its role.
        of_anything: a target whose name does not say of what.
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
    group: str = ""
    spare: bool = False
    of_anything: bool = False


@dataclass(frozen=True)
class TableGuess:
    """A table of a file.

    Attributes:
        rows: how many were looked at; `more` says that there are further ones.
        step: s between samples, by a clock that the file states, or by times whose unit is
            stated or likely; None where that cannot be told.
        clock: whether the file states the clock, without a column of times.
        restarts: how often its time begins anew.
        below: whether it is one of several below each other in a text file.
        doubts: what is wrong with it as a whole.
    """

    file: Path
    format: str
    name: str
    columns: tuple[ColumnGuess, ...]
    rows: int
    more: bool = False
    step: float | None = None
    clock: bool = False
    restarts: int = 0
    below: bool = False
    doubts: tuple[str, ...] = ()
    said: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Guess:
    """What files may be."""

    tables: tuple[TableGuess, ...]
