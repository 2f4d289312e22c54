"""Unknowns of friction models, with bounds, for identification."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

STATIC = (0.05, 3.0)
"""Bounds of static over Coulomb friction; some real axes have less than 1."""
MOST_VISCOUS = 5.0
"""Smallest upper bound of viscous over Coulomb friction at the fastest rate."""
FAR = 3.0
"""Times the Stribeck velocity, where less than a twentieth of the fall from static friction remains
(exponent 1): without such a rate Coulomb friction is extrapolated."""
SLIDE = "slide at more, and further apart, speeds"
SLIDE_SLOWER = "slide at more, and slower, speeds"
REVERSE = "reverse more often"
PRESLIDE = "stay below breakaway: `presliding_multisine` measures it"


@dataclass(frozen=True)
class Sizes:
    """Sizes of a rig's friction from inverse dynamics, the source of start values and bounds.

    Attributes:
        coulomb, viscous: of both directions (SI).
        rate: largest rate of the motion; travel: its range of angle, or position.
    """

    coulomb: tuple[float, float]
    viscous: tuple[float, float]
    rate: float
    travel: float

    @property
    def torque(self) -> float:
        """Coulomb friction, mean of both directions."""
        return 0.5 * sum(self.coulomb)


@dataclass(frozen=True)
class ReversalTime:
    """Duration of a parameter's effect in a reversal.

    Attributes:
        what: name of the process, for the user.
        time: s, from the model's options (SI) and the acceleration of reversals (rad/s^2).
        replaced: whether a simpler model replaces it if the process is too fast to observe.
    """

    what: str
    time: Callable[[Mapping[str, Any], float], float]
    replaced: bool = False


@dataclass(frozen=True)
class FrictionUnknown:
    """An unknown of a model.

    Attributes:
        key: of its option; dotted within a table; "" if options are derived from it.
        low, high, start: bounds and start value of the search (SI).
        advice: motion that determines it better.
        rests_on: groups of unknowns; without a measured one of each group it has no meaning.
        lasts: duration of its effect in a reversal; None if it acts between reversals.
        below_one, about_one: statement on a ratio if its interval is below one, or includes one.
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
        value: SI, from the values of the unknowns by name.
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


def line(sizes: Sizes, by_direction: bool) -> Unknowns:
    """Coulomb and viscous friction."""
    mean = sizes.torque
    largest = max(0.5 * sum(sizes.viscous), 0.02 * mean / sizes.rate)
    # If friction falls at the onset of sliding, a straight line has almost no slope.
    most = max(6.0 * largest, MOST_VISCOUS * mean / sizes.rate)
    unknowns = []
    for number, (prefix, tail, words) in enumerate(_ways(by_direction)):
        coulomb = sizes.coulomb[number] if tail else mean
        viscous = sizes.viscous[number] if tail else 0.5 * sum(sizes.viscous)
        start = min(max(coulomb, 0.1 * mean), 10.0 * mean)
        unknowns += [
            FrictionUnknown(
                f"coulomb{tail}", f"{prefix}coulomb_torque", "N m",
                f"Dry friction of fast sliding{words}.",
                0.02 * mean, 20.0 * mean, start, REVERSE, logarithmic=True,
            ),
            FrictionUnknown(
                f"viscous{tail}", f"{prefix}viscous_friction", "N m s/rad",
                f"Viscous friction{words}.",
                0.0, most, min(max(viscous, 0.0), largest), SLIDE,
            ),
        ]  # fmt: skip
    return tuple(unknowns)


def product(*names: str) -> Callable[[Mapping[str, float]], float]:
    """Function that multiplies these unknowns, for a derived option."""
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

    rests_on: as in `FrictionUnknown`, besides Coulomb friction.
    """
    unknowns: list[FrictionUnknown | DerivedOption] = []
    for prefix, tail, words in _ways(by_direction):
        name, base = f"static_over_coulomb{tail}", f"coulomb{tail}"
        where = f"In the {tail[1:]} direction static" if tail else "Static"
        rises = f"{where} friction lies below Coulomb friction: it rises as sliding sets in."
        open_ = (
            f"{where} friction is not distinguishable from Coulomb friction: there is no Stribeck "
            "part that this motion could identify."
        )
        unknowns += [
            FrictionUnknown(
                name, "", "",
                f"Static friction over Coulomb friction{words}; below 1 where none stands out.",
                *ratio, start, SLIDE_SLOWER, rests_on=((base,), *rests_on), lasts=lasts,
                below_one=rises, about_one=open_,
            ),
            DerivedOption(
                f"static_torque{tail}", f"{prefix}static_torque", "N m",
                f"Friction at the onset of sliding{words}.", SLIDE_SLOWER, product(name, base),
            ),
        ]  # fmt: skip
    return tuple(unknowns)


def curve(sizes: Sizes, by_direction: bool) -> Unknowns:
    """Coulomb, static and viscous friction, and the rate between them."""
    slow = FrictionUnknown(
        "stribeck_velocity", "stribeck_velocity", "rad/s",
        "Rate over which friction goes from static to Coulomb.",
        1e-4 * sizes.rate, sizes.rate / FAR, 0.1 * sizes.rate, SLIDE_SLOWER, logarithmic=True,
        rests_on=(tuple(f"coulomb{tail}" for _, tail, _ in _ways(by_direction)),), lasts=PASSING,
    )  # fmt: skip
    # Friction can rise to Coulomb friction in one direction, and fall to it in the other.
    return (
        *line(sizes, by_direction),
        # Without the Stribeck velocity, static friction is an extrapolation.
        *static(PASSING, by_direction=by_direction, rests_on=((slow.name,),)),
        slow,
    )


EXPONENT = FrictionUnknown(
    "stribeck_exponent", "stribeck_exponent", "", "Shape of the curve between the two.",
    0.2, 5.0, 2.0, SLIDE_SLOWER, logarithmic=True,
    rests_on=(("stribeck_velocity",),), lasts=PASSING,
)  # fmt: skip
"""Exponent of a Stribeck curve; few motions determine it, so the first fit keeps it constant."""


def stiffness(sizes: Sizes) -> FrictionUnknown:
    """Stiffness of presliding."""
    soft = sizes.torque / sizes.travel
    return FrictionUnknown(
        "bristle_stiffness", "bristle_stiffness", "N m/rad", "Stiffness of presliding.",
        soft, 1e7 * soft, 1e3 * soft, PRESLIDE, logarithmic=True, lasts=BENDING,
    )  # fmt: skip


def damping(sizes: Sizes) -> FrictionUnknown:
    """Damping of presliding."""
    thick = sizes.torque / sizes.rate
    return FrictionUnknown(
        "bristle_damping", "bristle_damping", "N m s/rad", "Damping of presliding.",
        1e-6 * thick, 1e4 * thick, thick, PRESLIDE, logarithmic=True,
        rests_on=(("bristle_stiffness",),), lasts=BENDING,
    )  # fmt: skip


def bristles(sizes: Sizes, by_direction: bool) -> Unknowns:
    """A Stribeck curve with bristles."""
    return (*curve(sizes, by_direction), stiffness(sizes), damping(sizes))


def _ways(by_direction: bool) -> tuple[tuple[str, str, str], ...]:
    """Prefix of options, suffix of names and suffix of texts, by direction."""
    if not by_direction:
        return (("", "", ""),)
    return (
        ("", "_positive", ", positive direction"),
        ("negative.", "_negative", ", negative direction"),
    )
