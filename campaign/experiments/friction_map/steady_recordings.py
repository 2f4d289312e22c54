"""Friction over rate from the steady stretches of recordings without a map.

Of more than six speeds, a Stribeck curve is fitted to each direction; of fewer, a straight line; of
one there is the friction at it. Static friction that lies below Coulomb friction is as welcome as
any other. Where the normal load was recorded, the same is said of the friction coefficient; of it
alone where loads differ.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from campaign.estimate import Estimate
from campaign.estimation.angle_dependence import OverATurn
from campaign.estimation.gate import admitted_together, mattering
from campaign.experiments.friction_map.curves import (
    COEFFICIENT,
    FRICTION,
    Curves,
    fit_curves,
)
from campaign.experiments.friction_map.points import Point
from campaign.experiments.friction_map.runs import DIRECTIONS
from campaign.experiments.friction_map.stretches import (
    StretchOptions,
    drives_motion,
    force_of,
    loaded,
    loads_alike,
    points_of,
    slower,
)
from campaign.experiments.interface import TrialData
from campaign.experiments.shared.directions import with_offset
from campaign.parameter import Parameter, is_value
from campaign.reason import Cause, Reason
from campaign.units import angle_text, torque_text

SHOWN = 8
"""Numbers of trials that a reason lists."""
NO_STRETCH = Cause(
    "no steady stretch",
    "{count} of {total} trials ({numbers}) have no steady stretch, and are not in the map",
)
UNSTEADY = Cause("unsteady stretches", "{count} of {total} stretches are left out, for {why}")
TOO_SLOW = Cause(
    "slow stretches",
    "{count} steady stretches below 3 % of their trial's fastest rate count as standstill (option "
    "`slowest`), and are not in the map",
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
class SteadyResult:
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
    maps: tuple[Curves, ...] = ()
    parameters: tuple[Parameter, ...] = ()
    notes: tuple[str, ...] = ()
    left_out: tuple[Reason, ...] = ()

    @property
    def found(self) -> dict[str, dict[str, Estimate]]:
        """Parameters by direction, then by name."""
        return by_direction(self.parameters)


def by_direction(parameters: Iterable[Parameter]) -> dict[str, dict[str, Estimate]]:
    """Parameters of both directions, e.g. `coulomb_torque_positive`, by direction and then name."""
    told: dict[str, dict[str, Estimate]] = {}
    for each in parameters:
        name, _, way = each.estimate.name.rpartition("_")
        told.setdefault(way, {})[name] = replace(each.estimate, name=name)
    return told


def sliding_of(trials: Sequence[TrialData], options: StretchOptions) -> SteadyResult:
    """Of all trials together, which are of one bench."""
    first = trials[0]
    found, held = points_of(trials, options.shortest, options.slowest)
    points = tuple(point for point in found if not point.unsteady)
    left = tuple(point for point in found if point.unsteady)
    lost = tuple(_left_out(trials, options, found))
    if not points:
        return SteadyResult(first, points, left, left_out=lost)
    notes = [] if held is None else [_over_a_turn(held)]
    quantities = [FRICTION] if loads_alike(points) else []
    quantities += [COEFFICIENT] if loaded(points) else []
    if not quantities:
        notes.append("Normal loads differ, and some stretches have none.")
    elif FRICTION not in quantities:
        notes.append(
            "Normal loads differ between stretches: friction over rate is reported over the load "
            "only."
        )
    maps = tuple(fit_curves(points, first, each, force_of(first)) for each in quantities)
    notes += (note for each in maps for note in each.notes)
    if drives_motion(points):
        notes.append(
            "Friction acts with the motion nearly everywhere, which is impossible. Force or motion "
            "has the wrong sign, as of a sensor on the part that rests: in the mapping "
            "`sign = -1` reverses it."
        )
    parameters = tuple(each for one in maps for each in parameters_of(one, maps[0]))
    told = tuple(dict.fromkeys(notes))
    return SteadyResult(first, points, left, maps, parameters, told, lost)


def _left_out(
    trials: Sequence[TrialData], options: StretchOptions, found: Sequence[Point]
) -> Iterator[Reason]:
    """Trials and stretches that are not in the map, by reason."""
    used = {point.trial for point in found}
    without = [each.trial.number for each in trials if each.trial.number not in used]
    if without:
        numbers = ", ".join(map(str, without[:SHOWN])) + (" ..." if len(without) > SHOWN else "")
        yield NO_STRETCH(count=len(without), total=len(trials), numbers=numbers)
    unsteady = Counter(point.unsteady.code for point in found if point.unsteady)
    for code, stretches in unsteady.items():
        yield UNSTEADY(count=stretches, total=len(found), why=code)
    if options.slowest is None:
        still = slower(trials, options.shortest, found)
        if still:
            yield TOO_SLOW(count=still)


def _over_a_turn(held: OverATurn) -> str:
    """Of a torque that follows from the angle, in words."""
    often = zip(held.amplitudes, ("once", "twice"), strict=False)
    told = " and ".join(f"by {torque_text(amplitude)} {times}" for amplitude, times in often)
    return (
        f"Within steady stretches the torque changes with the angle, as gravity does: {told} over "
        f"{angle_text(math.tau, '.4g')}, which is {100 * held.share:.3g} % of all that changes "
        "there. It is no friction and was taken off; its uncertainty is the part `angle` of what "
        "was found."
    )


def parameters_of(curves: Curves, first: Curves | None = None) -> Iterator[Parameter]:
    """Parameters of both directions, e.g. `coulomb_torque_positive`, with their places in a bench.

    first: curves of another quantity and the same points, which have their Stribeck velocity.
    """
    quantity = curves.quantity
    largest = max(abs(curves.read(point).value) for point in curves.points)
    fastest = max(abs(point.speed) for point in curves.points)
    places, found = {}, {}
    matters: dict[str, float] = {}
    for way, estimates in curves.found.items():
        for name, one in estimates.items():
            shape = name.startswith("stribeck")
            if shape and first not in (None, curves):
                continue
            key = f"{quantity.called(name)}_{way}"
            places[key] = name, way
            found[key] = replace(one, name=key, unit=quantity.meanings[name][0])
            matters |= {} if shape else {key: mattering(name, largest, fastest)}
    told = admitted_together(found, matters)
    for name in ("coulomb_torque", "static_torque"):
        told = with_offset(told, quantity.called(name))
    dry = [told.get(f"coulomb_torque_{way}") for way in DIRECTIONS]
    both = all(one is not None and is_value(one) for one in dry)
    for key, (name, way) in places.items():
        prefix = "negative." if way == "negative" else ""
        goes = quantity is FRICTION and name in KEYS and both
        place = f"friction.load.{prefix}{name}" if goes else ""
        meaning = f"{quantity.meanings[name][1]}, {way} direction."
        yield Parameter(told[key], meaning, "", place, ADVICE[name])
