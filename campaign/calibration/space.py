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
        unknown: its name, bounds and scale; it starts at what the bench says now.
        fields: dotted path of each field of the bench it drives, with its factor.
        quantity: None for a number without a unit.
        unit: in which people are told it; "" without one.
    """

    unknown: Unknown
    fields: tuple[tuple[str, float], ...]
    quantity: Quantity | None
    unit: str

    @property
    def name(self) -> str:
        """What the result calls it."""
        return self.unknown.name

    def text(self, value: float) -> str | float:
        """An SI value as a TOML file has it: text with its unit, to six digits."""
        if self.quantity is None:
            return float(f"{value:.6g}")
        return f"{convert(value, self.quantity.si, self.unit):.6g} {self.unit}"


@dataclass(frozen=True)
class Space:
    """All unknowns; a vector is the shares of their ranges, shape (n,)."""

    parameters: tuple[Parameter, ...]

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        """What an optimiser needs to know of them."""
        return tuple(parameter.unknown for parameter in self.parameters)

    def values(self, shares: Array) -> tuple[float, ...]:
        """SI values."""
        return values_at(self.unknowns, shares)

    @property
    def present(self) -> tuple[float, ...]:
        """SI values that the bench has now."""
        return tuple(unknown.start for unknown in self.unknowns)

    def bench(self, tree: Mapping[str, Any], values: Sequence[float]) -> dict[str, Any]:
        """A bench as written with `values` put in as exact text."""
        changed = dict(tree)
        for parameter, value in zip(self.parameters, values, strict=True):
            for path, factor in parameter.fields:
                si, exact = parameter.quantity, factor * value
                written = f"{exact!r} {si.si}" if si else exact
                changed = replaced(changed, tuple(path.split(".")), written)
        return changed
