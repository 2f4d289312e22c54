"""Crossings of a level by a noisy measured curve."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from campaign.arrays import Array

FALSE_ALARM = 0.01
"""Chance that noise decides the side of any point of a curve that lies on the level."""


@dataclass(frozen=True)
class LevelCrossing:
    """A level was passed between the points `before` and `after` (indices).

    Both lie off it by more than their errors; what is between them may lie on either side.
    """

    before: int
    after: int
    falling: bool


def sides(above: Array, error: Array) -> Array:
    """On which side of zero each point surely lies: 1, -1, or 0 where noise leaves it open.

    Args:
        above: distance of each point from the level, shape (n,).
        error: its standard deviation, shape (n,).
    """
    from scipy.special import ndtri

    surely = float(ndtri(1.0 - 0.5 * FALSE_ALARM / max(len(above), 1)))
    return np.asarray(np.where(np.abs(above) > surely * error, np.sign(above), 0.0))


def passings(above: Array, error: Array) -> list[LevelCrossing]:
    """Every time a curve passes zero; arguments as for `sides`.

    Noise cannot make one: it takes points on both sides that are off by more than their errors.
    """
    side = sides(above, error)
    decided = np.flatnonzero(side)
    return [
        LevelCrossing(int(before), int(after), bool(side[before] > 0))
        for before, after in itertools.pairwise(decided)
        if side[before] != side[after]
    ]
