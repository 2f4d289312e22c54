"""The unknowns of a bench: their fields, bounds and names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from campaign.arrays import Array
from campaign.estimation.unknowns import Unknown, values_at
from campaign.protocol.schema import replaced
from campaign.units import Quantity, convert


@dataclass(frozen=True)
class Parameter:
    """One unknown of a bench.

    Attributes:
        unknown: name, bounds and scale; its start is the present value of the bench.
        fields: dotted paths of its fields of the bench, each with a factor.
        quantity: None for a number without a unit.
        unit: unit for display; "" without one.
    """

    unknown: Unknown
    fields: tuple[tuple[str, float], ...]
    quantity: Quantity | None
    unit: str

    @property
    def name(self) -> str:
        """Name in the result."""
        return self.unknown.name

    def text(self, value: float) -> str | float:
        """SI value for a TOML file: text with unit, or a number; six digits."""
        if self.quantity is None:
            return float(f"{value:.6g}")
        return f"{convert(value, self.quantity.si, self.unit):.6g} {self.unit}"


@dataclass(frozen=True)
class Space:
    """All unknowns; a vector holds shares of their ranges, shape (n,)."""

    parameters: tuple[Parameter, ...]

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        """Unknowns for the optimizer."""
        return tuple(parameter.unknown for parameter in self.parameters)

    def values(self, shares: Array) -> tuple[float, ...]:
        """SI values at shares of the ranges."""
        return values_at(self.unknowns, shares)

    @property
    def present(self) -> tuple[float, ...]:
        """Present SI values of the bench."""
        return tuple(unknown.start for unknown in self.unknowns)

    def bench(self, tree: Mapping[str, Any], values: Sequence[float]) -> dict[str, Any]:
        """Bench tree as written, with `values` (SI) as exact text."""
        changed = dict(tree)
        for parameter, value in zip(self.parameters, values, strict=True):
            for path, factor in parameter.fields:
                si, exact = parameter.quantity, factor * value
                written = f"{exact!r} {si.si}" if si else exact
                changed = replaced(changed, tuple(path.split(".")), written)
        return changed
