"""The unknowns of a bench, and the unit cube in which a fit moves."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from campaign.protocol.schema import replaced
from campaign.units import Quantity, convert

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Parameter:
    """One unknown.

    Attributes:
        fields: dotted path of each field of the bench it drives, with its factor.
        quantity: None for a number without a unit.
        lower, upper, present: SI; `present` is what the bench says now.
        unit: in which people are told it; "" without one.
    """

    name: str
    fields: tuple[tuple[str, float], ...]
    quantity: Quantity | None
    lower: float
    upper: float
    present: float
    unit: str
    logarithmic: bool

    def value(self, share: float) -> float:
        """SI value at a share of the way from lower (0) to upper (1); beyond them, too."""
        if self.logarithmic:
            return self.lower * math.exp(share * math.log(self.upper / self.lower))
        return self.lower + share * (self.upper - self.lower)

    def share(self, value: float) -> float:
        """Inverse of `value`."""
        if self.logarithmic:
            return math.log(value / self.lower) / math.log(self.upper / self.lower)
        return (value - self.lower) / (self.upper - self.lower)

    def text(self, value: float) -> str | float:
        """An SI value as a TOML file has it: text with its unit, to six digits."""
        if self.quantity is None:
            return float(f"{value:.6g}")
        return f"{convert(value, self.quantity.si, self.unit):.6g} {self.unit}"


@dataclass(frozen=True)
class Space:
    """All unknowns; a vector is their shares, shape (n,)."""

    parameters: tuple[Parameter, ...]

    def values(self, shares: Array) -> tuple[float, ...]:
        """SI values."""
        return tuple(p.value(float(s)) for p, s in zip(self.parameters, shares, strict=True))

    def shares(self, values: Sequence[float]) -> Array:
        """Inverse of `values`."""
        return np.array([p.share(v) for p, v in zip(self.parameters, values, strict=True)])

    @property
    def present(self) -> Array:
        """Where the bench is now."""
        return self.shares([p.present for p in self.parameters])

    def bench(self, tree: Mapping[str, Any], values: Sequence[float]) -> dict[str, Any]:
        """A bench as written with `values` put in as exact text."""
        changed = dict(tree)
        for parameter, value in zip(self.parameters, values, strict=True):
            for path, factor in parameter.fields:
                si, exact = parameter.quantity, factor * value
                written = f"{exact!r} {si.si}" if si else exact
                changed = replaced(changed, tuple(path.split(".")), written)
        return changed
