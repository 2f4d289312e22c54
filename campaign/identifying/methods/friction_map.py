"""Friction over rate, from wherever any recording slides steadily, in both directions.

Where six speeds or more were slid at, a Stribeck curve is fitted to each direction; where there are
fewer, a straight line; of one speed there is the friction at it. Static friction that lies below
Coulomb friction is as welcome as any other. Where the normal load was recorded, the same is said of
the friction coefficient; of it alone where loads differ.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from pydantic import Field

from campaign.archive import ArchivedTrial
from campaign.channels import DRIVE_TORQUE, JOINT_TORQUE, NORMAL_LOAD, RELATIVE_RATE
from campaign.estimate import Estimate, Origin
from campaign.experiments.shared.elsewhere import with_scale
from campaign.experiments.shared.systematic import TORQUE_CONSTANT, with_systematic
from campaign.identification.friction_line import friction_line, mean_of_stretches
from campaign.identification.steady_stretches import SHORTEST_TIME
from campaign.identification.stribeck import stribeck
from campaign.identification.velocity_map import DirectionFit, direction_estimates, fit_direction
from campaign.identifying.method import Identified, Material, Method, Parameter
from campaign.identifying.sliding import (
    DIRECTIONS,
    Point,
    force_of,
    goes_along,
    loaded,
    loads_alike,
    places,
    points_of,
)
from campaign.options import Options
from campaign.result import (
    Amount,
    Axis,
    Cell,
    Column,
    Conclusion,
    Curve,
    Figure,
    Finding,
    Panel,
    Result,
    Table,
)
from campaign.units import AngularRate, Time, rate_here

FEWEST_SPEEDS = 6
FINE = 100
KEYS = {
    "coulomb_torque": "coulomb_torque",
    "static_torque": "static_torque",
    "stribeck_velocity": "stribeck_velocity",
    "stribeck_exponent": "stribeck_exponent",
    "viscous_friction": "viscous_friction",
}
MEANINGS = {
    "coulomb_torque": ("N m", "Dry friction of fast sliding"),
    "static_torque": ("N m", "Friction at the onset of sliding"),
    "stribeck_velocity": ("rad/s", "Rate over which friction goes from static to Coulomb"),
    "stribeck_exponent": ("", "Shape of that"),
    "viscous_friction": ("N m s/rad", "Friction that grows with the rate"),
    "friction": ("N m", "Friction of sliding, at the speeds that there are"),
}
ADVICE = {
    "coulomb_torque": "slide at more speeds",
    "static_torque": "slide more slowly: below a tenth of the Stribeck velocity",
    "stribeck_velocity": "slide at more speeds around it",
    "stribeck_exponent": "slide at more speeds around the Stribeck velocity",
    "viscous_friction": "slide at more, and further apart, speeds",
    "friction": "slide at several speeds, further apart",
}


class FrictionMapOptions(Options):
    """Options of a friction map."""

    shortest: Time = Field(default=SHORTEST_TIME, gt=0)
    """Shortest steady stretch that is read, where a trial names no windows."""
    slowest: AngularRate | None = Field(default=None, ge=0)
    """Rate up to which the axis counts as standing still; absent: 3 % of the fastest of its trial.
    A sweep over decades of speed in one trial needs less."""


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


FRICTION = Quantity("torque", lambda point: point.own.torque, MEANINGS, ("Torque", "N m", "N m"))
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
    """One quantity over rate: what was fitted to each direction, by its name."""

    quantity: Quantity
    fits: dict[str, DirectionFit] = field(default_factory=dict)
    lines: dict[str, dict[str, Estimate]] = field(default_factory=dict)

    @property
    def found(self) -> dict[str, dict[str, Estimate]]:
        """Parameters by direction."""
        told = {name: direction_estimates(fit, fit.preferred) for name, fit in self.fits.items()}
        return {name: (told | self.lines)[name] for name in DIRECTIONS if name in told | self.lines}


def _suits(trials: Sequence[ArchivedTrial]) -> tuple[Sequence[ArchivedTrial], str]:
    found = []
    for each in trials:
        names = each.channel_names()
        if RELATIVE_RATE in names and names & {DRIVE_TORQUE, JOINT_TORQUE}:
            found.append(each)
    why = f"no trial has {RELATIVE_RATE}, and {DRIVE_TORQUE} or {JOINT_TORQUE}"
    return found, "" if found else why


def _identify(material: Material, options: FrictionMapOptions) -> Identified:
    points = [
        point
        for trial in material.trials
        for point in points_of(trial, material.bench, options.shortest, options.slowest)
    ]
    if not points:
        raise ValueError("nowhere does the axis slide steadily")
    notes: list[str] = []
    quantities = [FRICTION] if loads_alike(points) else []
    quantities += [COEFFICIENT] if loaded(points) else []
    if not quantities:
        raise ValueError("normal loads differ, and some stretches have none")
    if FRICTION not in quantities:
        notes.append(
            "Normal loads differ between stretches: friction over rate is told over the load only."
        )
    maps = [_mapped(quantity, points, notes) for quantity in quantities]
    if not any(each.fits or each.lines for each in maps):
        raise ValueError("; ".join(note.rstrip(".") for note in notes))
    if goes_along(points):
        notes.append(
            "Friction goes with the motion nearly everywhere, and cannot: the column of the force, "
            "or that of the motion, has the other sign, as of a sensor on the part that rests. "
            "In the mapping `sign = -1` turns it round."
        )
    parameters = tuple(each for one in maps for each in _parameters(one, maps[0], material))
    return Identified(
        parameters,
        Result(
            tables=(_points_table(points),),
            figures=tuple(_figure(points, each) for each in maps),
            findings=tuple(Finding.of(each.estimate, {}) for each in parameters),
            notes=tuple(dict.fromkeys(notes)),
            conclusions=tuple(_conclusions(parameters)),
        ),
        settings=_settings(maps[0].found) if maps[0].quantity is FRICTION else {},
    )


def _mapped(quantity: Quantity, points: Sequence[Point], notes: list[str]) -> Mapped:
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
            mapped.lines[name] = {"friction": mean}
            at = f"{rate_here(float(speed.min()))} to {rate_here(float(speed.max()))}"
            notes.append(
                f"In the {name} direction {problem}: friction is that from {at}, and what of it is "
                "dry or viscous is not known."
            )
            continue
        mapped.lines[name] = {each.name: each for each in (line.coulomb, line.viscous)}
        notes.append(
            f"In the {name} direction {count} speeds show a straight line and no "
            f"Stribeck curve; more than {FEWEST_SPEEDS} are needed."
        )
    return mapped


def _stribeck_part(fit: DirectionFit) -> str:
    """Whether friction falls or rises as sliding sets in, in words."""
    if not fit.shows_stribeck_effect:
        return (
            "static friction is not told from Coulomb friction: there is no Stribeck part that "
            "these speeds could identify"
        )
    values = fit.fits[fit.preferred].values
    if values["static_torque"] < values["coulomb_torque"]:
        return "static friction lies below Coulomb friction: friction rises as sliding sets in"
    return "static friction lies above Coulomb friction, as of a Stribeck curve"


def _parameters(mapped: Mapped, first: Mapped, material: Material) -> Iterator[Parameter]:
    quantity = mapped.quantity
    for direction, estimates in mapped.found.items():
        for name, estimate in estimates.items():
            if mapped is not first and name.startswith("stribeck"):
                continue  # the same rate, from the same stretches
            unit, meaning = quantity.meanings[name]
            named = f"{quantity.called(name)}_{direction}"
            if name == "friction":
                named = f"friction_{direction}"
                if quantity is COEFFICIENT:
                    named = f"friction_coefficient_{direction}"
            one = _scaled(replace(estimate, name=named, unit=unit), quantity, material)
            prefix = "negative." if direction == "negative" else ""
            goes = quantity is FRICTION and name in KEYS and _goes(estimate, mapped.found)
            key = f"friction.load.{prefix}{KEYS[name]}" if goes else ""
            yield Parameter(one, f"{meaning}, {direction} direction.", "", key, ADVICE[name])


def _goes(estimate: Estimate, found: dict[str, dict[str, Estimate]]) -> bool:
    """A bench's curve needs both directions, and no negative friction."""
    both = all("coulomb_torque" in found.get(name, {}) for name in DIRECTIONS)
    return both and estimate.origin is Origin.MEASURED and estimate.value > 0.0


def _scaled(one: Estimate, quantity: Quantity, material: Material) -> Estimate:
    if one.origin is not Origin.MEASURED or one.name.startswith("stribeck"):
        return one
    data = material.trials[0]
    if material.bench.motor is not None and not data.trial.recording:
        one = with_systematic(one, material.bench, TORQUE_CONSTANT, one.value)
    one = with_scale(one, data, force_of(data))
    return with_scale(one, data, NORMAL_LOAD) if quantity is COEFFICIENT else one


def _settings(found: dict[str, dict[str, Estimate]]) -> dict[str, tuple[object, str, str]]:
    """All that a curve needs; of a straight line static friction is Coulomb's."""
    if not all("coulomb_torque" in found.get(name, {}) for name in DIRECTIONS):
        return {}
    told: dict[str, tuple[object, str, str]] = {
        "friction.load.model": ("stribeck", "", "friction of steady sliding")
    }
    for direction, estimates in found.items():
        prefix = "friction.load." + ("negative." if direction == "negative" else "")
        coulomb = estimates["coulomb_torque"].value
        for name in ("static_torque", "stribeck_velocity", "viscous_friction"):
            one = estimates.get(name)
            if one is not None and one.origin is Origin.MEASURED and one.value > 0.0:
                continue
            value = {"static_torque": coulomb, "stribeck_velocity": 1e-3}.get(name, 0.0)
            told[prefix + name] = (value, MEANINGS[name][0], "these points leave it open")
    return told


def _points_table(points: Sequence[Point]) -> Table:
    pressed = loaded(points)
    rows: list[dict[str, Cell]] = []
    for point in sorted(points, key=lambda point: point.own.rate.value):
        row: dict[str, Cell] = {
            "trial": point.trial,
            "rate": point.own.rate,
            "torque": point.own.torque,
        }
        rows.append(row | {"coefficient": point.coefficient} if pressed else row)
    columns = (
        Column("trial", "Trial", exact=True),
        Column("rate", "Rate", "rad/s", "deg/s"),
        Column("torque", "Friction torque", "N m"),
        *((Column("coefficient", "Friction coefficient"),) if pressed else ()),
    )
    return Table("stretches", "Steady stretches", columns, tuple(rows))


def _figure(points: Sequence[Point], mapped: Mapped) -> Figure:
    curves = []
    quantity = mapped.quantity
    for name, sign in DIRECTIONS.items():
        own = [point for point in points if point.sign == sign]
        if not own:
            continue
        rate = np.array([point.own.rate.value for point in own])
        label = f"{name} direction"
        curves.append(Curve.of(rate, [quantity.read(point) for point in own], label, name))
        sweep = np.geomspace(np.abs(rate).min(), np.abs(rate).max(), FINE)
        if name in mapped.fits:
            fit = mapped.fits[name]
            curve = np.asarray(stribeck(sweep, fit.fits[fit.preferred].values))
        elif "coulomb_torque" in mapped.lines.get(name, {}):
            told = mapped.lines[name]
            curve = told["coulomb_torque"].value + told["viscous_friction"].value * sweep
        else:
            continue
        curves.append(Curve(sign * sweep, sign * curve, f"{name}, fitted", name, "thin"))
    count, plain = len(points), quantity is FRICTION
    what = "Friction torque" if plain else "Friction coefficient"
    return Figure(
        key="map" if plain else "coefficient",
        title="Friction over rate" if plain else "Friction coefficient over rate",
        caption=f"{what} of {count} steady stretches with their 95 % intervals, and what "
        "was fitted to each direction, over the rates that were slid at.",
        alt=f"{what} over rate in both directions, with fitted curves.",
        panels=(Panel(Axis("Rate", "rad/s", "deg/s"), Axis(*quantity.axis), tuple(curves)),),
    )


def _conclusions(parameters: Sequence[Parameter]) -> Iterator[Conclusion]:
    by_name = {each.estimate.name: each.estimate for each in parameters}
    for name in DIRECTIONS:
        coulomb = by_name.get(f"coulomb_torque_{name}")
        viscous = by_name.get(f"viscous_friction_{name}")
        parts: list[str | Amount] = [f"Sliding steadily in the {name} direction, "]
        if coulomb is not None and viscous is not None:
            parts += ["Coulomb friction is ", Amount(coulomb, "N m")]
            parts += [" and viscous friction ", Amount(viscous, "N m s/rad")]
        elif (plain := by_name.get(f"friction_{name}")) is not None:
            parts += ["friction is ", Amount(plain, "N m")]
        for beginning, of in (("coulomb", " of fast sliding"), ("friction", "")):
            if (ratio := by_name.get(f"{beginning}_coefficient_{name}")) is not None:
                before = ", and " if len(parts) > 1 else ""
                parts += [f"{before}the coefficient of friction{of} is ", Amount(ratio, "")]
        if len(parts) > 1:
            yield Conclusion((*parts, "."))


METHOD = Method(
    name="friction_map",
    summary="friction over rate, from steady stretches of any recording",
    options=FrictionMapOptions,
    suits=_suits,
    identify=_identify,
)
