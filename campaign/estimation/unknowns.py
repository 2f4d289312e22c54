"""Bounded unknowns, and the unit cube of a fit.

A point of the cube has one share for each unknown: 0 at its lower bound, 1 at its upper bound. So
all unknowns have the same scale, and steps, bounds and intervals are comparable.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from campaign.arrays import Array


@dataclass(frozen=True)
class Unknown:
    """A number to be fitted.

    Attributes:
        lower, upper: bounds, SI; a logarithmic unknown has a positive lower bound.
        start: start value of the first fit, within the bounds.
        logarithmic: whether the share is linear in the logarithm of the value.
    """

    name: str
    lower: float
    upper: float
    start: float
    logarithmic: bool = False

    def __post_init__(self) -> None:
        if not -math.inf < self.lower < self.upper < math.inf:
            raise ValueError(f"{self.name}: bounds are finite, and the upper one is greater")
        if self.logarithmic and self.lower <= 0:
            raise ValueError(f"{self.name}: a logarithmic scale needs a lower bound above zero")
        if not self.lower <= self.start <= self.upper:
            raise ValueError(f"{self.name}: {self.start:g} is not between its bounds")

    def value(self, share: float) -> float:
        """SI value at a share of the range; shares outside of 0 to 1 are allowed."""
        if self.logarithmic:
            return self.lower * math.exp(share * math.log(self.upper / self.lower))
        return self.lower + share * (self.upper - self.lower)

    def share(self, value: float) -> float:
        """Inverse of `value`."""
        if self.logarithmic:
            return math.log(value / self.lower) / math.log(self.upper / self.lower)
        return (value - self.lower) / (self.upper - self.lower)

    def slope(self, share: float) -> float:
        """Derivative of `value` by the share."""
        if self.logarithmic:
            return self.value(share) * math.log(self.upper / self.lower)
        return self.upper - self.lower


def values_at(unknowns: Sequence[Unknown], shares: Array) -> tuple[float, ...]:
    """SI values at a point of the cube, shape (k,)."""
    return tuple(u.value(float(s)) for u, s in zip(unknowns, shares, strict=True))


def shares_of(unknowns: Sequence[Unknown], values: Sequence[float]) -> Array:
    """Inverse of `values_at`."""
    return np.array([u.share(v) for u, v in zip(unknowns, values, strict=True)])
