"""A number that somebody will rely on, and a part of a recording: nouns that rooms share."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Estimate:
    """A number and how far it can be trusted; or why that is not known.

    Attributes:
        name: of the quantity, e.g. `coulomb_torque`.
        value: SI, in `unit`.
        low, high: bounds of its interval (SI); both None when it has none, and `reason` says why.
        level: the share of repetitions in which such an interval holds the truth, e.g. 0.95.
        method: how value and interval were found, in words.
    """

    name: str
    value: float
    unit: str
    low: float | None = None
    high: float | None = None
    level: float | None = None
    method: str = ""
    reason: str = ""

    def __post_init__(self) -> None:
        numbers = (self.value, self.low, self.high, self.level)
        if not all(number is None or math.isfinite(number) for number in numbers):
            raise ValueError(f"{self.name}: an estimate is finite, or it is not given")


@dataclass(frozen=True)
class Window:
    """A part of a trial that an analysis uses: start <= time < stop (s)."""

    name: str
    start: float
    stop: float
