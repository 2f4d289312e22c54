"""Parameters of friction models as unknowns: what a model states so that motions identify it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

STATIC = (0.05, 3.0)
"""Static friction over Coulomb friction; real axes have less than 1."""
MOST_VISCOUS = 5.0
"""Viscous over Coulomb friction at the fastest rate, at least up to which it is looked for."""
SLIDE = "slide at more, and further apart, speeds"
REVERSE = "reverse more often"
PRESLIDE = "stay below breakaway: `presliding_multisine` measures it"


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

    @property
    def torque(self) -> float:
        """Coulomb friction, the mean of both directions."""
        return 0.5 * sum(self.coulomb)


@dataclass(frozen=True)
class Sought:
    """A parameter of a model.

    Attributes:
        name: of the unknown.
        key: of the options; dotted within a table.
        low, high, start: between which it is looked for, and where first (SI).
        advice: what motion tells more of it.
        over: key that it is a multiple of; "" where it is SI by itself.
        presliding: whether only motion below breakaway tells it.
    """

    name: str
    key: str
    unit: str
    meaning: str
    low: float
    high: float
    start: float
    advice: str
    logarithmic: bool = False
    over: str = ""
    presliding: bool = False


def line(sizes: Sizes, *, by_direction: bool) -> tuple[Sought, ...]:
    """Coulomb and viscous friction."""
    mean = sizes.torque
    largest = max(0.5 * sum(sizes.viscous), 0.02 * mean / sizes.rate)
    # Where friction falls as sliding sets in, a plain line has hardly any slope.
    most = max(6.0 * largest, MOST_VISCOUS * mean / sizes.rate)
    found = []
    for number, (prefix, tail, told) in enumerate(_ways(by_direction)):
        coulomb = sizes.coulomb[number] if tail else mean
        viscous = sizes.viscous[number] if tail else 0.5 * sum(sizes.viscous)
        start = min(max(coulomb, 0.1 * mean), 10.0 * mean)
        found += [
            Sought(
                f"coulomb{tail}", f"{prefix}coulomb_torque", "N m",
                f"Dry friction of fast sliding{told}.",
                0.02 * mean, 20.0 * mean, start, REVERSE, logarithmic=True,
            ),
            Sought(
                f"viscous{tail}", f"{prefix}viscous_friction", "N m s/rad",
                f"Viscous friction{told}.",
                0.0, most, min(max(viscous, 0.0), largest), SLIDE,
            ),
        ]  # fmt: skip
    return tuple(found)


def curve(sizes: Sizes, *, by_direction: bool) -> tuple[Sought, ...]:
    """Coulomb, static and viscous friction, and the rate between them."""
    # One direction may rise to its Coulomb friction, and the other fall to it.
    static = tuple(
        Sought(
            f"static_over_coulomb{tail}", f"{prefix}static_torque", "",
            f"Static friction over Coulomb friction{told}; below 1 where none stands out.",
            *STATIC, 0.9, "slide at more, and slower, speeds", over=f"{prefix}coulomb_torque",
        )
        for prefix, tail, told in _ways(by_direction)
    )  # fmt: skip
    slow = Sought(
        "stribeck_velocity", "stribeck_velocity", "rad/s",
        "Rate over which friction goes from static to Coulomb.",
        1e-4 * sizes.rate, sizes.rate, 0.1 * sizes.rate, "slide at more, and slower, speeds",
        logarithmic=True,
    )  # fmt: skip
    return (*line(sizes, by_direction=by_direction), *static, slow)


def stiffness(sizes: Sizes) -> Sought:
    """Of presliding."""
    soft = sizes.torque / sizes.travel
    return Sought(
        "bristle_stiffness", "bristle_stiffness", "N m/rad", "Stiffness of presliding.",
        soft, 1e7 * soft, 1e3 * soft, PRESLIDE, logarithmic=True, presliding=True,
    )  # fmt: skip


def damping(sizes: Sizes) -> Sought:
    """Of presliding."""
    thick = sizes.torque / sizes.rate
    return Sought(
        "bristle_damping", "bristle_damping", "N m s/rad", "Damping of presliding.",
        1e-6 * thick, 1e4 * thick, thick, PRESLIDE, logarithmic=True, presliding=True,
    )  # fmt: skip


def bristles(sizes: Sizes, *, by_direction: bool) -> Sequence[Sought]:
    """A Stribeck curve with bristles."""
    return (*curve(sizes, by_direction=by_direction), stiffness(sizes), damping(sizes))


def _ways(by_direction: bool) -> tuple[tuple[str, str, str], ...]:
    """Prefix of options, tail of names, words."""
    if not by_direction:
        return (("", "", ""),)
    return (
        ("", "_positive", ", positive direction"),
        ("negative.", "_negative", ", negative direction"),
    )
