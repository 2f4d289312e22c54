"""Friction over rate of recordings that are no map: what their steady stretches show.

Of more than six speeds, a Stribeck curve is fitted to each direction; of fewer, a straight line; of
one there is the friction at it. Static friction that lies below Coulomb friction is as welcome as
any other. Where the normal load was recorded, the same is said of the friction coefficient; of it
alone where loads differ.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from campaign.channels import DRIVE_TORQUE, NORMAL_LOAD
from campaign.estimate import Estimate, Origin
from campaign.estimation.gate import admitted_together, mattering
from campaign.estimation.intervals import shifted_by
from campaign.estimation.over_a_turn import OverATurn
from campaign.experiments.friction_map.over_rate import (
    COEFFICIENT,
    FRICTION,
    Mapped,
    Quantity,
    mapped_over_rate,
    with_doubts,
)
from campaign.experiments.friction_map.runs import DIRECTIONS
from campaign.experiments.friction_map.stretches import (
    Point,
    StretchOptions,
    force_of,
    goes_along,
    loaded,
    loads_alike,
    points_of,
    slower,
)
from campaign.experiments.interface import TrialData, bench_of
from campaign.experiments.shared.directions import with_offset
from campaign.experiments.shared.imported_scale import with_scale
from campaign.experiments.shared.systematic import (
    INERTIA,
    SOURCES,
    TORQUE_CONSTANT,
    with_systematic,
)
from campaign.parameter import Parameter, is_value
from campaign.reason import Cause, Reason

SHOWN = 8
"""Numbers of trials that a reason lists."""
NO_STRETCH = Cause(
    "no steady stretch",
    "{count} of {total} trials ({numbers}) have no steady stretch, and are not in the map",
)
UNSTEADY = Cause("unsteady stretches", "{count} of {total} stretches are left out, for {why}")
TOO_SLOW = Cause(
    "slow stretches",
    "{count} steady stretches below 3 % of the fastest rate of their trial count as standstill, "
    "and are not in the map (the option `slowest` says which rate is standstill)",
)
ADVICE = {
    "coulomb_torque": "slide at more speeds",
    "static_torque": "slide more slowly: below a tenth of the Stribeck velocity",
    "stribeck_velocity": "slide at more speeds around it",
    "stribeck_exponent": "slide at more speeds around the Stribeck velocity",
    "viscous_friction": "slide at more, and further apart, speeds",
    "friction": "slide at several speeds, further apart",
}
KEYS = {*ADVICE} - {"friction"}
"""Numbers that a bench has a place for."""


@dataclass(frozen=True)
class Sliding:
    """What steady stretches show.

    Attributes:
        first: one of the trials, which says how well torque and load are known.
        points, left: stretches that are in the map, and those that are not steady.
        maps: friction over rate, and its coefficient; empty where stretches show neither.
        parameters: of all maps; in SI.
        left_out: trials and stretches, one reason for each kind.
    """

    first: TrialData
    points: tuple[Point, ...]
    left: tuple[Point, ...]
    maps: tuple[Mapped, ...] = ()
    parameters: tuple[Parameter, ...] = ()
    notes: tuple[str, ...] = ()
    left_out: tuple[Reason, ...] = ()

    @property
    def found(self) -> dict[str, dict[str, Estimate]]:
        """Parameters by direction, then by name."""
        told: dict[str, dict[str, Estimate]] = {}
        for each in self.parameters:
            name, _, way = each.estimate.name.rpartition("_")
            told.setdefault(way, {})[name] = replace(each.estimate, name=name)
        return told


def sliding_of(trials: Sequence[TrialData], options: StretchOptions) -> Sliding:
    """Of all trials together, which are of one bench."""
    first, bench = trials[0], bench_of(trials[0].trial)
    found, held = points_of(trials, bench, options.shortest, options.slowest)
    points = tuple(point for point in found if not point.own.unsteady)
    left = tuple(point for point in found if point.own.unsteady)
    lost = tuple(_left_out(trials, options, found))
    if not points:
        return Sliding(first, points, left, left_out=lost)
    notes = [] if held is None else [_over_a_turn(held)]
    quantities = [FRICTION] if loads_alike(points) else []
    quantities += [COEFFICIENT] if loaded(points) else []
    if not quantities:
        notes.append("Normal loads differ, and some stretches have none.")
    elif FRICTION not in quantities:
        notes.append(
            "Normal loads differ between stretches: friction over rate is told over the load only."
        )
    maps = tuple(with_doubts(mapped_over_rate(each, points, notes), points) for each in quantities)
    if goes_along(points):
        notes.append(
            "Friction goes with the motion nearly everywhere, and cannot: the column of the force, "
            "or that of the motion, has the other sign, as of a sensor on the part that rests. "
            "In the mapping `sign = -1` turns it round."
        )
    parameters = tuple(each for one in maps for each in _parameters(one, maps[0], points, first))
    told = tuple(dict.fromkeys(notes))
    return Sliding(first, points, left, maps, parameters, told, lost)


def _left_out(
    trials: Sequence[TrialData], options: StretchOptions, found: Sequence[Point]
) -> Iterator[Reason]:
    """Trials and stretches that are not in the map, by reason."""
    used = {point.trial for point in found}
    without = [each.trial.number for each in trials if each.trial.number not in used]
    if without:
        numbers = ", ".join(map(str, without[:SHOWN])) + (" ..." if len(without) > SHOWN else "")
        yield NO_STRETCH(count=len(without), total=len(trials), numbers=numbers)
    unsteady = Counter(point.own.unsteady.code for point in found if point.own.unsteady)
    for code, stretches in unsteady.items():
        yield UNSTEADY(count=stretches, total=len(found), why=code)
    if options.slowest is None:
        still = slower(trials, bench_of(trials[0].trial), options.shortest, found)
        if still:
            yield TOO_SLOW(count=still)


def _over_a_turn(held: OverATurn) -> str:
    """Of a torque that follows from the angle, in words."""
    times = ("once", "twice")
    told = " and ".join(
        f"by {amplitude:.3g} N·m {times[k]} a turn" for k, amplitude in enumerate(held.amplitudes)
    )
    return (
        f"Within steady stretches the torque changes with the angle, as gravity does: {told}, "
        f"which is {100 * held.share:.3g} % of all that changes there. It is no friction and was "
        "taken off; its uncertainty is the part `angle` of what was found."
    )


@dataclass(frozen=True)
class Named:
    """Parameters of both directions by name, e.g. `coulomb_torque_positive`.

    `places`: the name that each has in a direction, and which direction it is.
    """

    quantity: Quantity
    found: Mapping[str, Estimate]
    places: Mapping[str, tuple[str, str]]

    @classmethod
    def of(cls, quantity: Quantity, found: Mapping[str, Mapping[str, Estimate]]) -> Named:
        named, places = {}, {}
        for way, estimates in found.items():
            for name, one in estimates.items():
                key = f"{quantity.called(name)}_{way}"
                if name == "friction" and quantity is COEFFICIENT:
                    key = f"friction_coefficient_{way}"
                places[key] = name, way
                named[key] = replace(one, name=key, unit=quantity.meanings[name][0])
        return cls(quantity, named, places)

    def parameters(self) -> Iterator[Parameter]:
        """With their places in a bench file."""
        told = dict(self.found)
        for name in ("coulomb_torque", "static_torque"):
            told = with_offset(told, self.quantity.called(name))
        dry = [told.get(f"coulomb_torque_{way}") for way in DIRECTIONS]
        both = all(one is not None and is_value(one) for one in dry)
        for key, (name, way) in self.places.items():
            prefix = "negative." if way == "negative" else ""
            goes = self.quantity is FRICTION and name in KEYS and both
            place = f"friction.load.{prefix}{name}" if goes else ""
            meaning = f"{self.quantity.meanings[name][1]}, {way} direction."
            yield Parameter(told[key], meaning, "", place, ADVICE[name])


def _parameters(
    mapped: Mapped, first: Mapped, points: Sequence[Point], data: TrialData
) -> Iterator[Parameter]:
    quantity = mapped.quantity
    named = Named.of(
        quantity,
        {
            way: {
                name: one
                for name, one in estimates.items()
                if mapped is first or not name.startswith("stribeck")  # of the same stretches
            }
            for way, estimates in mapped.found.items()
        },
    )
    whole = {key: scaled(one, quantity, data) for key, one in named.found.items()}
    largest = max(abs(quantity.read(point).value) for point in points)
    fastest = max(point.speed for point in points)
    matters = {
        key: mattering(name, largest, fastest)
        for key, (name, _) in named.places.items()
        if not name.startswith("stribeck")
    }
    return replace(named, found=admitted_together(whole, matters)).parameters()


def scaled(one: Estimate, quantity: Quantity, data: TrialData) -> Estimate:
    """With what no stretch shows: constants of the torque and of the load, and unknown inertia."""
    if one.origin is not Origin.MEASURED or one.name.startswith("stribeck"):
        return one
    bench, force = bench_of(data.trial), force_of(data)
    if bench.motor is not None and not data.trial.recording:
        one = with_systematic(one, bench, TORQUE_CONSTANT, one.value)
    one = with_scale(one, data, force)
    if force == DRIVE_TORQUE and bench.axis.inertia is None:
        one = shifted_by(one, SOURCES[INERTIA], None)
    return with_scale(one, data, NORMAL_LOAD) if quantity is COEFFICIENT else one
