"""Crossings of a level by a noisy measured curve."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from campaign.arrays import Array

FALSE_ALARM = 0.01
"""Probability of one or more false decisions for a noisy curve that lies on the level."""


@dataclass(frozen=True)
class LevelCrossing:
    """Crossing of a level between the points `before` and `after` (indices).

    Both differ from the level by more than their errors; points between them may not.
    """

    before: int
    after: int
    falling: bool


def sides(above: Array, error: Array) -> Array:
    """Side of the level on which each point significantly lies: 1 or -1; 0 if not significant.

    Args:
        above: distance of each point from the level, shape (n,).
        error: its standard deviation, shape (n,).
    """
    from scipy.special import ndtri

    surely = float(ndtri(1.0 - 0.5 * FALSE_ALARM / max(len(above), 1)))
    return np.asarray(np.where(np.abs(above) > surely * error, np.sign(above), 0.0))


def passings(above: Array, error: Array) -> list[LevelCrossing]:
    """Significant crossings of a level by a curve; arguments as for `sides`."""
    side = sides(above, error)
    decided = np.flatnonzero(side)
    return [
        LevelCrossing(int(before), int(after), bool(side[before] > 0))
        for before, after in itertools.pairwise(decided)
        if side[before] != side[after]
    ]
