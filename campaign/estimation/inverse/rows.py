"""Rows of a regression: columns and force, with the same filter and decimation."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence
from itertools import pairwise
from typing import Any, TypeVar, cast
from weakref import WeakKeyDictionary

import numpy as np

from campaign.arrays import Array
from campaign.estimation.inverse.motion import (
    FilterSettings,
    Motion,
    decimated,
    kept_times,
    late_rows,
)
from campaign.estimation.inverse.regression import Piece
from campaign.estimation.inverse.terms import TERMS, Term, Terms, columns

T = TypeVar("T")

END_ROWS, END_PERIODS = 5, 3.0
"""Rows, or periods of the low-pass, omitted at each end; at most a tenth of the rows."""


def rows(motion: Motion, terms: Terms, filtering: FilterSettings, delay: float = 0.0) -> Piece:
    """Columns (n, k) and force (n,) of a motion, the force `delay` (s) later than recorded.

    Rows at standstill are zero, so that the other rows keep their places in time.
    """
    piece = all_rows(motion, terms, filtering, delay)
    if filtering.slowest == 0.0:
        return piece
    moves = moving(motion, filtering)
    return Piece(piece.columns * moves[:, None], piece.force * moves, piece.time)


def all_rows(motion: Motion, terms: Terms, filtering: FilterSettings, delay: float = 0.0) -> Piece:
    """As `rows`, with the rows at standstill."""
    made = [_column(motion, term, filtering) for term in terms]
    force = late_force(motion, filtering)(delay)
    return Piece(np.column_stack(made), force, kept_times(motion, filtering))


_MADE: WeakKeyDictionary[Motion, dict[Hashable, Any]] = WeakKeyDictionary()
"""Cache of filtered columns by motion: dozens of structures use them, and filtering is slow."""


def _once(motion: Motion, key: Hashable, make: Callable[[], T]) -> T:
    kept = _MADE.setdefault(motion, {})
    if key not in kept:
        kept[key] = make()
    return cast("T", kept[key])


def _column(motion: Motion, term: Term, filtering: FilterSettings) -> Array:
    def make() -> Array:
        whole = columns(motion, [term])[filtering.skip :]
        return decimated(whole, filtering.decimation)[:, 0]

    return _once(motion, (term, filtering.decimation, filtering.skip), make)


def late_force(motion: Motion, filtering: FilterSettings) -> Callable[[float], Array]:
    """Rows of the force as a function of its delay (s)."""
    return _once(
        motion,
        (filtering.decimation, filtering.skip),
        lambda: late_rows(motion.force, motion.sample_rate, filtering),
    )


def moving(motion: Motion, filtering: FilterSettings) -> Array:
    """Mask of the rows in which the axis moves, 1 or 0, shape (n,).

    It is 0 at both ends, where differentiated noise is large.
    """
    rate = _column(motion, TERMS["viscous"], filtering)
    slow = np.abs(rate) < filtering.slowest
    beside = slow.copy()
    beside[1:] |= slow[:-1]
    beside[:-1] |= slow[1:]
    if filtering.slowest > 0.0:
        per_second = motion.sample_rate / filtering.decimation
        edge = max(END_ROWS, math.ceil(END_PERIODS * per_second / filtering.low_pass))
        edge = min(edge, len(beside) // 10)
        beside[:edge] = True
        beside[len(beside) - edge :] = True
    return np.asarray(~beside, dtype=float)


def in_blocks(pieces: Sequence[Piece], count: int) -> list[list[slice]]:
    """About `count` blocks of consecutive rows in total, of similar length, for each piece."""
    total = sum(len(piece.force) for piece in pieces)
    parts = []
    for piece in pieces:
        own = max(1, round(count * len(piece.force) / total))
        edges = np.linspace(0, len(piece.force), own + 1).astype(int)
        parts.append([slice(int(a), int(b)) for a, b in pairwise(edges)])
    return parts


def part(piece: Piece, which: slice) -> Piece:
    """Some rows of a piece."""
    return Piece(piece.columns[which], piece.force[which], piece.time[which])
