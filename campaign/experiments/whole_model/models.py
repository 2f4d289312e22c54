"""Friction models as unknowns: which numbers of each are fitted, from where, and between what."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from campaign.estimation.unknowns import Unknown

STATIC = (0.05, 3.0)
"""Static friction over Coulomb friction; real axes have less than 1."""
MOST_VISCOUS = 5.0
"""Viscous over Coulomb friction at the fastest rate, at least up to which it is looked for."""


@dataclass(frozen=True)
class Fitted:
    """One number of a model.

    Attributes:
        key: of the interface's options.
        over: key that it is a multiple of; "" where it is SI by itself.
    """

    unknown: Unknown
    key: str
    unit: str
    meaning: str
    over: str = ""


@dataclass(frozen=True)
class Model:
    """A friction model with both directions alike, or each with its own torques.

    Attributes:
        name: `lugre by direction`.
        model: of the program, by its name.
        numbers: those that are fitted.
    """

    name: str
    model: str
    numbers: tuple[Fitted, ...]

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        """Each once, in their order."""
        return tuple({each.unknown.name: each.unknown for each in self.numbers}.values())

    def options(self, values: Mapping[str, float]) -> dict[str, Any]:
        """An interface's options (SI) from the values of unknowns, by name."""
        flat: dict[str, float] = {}
        for each in self.numbers:
            scale = flat[each.over] if each.over else 1.0
            flat[each.key] = scale * values[each.unknown.name]
        tree: dict[str, Any] = {"model": self.model}
        for key, value in flat.items():
            head, _, tail = key.partition(".")
            if tail:
                tree.setdefault(head, {})[tail] = value
            else:
                tree[head] = value
        return tree


@dataclass(frozen=True)
class Sizes:
    """Of a rig's friction, from plain inverse dynamics: what starts and bounds follow from.

    Attributes:
        coulomb, viscous: of both directions (SI).
        rate: fastest of the motion; travel: its range of angle, or position.
    """

    coulomb: tuple[float, float]
    viscous: tuple[float, float]
    rate: float
    travel: float


def models(sizes: Sizes) -> Sequence[Model]:
    """The models that are tried, the plain ones first."""
    return (
        Model("stribeck, directions alike", "stribeck", _curve(sizes, by_direction=False)),
        Model("stribeck, by direction", "stribeck", _curve(sizes, by_direction=True)),
        Model(
            "lugre, by direction",
            "lugre",
            (*_curve(sizes, by_direction=True), *_bristles(sizes)),
        ),
    )


def _curve(sizes: Sizes, *, by_direction: bool) -> tuple[Fitted, ...]:
    """Coulomb, static and viscous friction, and the rate between them."""
    mean = 0.5 * sum(sizes.coulomb)
    largest = max(0.5 * sum(sizes.viscous), 0.02 * mean / sizes.rate)
    # Where friction falls as sliding sets in, a plain line has hardly any slope.
    most = max(6.0 * largest, MOST_VISCOUS * mean / sizes.rate)
    found = []
    ways = (("", "positive"), ("negative.", "negative")) if by_direction else (("", ""),)
    for number, (prefix, way) in enumerate(ways):
        tail = f"_{way}" if way else ""
        told = f", {way} direction" if way else ""
        coulomb = sizes.coulomb[number] if way else mean
        viscous = sizes.viscous[number] if way else 0.5 * sum(sizes.viscous)
        start = min(max(coulomb, 0.1 * mean), 10.0 * mean)
        found += [
            Fitted(
                Unknown(f"coulomb{tail}", 0.02 * mean, 20.0 * mean, start, logarithmic=True),
                f"{prefix}coulomb_torque",
                "N m",
                f"Dry friction of fast sliding{told}.",
            ),
            Fitted(
                Unknown(f"viscous{tail}", 0.0, most, min(max(viscous, 0.0), largest)),
                f"{prefix}viscous_friction",
                "N m s/rad",
                f"Viscous friction{told}.",
            ),
        ]
    # One direction may rise to its Coulomb friction, and the other fall to it.
    for prefix, way in ways:
        static = Unknown(f"static_over_coulomb{'_' * bool(way)}{way}", *STATIC, 0.9)
        told = f", {way} direction" if way else ""
        meaning = f"Static friction over Coulomb friction{told}; below 1 where none stands out."
        found.append(
            Fitted(static, f"{prefix}static_torque", "", meaning, f"{prefix}coulomb_torque")
        )
    slow = Unknown(
        "stribeck_velocity", 1e-4 * sizes.rate, sizes.rate, 0.1 * sizes.rate, logarithmic=True
    )
    found.append(
        Fitted(
            slow,
            "stribeck_velocity",
            "rad/s",
            "Rate over which friction goes from static to Coulomb.",
        )
    )
    return tuple(found)


def _bristles(sizes: Sizes) -> tuple[Fitted, ...]:
    mean = 0.5 * sum(sizes.coulomb)
    soft, stiff = mean / sizes.travel, 1e7 * mean / sizes.travel
    stiffness = Unknown("bristle_stiffness", soft, stiff, 1e3 * soft, logarithmic=True)
    thick = mean / sizes.rate
    damping = Unknown("bristle_damping", 1e-6 * thick, 1e4 * thick, thick, logarithmic=True)
    return (
        Fitted(stiffness, "bristle_stiffness", "N m/rad", "Stiffness of presliding."),
        Fitted(damping, "bristle_damping", "N m s/rad", "Damping of presliding."),
    )
