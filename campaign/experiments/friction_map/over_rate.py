"""Friction, or a coefficient of it, over rate: what steady stretches show in each direction."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from campaign.estimate import Estimate
from campaign.estimation.friction_line import (
    FrictionLine,
    friction_line,
    in_order_of_time,
    mean_of_stretches,
)
from campaign.estimation.intervals import shifted_by
from campaign.estimation.stribeck import stribeck
from campaign.estimation.velocity_map import DirectionFit, band, direction_estimates, fit_direction
from campaign.experiments.friction_map.runs import DIRECTIONS
from campaign.experiments.friction_map.stretches import Point, places
from campaign.result import Array
from campaign.units import rate_here

ANGLE = "angle"
"""Part of an uncertainty: what was taken off the torque by the angle."""
FEWEST_SPEEDS = 6
"""of a direction, up to which no Stribeck curve is fitted."""
MEANINGS = {
    "coulomb_torque": ("N m", "Dry friction of fast sliding"),
    "static_torque": ("N m", "Friction at the onset of sliding"),
    "stribeck_velocity": ("rad/s", "Rate over which friction goes from static to Coulomb"),
    "stribeck_exponent": ("", "Shape of that"),
    "viscous_friction": ("N m s/rad", "Friction that grows with the rate"),
    "friction": ("N m", "Friction of sliding, at the speeds that there are"),
}


@dataclass(frozen=True)
class Quantity:
    """What is mapped: friction, or friction over normal load.

    Attributes:
        name: in the names of parameters: `coulomb_torque`, `coulomb_coefficient`.
        read: of a point, signed.
        meanings: unit and meaning of each parameter, by its name.
        axis: of its figure: label, SI unit, display unit.
    """

    name: str
    read: Callable[[Point], Estimate]
    meanings: Mapping[str, tuple[str, str]]
    axis: tuple[str, str, str]

    def called(self, parameter: str) -> str:
        """A parameter's name."""
        if self.name == "torque":
            return parameter
        return parameter.replace("torque", self.name).replace(
            "viscous_friction", f"viscous_{self.name}"
        )


FRICTION = Quantity(
    "torque", lambda point: point.own.torque, MEANINGS, ("Friction torque", "N m", "N m")
)
COEFFICIENT = Quantity(
    "coefficient",
    lambda point: point.coefficient,
    {
        **MEANINGS,
        "coulomb_torque": ("", "Friction coefficient of fast sliding"),
        "static_torque": ("", "Friction coefficient at the onset of sliding"),
        "viscous_friction": ("s/rad", "How the friction coefficient grows with the rate"),
        "friction": ("", "Friction coefficient"),
    },
    ("Friction coefficient", "", ""),
)


@dataclass(frozen=True)
class Mapped:
    """One quantity over rate: what was fitted to each direction, by its name.

    Attributes:
        doubts: of direction and parameter, what all points share (1 sigma).
    """

    quantity: Quantity
    fits: dict[str, DirectionFit] = field(default_factory=dict)
    lines: dict[str, FrictionLine] = field(default_factory=dict)
    means: dict[str, Estimate] = field(default_factory=dict)
    doubts: dict[tuple[str, str], float] = field(default_factory=dict)

    @property
    def plain(self) -> dict[str, dict[str, Estimate]]:
        """Parameters by direction, with what scatters."""
        told = {name: direction_estimates(fit, fit.preferred) for name, fit in self.fits.items()}
        told |= {way: {e.name: e for e in (r.coulomb, r.viscous)} for way, r in self.lines.items()}
        told |= {way: {mean.name: mean} for way, mean in self.means.items()}
        return {way: told[way] for way in DIRECTIONS if way in told}

    @property
    def found(self) -> dict[str, dict[str, Estimate]]:
        """Parameters by direction, with what all points share, too."""
        return {
            way: {name: self._doubted(way, name, one) for name, one in estimates.items()}
            for way, estimates in self.plain.items()
        }

    def curve(self, way: str, speed: Array) -> tuple[Array, Array, Array] | None:
        """Fitted friction at `speed`, shape (n,), and both ends of its 95 % band; None of a mean.

        All positive where friction acts against the motion.
        """
        if way in self.fits:
            fit = self.fits[way]
            middle = np.asarray(stribeck(speed, fit.fits[fit.preferred].values))
            half = band(fit, fit.preferred, speed)
            return middle, middle - half, middle + half
        if way in self.lines:
            line = self.lines[way]
            return line.coulomb.value + line.viscous.value * speed, *line.band(speed)
        return None

    def _doubted(self, way: str, name: str, one: Estimate) -> Estimate:
        doubt = self.doubts.get((way, name), 0.0)
        return shifted_by(one, ANGLE, doubt) if doubt > 0 and one.has_interval else one


def with_doubts(mapped: Mapped, points: Sequence[Point]) -> Mapped:
    """With what parameters would be otherwise if what was taken off by the angle were off."""
    found: dict[tuple[str, str], float] = {}
    for part in range(min((len(each.doubts) for each in points), default=0)):
        other = mapped_over_rate(mapped.quantity, [each.off_by(part) for each in points], [])
        for way, estimates in mapped.plain.items():
            for name, one in estimates.items():
                again = other.plain.get(way, {}).get(name)
                moved = 0.0 if again is None else again.value - one.value
                found[way, name] = float(np.hypot(found.get((way, name), 0.0), moved))
    return replace(mapped, doubts=found)


def mapped_over_rate(quantity: Quantity, points: Sequence[Point], notes: list[str]) -> Mapped:
    """Stribeck curves, lines or means of each direction; what is not told goes to the notes."""
    mapped = Mapped(quantity)
    for name, sign in DIRECTIONS.items():
        own = [point for point in points if point.sign == sign]
        if not own:
            notes.append(f"The axis never slides steadily in the {name} direction.")
            continue
        speed = np.array([point.speed for point in own])
        read = [quantity.read(point) for point in own]
        values = np.array([sign * each.value for each in read])
        error = np.array([each.standard_error or 0.0 for each in read])
        place = places(speed)
        count = len(np.unique(place))
        if count > FEWEST_SPEEDS:
            fit = fit_direction(speed, values, error, place)
            mapped.fits[name] = fit
            notes.append(f"In the {name} direction {_stribeck_part(fit)}.")
            continue
        try:
            line = friction_line(speed, values)
        except ValueError as problem:
            mean = mean_of_stretches("friction", values, quantity.meanings["friction"][0])
            mapped.means[name] = mean
            at = f"{rate_here(float(speed.min()))} to {rate_here(float(speed.max()))}"
            notes.append(
                f"In the {name} direction {problem}: friction is that from {at}, and what of it is "
                "dry or viscous is not known."
            )
            continue
        mapped.lines[name] = line
        notes.append(
            f"In the {name} direction {count} speeds show a straight line and no "
            f"Stribeck curve; more than {FEWEST_SPEEDS} are needed."
        )
        if in_order_of_time(speed):
            notes.append(
                f"In the {name} direction speeds go one way as time goes on: friction that changes "
                "with time, as it warms up, looks like viscous friction."
            )
    return mapped


def _stribeck_part(fit: DirectionFit) -> str:
    """Whether friction falls or rises as sliding sets in, in words."""
    # What is told by a line shows no Stribeck part, whatever a free curve could be bent to.
    told = direction_estimates(fit, fit.preferred)
    if not fit.shows_stribeck_effect or "static_torque" not in told:
        return (
            "static friction is not told from Coulomb friction: there is no Stribeck part that "
            "these speeds could identify"
        )
    values = fit.fits[fit.preferred].values
    if values["static_torque"] < values["coulomb_torque"]:
        return "static friction lies below Coulomb friction: friction rises as sliding sets in"
    return "static friction lies above Coulomb friction, as of a Stribeck curve"
