"""Unknowns of friction models, with bounds, for identification."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

STATIC = (0.05, 3.0)
"""Static friction over Coulomb friction; real axes have less than 1."""
MOST_VISCOUS = 5.0
"""Viscous over Coulomb friction at the fastest rate, at least up to which it is looked for."""
FAR = 3.0
"""times the Stribeck velocity, where less than a twentieth of the fall from static friction is left
(exponent 1): without such a rate Coulomb friction is extrapolated."""
SLIDE = "slide at more, and further apart, speeds"
SLIDE_SLOWER = "slide at more, and slower, speeds"
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
class ReversalTime:
    """How long it takes in a reversal what a parameter says.

    Attributes:
        what: takes that long, for a reader.
        time: s, from the model's options (SI) and the acceleration of reversals (rad/s^2).
        replaced: whether the model without it is a simpler one, once it is too fast to be seen.
    """

    what: str
    time: Callable[[Mapping[str, Any], float], float]
    replaced: bool = False


@dataclass(frozen=True)
class FrictionUnknown:
    """An unknown of a model.

    Attributes:
        key: of the option that it is; dotted within a table; "" where options are derived from it.
        low, high, start: between which it is looked for, and where first (SI).
        advice: what motion tells more of it.
        rests_on: groups of unknowns: one of each has to be measured for it to mean anything.
        lasts: how long what it says takes in a reversal; None where it is seen between reversals.
        below_one, about_one: of a ratio, what it says where its interval lies below one or has it.
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
    rests_on: tuple[tuple[str, ...], ...] = ()
    lasts: ReversalTime | None = None
    below_one: str = ""
    about_one: str = ""


@dataclass(frozen=True)
class DerivedOption:
    """An option of a model that follows from several unknowns.

    Attributes:
        value: SI, from those of the unknowns by name.
    """

    name: str
    key: str
    unit: str
    meaning: str
    advice: str
    value: Callable[[Mapping[str, float]], float]


Unknowns = Sequence[FrictionUnknown | DerivedOption]

PASSING = ReversalTime(
    "passing it in a reversal", lambda options, turning: options["stribeck_velocity"] / turning
)
BENDING = ReversalTime(
    "bending the bristles",
    lambda options, turning: math.sqrt(
        2.0 * options["coulomb_torque"] / options["bristle_stiffness"] / turning
    ),
    replaced=True,
)


def line(sizes: Sizes, *, by_direction: bool) -> Unknowns:
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
            FrictionUnknown(
                f"coulomb{tail}", f"{prefix}coulomb_torque", "N m",
                f"Dry friction of fast sliding{told}.",
                0.02 * mean, 20.0 * mean, start, REVERSE, logarithmic=True,
            ),
            FrictionUnknown(
                f"viscous{tail}", f"{prefix}viscous_friction", "N m s/rad",
                f"Viscous friction{told}.",
                0.0, most, min(max(viscous, 0.0), largest), SLIDE,
            ),
        ]  # fmt: skip
    return tuple(found)


def product(*names: str) -> Callable[[Mapping[str, float]], float]:
    """Of unknowns, for what follows from them."""
    return lambda values: math.prod(values[name] for name in names)


def static(
    lasts: ReversalTime,
    *,
    by_direction: bool,
    ratio: tuple[float, float] = STATIC,
    start: float = 0.9,
    rests_on: tuple[tuple[str, ...], ...] = (),
) -> Unknowns:
    """Static friction of each direction, as a ratio to Coulomb friction.

    rests_on: as of `FrictionUnknown`, besides Coulomb friction.
    """
    found: list[FrictionUnknown | DerivedOption] = []
    for prefix, tail, told in _ways(by_direction):
        name, base = f"static_over_coulomb{tail}", f"coulomb{tail}"
        where = f"In the {tail[1:]} direction static" if tail else "Static"
        rises = f"{where} friction lies below Coulomb friction: it rises as sliding sets in."
        open_ = (
            f"{where} friction is not distinguishable from Coulomb friction: there is no Stribeck "
            "part that this motion could identify."
        )
        found += [
            FrictionUnknown(
                name, "", "",
                f"Static friction over Coulomb friction{told}; below 1 where none stands out.",
                *ratio, start, SLIDE_SLOWER, rests_on=((base,), *rests_on), lasts=lasts,
                below_one=rises, about_one=open_,
            ),
            DerivedOption(
                f"static_torque{tail}", f"{prefix}static_torque", "N m",
                f"Friction at the onset of sliding{told}.", SLIDE_SLOWER, product(name, base),
            ),
        ]  # fmt: skip
    return tuple(found)


def curve(sizes: Sizes, *, by_direction: bool) -> Unknowns:
    """Coulomb, static and viscous friction, and the rate between them."""
    slow = FrictionUnknown(
        "stribeck_velocity", "stribeck_velocity", "rad/s",
        "Rate over which friction goes from static to Coulomb.",
        1e-4 * sizes.rate, sizes.rate / FAR, 0.1 * sizes.rate, SLIDE_SLOWER, logarithmic=True,
        rests_on=(tuple(f"coulomb{tail}" for _, tail, _ in _ways(by_direction)),), lasts=PASSING,
    )  # fmt: skip
    # One direction may rise to its Coulomb friction, and the other fall to it.
    return (
        *line(sizes, by_direction=by_direction),
        # What lies at rest is extrapolated where the rate over which it falls is not known.
        *static(PASSING, by_direction=by_direction, rests_on=((slow.name,),)),
        slow,
    )


EXPONENT = FrictionUnknown(
    "stribeck_exponent", "stribeck_exponent", "", "Shape of the curve between the two.",
    0.2, 5.0, 2.0, SLIDE_SLOWER, logarithmic=True,
    rests_on=(("stribeck_velocity",),), lasts=PASSING,
)  # fmt: skip
"""Of a Stribeck curve; a motion that tells it is rare, so it is held first."""


def stiffness(sizes: Sizes) -> FrictionUnknown:
    """Of presliding."""
    soft = sizes.torque / sizes.travel
    return FrictionUnknown(
        "bristle_stiffness", "bristle_stiffness", "N m/rad", "Stiffness of presliding.",
        soft, 1e7 * soft, 1e3 * soft, PRESLIDE, logarithmic=True, lasts=BENDING,
    )  # fmt: skip


def damping(sizes: Sizes) -> FrictionUnknown:
    """Of presliding."""
    thick = sizes.torque / sizes.rate
    return FrictionUnknown(
        "bristle_damping", "bristle_damping", "N m s/rad", "Damping of presliding.",
        1e-6 * thick, 1e4 * thick, thick, PRESLIDE, logarithmic=True,
        rests_on=(("bristle_stiffness",),), lasts=BENDING,
    )  # fmt: skip


def bristles(sizes: Sizes, *, by_direction: bool) -> Unknowns:
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
