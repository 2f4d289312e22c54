"""What is wrong with a recording, as data; and what its finders share."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
MOST = 10
"""Places of one kind that are told one by one; of the others their number is."""


class Severity(StrEnum):
    """What a defect means for the recording."""

    REFUSED = "refused"  # nothing that can be worked out of it would be right
    REPAIRABLE = "repairable"  # refused as well, unless somebody asks for the repair
    NOTED = "noted"  # it is usable; a reader should know


@dataclass(frozen=True)
class Defect:
    """Something that is wrong with a recording, or that its reader should know.

    Attributes:
        kind: a word of the field: `gap`, `clipping`.
        channels: which it is about; none where it is about time.
        what: a sentence with its number.
        rows: the first and the last row, from 0.
        size: the number that tells how much: of missing samples, of a factor, s of a delay.
        severity: what it means for the recording.
        repair: which function of `repairs` is for it; "" where there is none.
    """

    kind: str
    channels: tuple[str, ...]
    what: str
    rows: tuple[int, int]
    size: float
    severity: Severity
    repair: str = ""


def runs(mask: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """First and last place of every run of true ones."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    for first, after in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        yield first, after - 1


def step_size(values: Array) -> float:
    """The step that all values are multiples of (from the lowest); 0 where there is none.

    A step is believed when values repeat: numbers that scatter freely have a smallest difference,
    too, but no second of it.
    """
    levels = np.unique(values[np.isfinite(values)])
    if len(levels) < 2:
        return 0.0
    span = float(levels[-1] - levels[0])
    noise = 1e-9 * span + 4 * float(np.spacing(np.abs(levels).max()))
    apart = np.diff(levels)
    apart = apart[apart > noise]  # levels that only arithmetic tells apart
    if not len(apart) or len(levels) > 0.9 * np.isfinite(values).sum():
        return 0.0
    step = float(apart.min())
    off = apart / step - np.round(apart / step)
    return step if np.abs(off).max() < 0.05 + noise / step else 0.0


def usual_step(values: Array) -> float:
    """The 99 % quantile of steps that are steps at all; 0 where there are none."""
    size = np.abs(np.diff(values))
    size = size[np.isfinite(size) & (size > 0)]
    return float(np.quantile(size, 0.99)) if len(size) else 0.0


def rows_in_words(first: int, last: int) -> str:
    """Rows as people count them, from 1."""
    return f"row {first + 1}" if first == last else f"rows {first + 1} to {last + 1}"


def counted(count: int, noun: str) -> str:
    """`1 sample`, `2 samples`."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"
