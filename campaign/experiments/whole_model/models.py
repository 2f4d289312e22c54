"""Friction models as sets of unknowns, with equal or separate directions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from campaign.estimation.unknowns import Unknown
from campaign.physics.friction import friction_models
from campaign.physics.friction.unknowns import DerivedOption, FrictionUnknown, Sizes
from campaign.text import nearest

USUAL = ("stribeck", "lugre")
"""What is tried unless something else is said; the first one with directions alike, too."""
WAYS = (("directions alike", False), ("by direction", True))


@dataclass(frozen=True)
class Model:
    """A friction model with both directions alike, or each with its own torques.

    Attributes:
        name: `lugre by direction`.
        model: of the program, by its name.
        numbers: those that are fitted.
        derived: options that follow from several of them.
    """

    name: str
    model: str
    numbers: tuple[FrictionUnknown, ...]
    derived: tuple[DerivedOption, ...] = ()

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        """In their order."""
        return tuple(
            Unknown(each.name, each.low, each.high, each.start, each.logarithmic)
            for each in self.numbers
        )

    def options(self, values: Mapping[str, float]) -> dict[str, Any]:
        """An interface's options (SI) from the values of unknowns, by name."""
        flat = {each.key: values[each.name] for each in self.numbers if each.key}
        flat |= {each.key: each.value(values) for each in self.derived}
        tree: dict[str, Any] = {"model": self.model}
        for key, value in flat.items():
            head, _, tail = key.partition(".")
            if tail:
                tree.setdefault(head, {})[tail] = value
            else:
                tree[head] = value
        return tree


def models(sizes: Sizes, names: Sequence[str] = USUAL) -> Sequence[Model]:
    """The models that are tried, in their order; the first with directions alike, too.

    Raises ValueError for a model that is not there, or does not say what is fitted of it.
    """
    found: list[Model] = []
    for name in names:
        known = friction_models()
        if name not in known:
            raise ValueError(f"there is no friction model {name!r}{nearest(name, known)}")
        unknowns = known[name].unknowns
        if unknowns is None:
            there = ", ".join(each for each in known if known[each].unknowns is not None)
            raise ValueError(f"{name} does not say what is fitted of it; there are {there}")
        for way, by_direction in WAYS[1:] if found else WAYS:
            stated = unknowns(sizes, by_direction)
            numbers = tuple(each for each in stated if isinstance(each, FrictionUnknown))
            derived = tuple(each for each in stated if isinstance(each, DerivedOption))
            found.append(Model(f"{name}, {way}", name, numbers, derived))
    return found
