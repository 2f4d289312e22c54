"""Friction over rate, from wherever any recording slides steadily, in both directions.

Where six speeds or more were slid at, a Stribeck curve is fitted to each direction; where there are
fewer, a straight line. Static friction that lies below Coulomb friction is as welcome as any other.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from pydantic import Field

from campaign.archive import ArchivedTrial
from campaign.channels import DRIVE_TORQUE, JOINT_TORQUE, RELATIVE_RATE
from campaign.estimate import Estimate, Origin
from campaign.experiments.shared.elsewhere import with_scale
from campaign.experiments.shared.systematic import TORQUE_CONSTANT, with_systematic
from campaign.identification.friction_line import friction_line
from campaign.identification.steady_sliding import SteadySliding, steady_sliding
from campaign.identification.steady_stretches import SHORTEST_TIME, steady_stretches
from campaign.identification.stribeck import stribeck
from campaign.identification.velocity_map import DirectionFit, direction_estimates, fit_direction
from campaign.identifying.method import Identified, Material, Method, Parameter
from campaign.options import Options
from campaign.result import (
    Amount,
    Array,
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
from campaign.units import Time

DIRECTIONS = {"positive": 1.0, "negative": -1.0}
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
}
ADVICE = {
    "coulomb_torque": "slide at more speeds",
    "static_torque": "slide more slowly: below a tenth of the Stribeck velocity",
    "stribeck_velocity": "slide at more speeds around it",
    "stribeck_exponent": "slide at more speeds around the Stribeck velocity",
    "viscous_friction": "slide at more, and further apart, speeds",
}


class FrictionMapOptions(Options):
    """Options of a friction map."""

    shortest: Time = Field(default=SHORTEST_TIME, gt=0)
    """Shortest steady stretch that is read, where a trial names no windows."""


@dataclass(frozen=True)
class Point:
    """One steady stretch."""

    trial: int
    own: SteadySliding

    @property
    def sign(self) -> float:
        """1, or -1 in the negative direction."""
        return 1.0 if self.own.rate.value > 0 else -1.0


def _suits(trials: Sequence[ArchivedTrial]) -> tuple[Sequence[ArchivedTrial], str]:
    found = []
    for each in trials:
        names = each.channel_names()
        if RELATIVE_RATE in names and names & {DRIVE_TORQUE, JOINT_TORQUE}:
            found.append(each)
    return found, "" if found else f"no trial has {RELATIVE_RATE} and {DRIVE_TORQUE}"


def _identify(material: Material, options: FrictionMapOptions) -> Identified:
    points = [
        point for trial in material.trials for point in _points(trial, material, options.shortest)
    ]
    if not points:
        raise ValueError("nowhere does the axis slide steadily")
    fits: dict[str, DirectionFit] = {}
    lines: dict[str, dict[str, Estimate]] = {}
    notes: list[str] = []
    for name, sign in DIRECTIONS.items():
        own = [point for point in points if point.sign == sign]
        if not own:
            notes.append(f"The axis never slides steadily in the {name} direction.")
            continue
        speed = np.array([sign * point.own.rate.value for point in own])
        torque = np.array([sign * point.own.torque.value for point in own])
        error = np.array([point.own.torque.standard_error or 0.0 for point in own])
        place = _places(speed)
        if len(np.unique(place)) > FEWEST_SPEEDS:
            fits[name] = fit_direction(speed, torque, error, place)
            continue
        try:
            line = friction_line(speed, torque)
        except ValueError as problem:
            notes.append(f"In the {name} direction: {problem}.")
            continue
        told = (line.coulomb, line.viscous)
        lines[name] = {each.name: each for each in told}
        notes.append(
            f"In the {name} direction {len(np.unique(place))} speeds show a straight line and no "
            f"Stribeck curve; more than {FEWEST_SPEEDS} are needed."
        )
    if not fits and not lines:
        raise ValueError("; ".join(note.rstrip(".") for note in notes))
    found = {name: direction_estimates(fit, fit.preferred) for name, fit in fits.items()} | lines
    parameters = tuple(_parameters(found, material))
    return Identified(
        parameters,
        Result(
            tables=(_points_table(points),),
            figures=(_figure(points, fits, lines),),
            findings=tuple(Finding.of(each.estimate, {}) for each in parameters),
            notes=tuple(notes),
            conclusions=tuple(_conclusions(parameters)),
        ),
        settings=_settings(found),
    )


def _points(trial: ArchivedTrial, material: Material, shortest: float) -> Iterator[Point]:
    recording = trial.recording()
    joint = JOINT_TORQUE in recording.channels
    torque = recording[JOINT_TORQUE if joint else DRIVE_TORQUE]
    rate = recording[RELATIVE_RATE]
    inertia = 0.0 if joint else material.bench.axis.inertia
    per_second = trial.trial.task.sample_rate
    named = [w for w in trial.trial.windows if w.name in DIRECTIONS]
    stretches = [(round(w.start * per_second), round(w.stop * per_second)) for w in named]
    if not stretches:
        steady = steady_stretches(rate, per_second, torque, shortest, driven=False)
        stretches = [(each.first, each.stop) for each in steady]
    for first, stop in stretches:
        there = np.flatnonzero(np.isfinite(rate[first:stop] + torque[first:stop])) + first
        if len(there) < 20:
            continue
        own = steady_sliding(recording.time[there], rate[there], torque[there], None, inertia)
        if own.rate.value != 0.0:
            yield Point(trial.trial.number, own)


def _places(speed: Array) -> Array:
    """Which speeds are one, but for what a loop makes of them: within 2 % of each other."""
    order = np.argsort(speed)
    jumps = np.diff(np.log(speed[order])) > 0.02
    place = np.empty(len(speed))
    place[order] = np.concatenate([[0], np.cumsum(jumps)])
    return place


def _parameters(found: dict[str, dict[str, Estimate]], material: Material) -> Iterator[Parameter]:
    for direction, estimates in found.items():
        for name, estimate in estimates.items():
            unit, meaning = MEANINGS[name]
            prefix = "negative." if direction == "negative" else ""
            one = _scaled(replace(estimate, name=f"{name}_{direction}", unit=unit), material)
            key = f"friction.load.{prefix}{KEYS[name]}" if _goes(estimate, found) else ""
            yield Parameter(one, f"{meaning}, {direction} direction.", "", key, ADVICE[name])


def _goes(estimate: Estimate, found: dict[str, dict[str, Estimate]]) -> bool:
    """A bench's curve needs both directions, and no negative friction."""
    both = all(name in found for name in DIRECTIONS)
    return both and estimate.origin is Origin.MEASURED and estimate.value > 0.0


def _scaled(one: Estimate, material: Material) -> Estimate:
    if one.origin is not Origin.MEASURED or not one.unit.startswith("N"):
        return one
    data = material.trials[0]
    if material.bench.motor is not None and not data.trial.recording:
        one = with_systematic(one, material.bench, TORQUE_CONSTANT, one.value)
    return with_scale(one, data, DRIVE_TORQUE)


def _settings(found: dict[str, dict[str, Estimate]]) -> dict[str, tuple[object, str, str]]:
    """All that a curve needs; of a straight line static friction is Coulomb's."""
    if not all(name in found for name in DIRECTIONS):
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
    rows: tuple[dict[str, Cell], ...] = tuple(
        {"trial": point.trial, "rate": point.own.rate, "torque": point.own.torque}
        for point in sorted(points, key=lambda point: point.own.rate.value)
    )
    columns = (
        Column("trial", "Trial", exact=True),
        Column("rate", "Rate", "rad/s", "deg/s"),
        Column("torque", "Friction torque", "N m"),
    )
    return Table("stretches", "Steady stretches", columns, rows)


def _figure(
    points: Sequence[Point],
    fits: dict[str, DirectionFit],
    lines: dict[str, dict[str, Estimate]],
) -> Figure:
    curves = []
    for name, sign in DIRECTIONS.items():
        own = [point for point in points if point.sign == sign]
        if not own:
            continue
        rate = np.array([point.own.rate.value for point in own])
        label = f"{name} direction"
        curves.append(Curve.of(rate, [point.own.torque for point in own], label, name))
        sweep = np.geomspace(np.abs(rate).min(), np.abs(rate).max(), FINE)
        if name in fits:
            values = fits[name].fits[fits[name].preferred].values
            curve = np.asarray(stribeck(sweep, values))
        elif name in lines:
            told = lines[name]
            curve = told["coulomb_torque"].value + told["viscous_friction"].value * sweep
        else:
            continue
        curves.append(Curve(sign * sweep, sign * curve, f"{name}, fitted", name, "thin"))
    count = len(points)
    return Figure(
        key="map",
        title="Friction over rate",
        caption=f"Friction torque of {count} steady stretches with their 95 % intervals, and what "
        "was fitted to each direction, over the rates that were slid at.",
        alt="Friction torque over rate in both directions, with fitted curves.",
        panels=(
            Panel(Axis("Rate", "rad/s", "deg/s"), Axis("Torque", "N m", "N m"), tuple(curves)),
        ),
    )


def _conclusions(parameters: Sequence[Parameter]) -> Iterator[Conclusion]:
    by_name = {each.estimate.name: each.estimate for each in parameters}
    for name in DIRECTIONS:
        coulomb = by_name.get(f"coulomb_torque_{name}")
        viscous = by_name.get(f"viscous_friction_{name}")
        if coulomb is None or viscous is None:
            continue
        yield Conclusion(
            (
                f"Sliding steadily in the {name} direction, Coulomb friction is ",
                Amount(coulomb, "N m"),
                " and viscous friction ",
                Amount(viscous, "N m s/rad"),
                ".",
            )
        )


METHOD = Method(
    name="friction_map",
    summary="friction over rate, from steady stretches of any recording",
    options=FrictionMapOptions,
    suits=_suits,
    identify=_identify,
)
