"""Friction over rate from the steady stretches of recordings without a map.

With more than six speeds, a Stribeck curve is fitted to each direction; with fewer, a straight
line; with one there is the friction at it. Static friction may lie below Coulomb friction. With a
recorded normal load the friction coefficient is fitted, too; if loads differ, only the coefficient.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from campaign.estimate import Estimate
from campaign.estimation.angle_dependence import OverATurn
from campaign.estimation.gate import admitted_together, mattering
from campaign.experiments.friction_map.curves import COEFFICIENT, FRICTION, Curves, fit_curves
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
"""Most trial numbers that a reason lists."""
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
"""Numbers with a key in a bench file."""


@dataclass(frozen=True)
class SteadyResult:
    """Result of steady stretches.

    Attributes:
        first: one of the trials, which states the uncertainty of torque and load.
        points, left: stretches in the map, and stretches that are not steady.
        maps: friction over rate, and its coefficient; empty if stretches show neither.
        parameters: parameters of all maps, in SI.
        left_out: trials and stretches left out, one reason per kind.
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
    parts: dict[str, dict[str, Estimate]] = {}
    for each in parameters:
        name, _, direction = each.estimate.name.rpartition("_")
        parts.setdefault(direction, {})[name] = replace(each.estimate, name=name)
    return parts


def sliding_of(trials: Sequence[TrialData], options: StretchOptions) -> SteadyResult:
    """Steady sliding of all trials of one bench together."""
    first = trials[0]
    every, held = points_of(trials, options.shortest, options.slowest)
    points = tuple(point for point in every if not point.unsteady)
    left = tuple(point for point in every if point.unsteady)
    lost = tuple(_left_out(trials, options, every))
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
    distinct = tuple(dict.fromkeys(notes))
    return SteadyResult(first, points, left, maps, parameters, distinct, lost)


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
    """Note on a torque that depends on the angle."""
    often = zip(held.amplitudes, ("once", "twice"), strict=False)
    sizes = " and ".join(f"by {torque_text(amplitude)} {times}" for amplitude, times in often)
    return (
        f"Within steady stretches the torque changes with the angle, as gravity does: {sizes} over "
        f"{angle_text(math.tau, '.4g')}, which is {100 * held.share:.3g} % of all that changes "
        "there. It is no friction and was taken off; its uncertainty is the part `angle` of what "
        "was found."
    )


def parameters_of(curves: Curves, first: Curves | None = None) -> Iterator[Parameter]:
    """Parameters of both directions, e.g. `coulomb_torque_positive`, with their keys in a bench.

    first: curves of another quantity and the same points, which have their Stribeck velocity.
    """
    quantity = curves.quantity
    largest = max(abs(curves.read(point).value) for point in curves.points)
    fastest = max(abs(point.speed) for point in curves.points)
    places, estimates_by_key = {}, {}
    matters: dict[str, float] = {}
    for direction, estimates in curves.found.items():
        for name, one in estimates.items():
            shape = name.startswith("stribeck")
            if shape and first not in (None, curves):
                continue
            key = f"{quantity.called(name)}_{direction}"
            places[key] = name, direction
            estimates_by_key[key] = replace(one, name=key, unit=quantity.meanings[name][0])
            matters |= {} if shape else {key: mattering(name, largest, fastest)}
    admitted = admitted_together(estimates_by_key, matters)
    for name in ("coulomb_torque", "static_torque"):
        admitted = with_offset(admitted, quantity.called(name))
    dry = [admitted.get(f"coulomb_torque_{direction}") for direction in DIRECTIONS]
    both = all(one is not None and is_value(one) for one in dry)
    for key, (name, direction) in places.items():
        prefix = "negative." if direction == "negative" else ""
        has_key = quantity is FRICTION and name in KEYS and both
        place = f"friction.load.{prefix}{name}" if has_key else ""
        meaning = f"{quantity.meanings[name][1]}, {direction} direction."
        yield Parameter(admitted[key], meaning, "", place, ADVICE[name])
