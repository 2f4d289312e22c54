"""The published cells that a bench is fitted to, and the weight of each deviation."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from campaign.arrays import Array
from campaign.published.patterns import covers
from campaign.published.values import NO_SIZE, Cell, Published
from campaign.published.verdicts import CLAIMS
from campaign.units import convert, split_quantity

WORST = 100.0
"""Largest deviation of a cell, and that of a missing value. It is this factor; for an absolute
weight, this many times the larger of the cell and its standard deviation. No value may be worse
than a missing one. The deviation is large so that a fit has a slope from any start."""
DEFAULT_WEIGHT = "10 %"


@dataclass(frozen=True)
class Target:
    """One cell with its standard deviation.

    Attributes:
        relative: whether `sigma` is relative to the cell; else it is in the printed unit.
    """

    cell: Cell
    sigma: float
    relative: bool

    def residual(self, found: float | None) -> float:
        """Deviation of `found` (printed unit) in standard deviations, from -`worst` to `worst`.

        A relative one is the logarithm of the ratio: 2 and 1/2 count the same. A cell with
        `at most` or `at least` has residual 0 on the claimed side.
        """
        if found is None or not math.isfinite(found):
            return self.worst
        if not self.relative:
            deviation = (found - self.cell.value) / self.sigma
        elif found / self.cell.value > 0:
            deviation = math.log(found / self.cell.value) / self.sigma
        else:
            return self.worst
        if self.cell.relation == "at most":
            deviation = max(0.0, deviation)
        elif self.cell.relation == "at least":
            deviation = min(0.0, deviation)
        return min(max(deviation, -self.worst), self.worst)

    def percent(self, found: float | None) -> float:
        """Deviation in percent of the cell, as on the scoreboard.

        NaN for a missing value, a printed zero, a rank or mark, and a claim that is met.
        """
        claim = self.cell.relation in CLAIMS and self.residual(found) == 0.0
        if found is None or not self.cell.value or claim or self.cell.relation in NO_SIZE:
            return math.nan
        return 100 * (found / self.cell.value - 1)

    @property
    def worst(self) -> float:
        """Residual of a cell with a missing value."""
        if self.relative:
            return math.log(WORST) / self.sigma
        return WORST * max(1.0, abs(self.cell.value) / self.sigma)

    @property
    def weight(self) -> str:
        """Text of the standard deviation."""
        if self.relative:
            return f"{100 * self.sigma:.6g} %"
        return f"{self.sigma:.6g} {self.cell.unit}".strip()


def residuals(targets: Sequence[Target], found: Mapping[str, float]) -> Array:
    """Residual of each target, shape (n,)."""
    return np.array([target.residual(found.get(target.cell.path)) for target in targets])


def restricted(published: Published, targets: Sequence[Target]) -> Published:
    """Published tables with the targets as the only cells, for the fit."""
    wanted = {target.cell.path for target in targets}
    tables = {}
    for name, table in published.items():
        cells = tuple(cell for cell in table.cells if cell.path in wanted)
        if cells:
            tables[name] = replace(table, cells=cells)
    return tables


def weight_of(cell: Cell, weights: Mapping[str, str | float]) -> str | None:
    """Most specific name in `weights` that matches the cell; None without a match."""
    matching = [name for name in weights if covers(name, cell.path)]
    return max(matching, key=_closeness, default=None)


def make_target(cell: Cell, weight: str | float) -> Target:
    """Target from a cell and a weight as written. Raises ValueError with a message for the user."""
    number, unit = split_quantity(weight) if isinstance(weight, str) else (float(weight), "")
    if not (math.isfinite(number) and number > 0):
        raise ValueError(f"{weight!r} is no standard deviation; it must be positive")
    if unit == "%":
        if cell.value == 0:
            raise ValueError(f"{cell.path} is 0, so its weight cannot be relative")
        return Target(cell, number / 100, relative=True)
    try:
        sigma = float(convert(number, unit, cell.unit))
    except ValueError:
        wanted = f"in {cell.unit}" if cell.unit else "a bare number"
        raise ValueError(
            f"{weight!r} is no standard deviation of {cell.path}; write it {wanted} or in %"
        ) from None
    return Target(cell, sigma, relative=False)


def shortest(targets: Sequence[Target], published: Published) -> tuple[str, ...]:
    """Names of the cells for a bench's `fitted`: a complete table or row has one name."""
    wanted = {target.cell.path for target in targets}
    names: list[str] = []
    for table in published.values():
        names += _shortest_of(table.cells, wanted, "table")
    return tuple(names)


def _shortest_of(
    cells: Sequence[Cell], wanted: set[str], level: Literal["table", "row"]
) -> list[str]:
    used = [cell for cell in cells if cell.path in wanted]
    if not used:
        return []
    if len(used) == len(cells):
        return [used[0].table if level == "table" else f"{used[0].table}/{used[0].row}"]
    if level == "row":
        return [cell.path for cell in used]
    rows = dict.fromkeys(cell.row for cell in cells)
    return [
        name
        for row in rows
        for name in _shortest_of([c for c in cells if c.row == row], wanted, "row")
    ]


def _closeness(name: str) -> tuple[int, int]:
    parts = name.split("/")
    return sum(part != "*" for part in parts), len(parts)
