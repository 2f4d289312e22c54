"""Friction over rate as parameters: of the runs of a map, or of wherever a recording is steady.

Runs of a map are analysed as in their report. In other recordings steady stretches are found. Of
more than six speeds, a Stribeck curve is fitted to each direction; of fewer, a straight line; of
one there is the friction at it. Static friction that lies below Coulomb friction is as welcome as
any other. Where the normal load was recorded, the same is said of the friction coefficient; of it
alone where loads differ.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from pydantic import Field

from campaign.channels import DRIVE_TORQUE, JOINT_TORQUE, NORMAL_LOAD, RELATIVE_RATE
from campaign.estimate import Estimate, Origin
from campaign.estimation.gate import admitted_together, mattering
from campaign.estimation.over_a_turn import OverATurn
from campaign.estimation.steady_stretches import SHORTEST_TIME
from campaign.estimation.stribeck import stribeck
from campaign.experiments.friction_map.conclusions import map_conclusions
from campaign.experiments.friction_map.map_result import one_map
from campaign.experiments.friction_map.over_rate import (
    COEFFICIENT,
    FRICTION,
    MEANINGS,
    Mapped,
    Quantity,
    mapped_over_rate,
    with_doubts,
)
from campaign.experiments.friction_map.runs import REQUIRED
from campaign.experiments.friction_map.stretches import (
    DIRECTIONS,
    Point,
    force_of,
    goes_along,
    loaded,
    loads_alike,
    points_of,
    slower,
)
from campaign.experiments.interface import EMPTY, Model, TestData, TrialData
from campaign.experiments.shared.conclusion_parts import Settings, count
from campaign.experiments.shared.directions import with_offset
from campaign.experiments.shared.imported_scale import with_scale
from campaign.experiments.shared.systematic import TORQUE_CONSTANT, with_systematic
from campaign.options import Options
from campaign.parameter import Identified, Parameter, is_value
from campaign.reason import Cause, Reason
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
from campaign.units import AngularRate, Time

FINE = 100
"""Rates at which a fitted curve is drawn."""
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
    "and are not in the map (`--set friction_map.slowest=RATE`: slower than that is standstill)",
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


class FrictionMapOptions(Options):
    """Options of a friction map."""

    shortest: Time = Field(default=SHORTEST_TIME, gt=0)
    """Shortest steady stretch that is read, where a trial names no windows."""
    slowest: AngularRate | None = Field(default=None, ge=0)
    """Rate up to which the axis counts as standing still; absent: 3 % of the fastest of its trial.
    A sweep over decades of speed in one trial needs less."""


def _suits(trials: Sequence[TrialData]) -> tuple[Sequence[TrialData], str]:
    """The runs of maps; without any, all trials with a rate and a torque."""
    found = [each for each in trials if is_run(each)]
    for each in () if found else trials:
        names = each.channel_names()
        if RELATIVE_RATE in names and names & {DRIVE_TORQUE, JOINT_TORQUE}:
            found.append(each)
    why = f"no trial has {RELATIVE_RATE}, and {DRIVE_TORQUE} or {JOINT_TORQUE}"
    return found, "" if found else why


def is_run(data: TrialData) -> bool:
    """Whether a trial is a run of a map, with its speed and the windows of its directions."""
    trial = data.trial
    windows = DIRECTIONS.keys() & {window.name for window in trial.windows}
    return bool(windows) and "speed" in trial.point and REQUIRED.keys() <= data.channel_names()


def identified(data: TestData) -> Result:
    """Friction over rate, by direction. Raises ValueError where there is none."""
    runs = tuple(each for each in data.completed() if is_run(each))
    result, fits = one_map(runs) if runs else (EMPTY, None)
    if fits is None:
        return _of_stretches(data)
    found = {way: fits.estimates(fit.preferred)[way] for way, fit in fits.fits.items()}
    parameters = tuple(_Named.of(FRICTION, found).parameters())
    speeds = [point.speed for point in fits.points]
    return replace(
        result,
        conclusions=map_conclusions(result.findings, speeds, Settings({})),
        identified=Identified(parameters, settings=_settings(found, parameters)),
    )


def _of_stretches(data: TestData) -> Result:
    options: FrictionMapOptions = data.model
    found, held = points_of(data.trials, data.bench, options.shortest, options.slowest)
    points = [point for point in found if not point.own.unsteady]
    left = [point for point in found if point.own.unsteady]
    lost = tuple(_left_out(data, options, found))
    if not points:
        raise ValueError("; ".join(["nowhere does the axis slide steadily", *map(str, lost)]))
    notes = [] if held is None else [_over_a_turn(held)]
    quantities = [FRICTION] if loads_alike(points) else []
    quantities += [COEFFICIENT] if loaded(points) else []
    if not quantities:
        raise ValueError("normal loads differ, and some stretches have none")
    if FRICTION not in quantities:
        notes.append(
            "Normal loads differ between stretches: friction over rate is told over the load only."
        )
    maps = [with_doubts(mapped_over_rate(each, points, notes), points) for each in quantities]
    if not any(each.fits or each.lines for each in maps):
        raise ValueError("; ".join(note.rstrip(".") for note in notes))
    if goes_along(points):
        notes.append(
            "Friction goes with the motion nearly everywhere, and cannot: the column of the force, "
            "or that of the motion, has the other sign, as of a sensor on the part that rests. "
            "In the mapping `sign = -1` turns it round."
        )
    parameters = tuple(each for one in maps for each in _parameters(one, maps[0], points, data))
    return Result(
        tables=(_points_table(points, left),),
        figures=tuple(_figure(points, each) for each in maps),
        findings=tuple(Finding.of(each.estimate, {}) for each in parameters),
        notes=tuple(dict.fromkeys(notes)),
        conclusions=tuple(_conclusions(parameters)),
        identified=Identified(
            parameters,
            settings=_settings(maps[0].found, parameters) if maps[0].quantity is FRICTION else {},
            left_out=lost,
        ),
    )


def _left_out(
    data: TestData, options: FrictionMapOptions, found: Sequence[Point]
) -> Iterator[Reason]:
    """Trials and stretches that are not in the map, by reason."""
    used = {point.trial for point in found}
    without = [each.trial.number for each in data.trials if each.trial.number not in used]
    if without:
        numbers = ", ".join(map(str, without[:SHOWN])) + (" ..." if len(without) > SHOWN else "")
        yield NO_STRETCH(count=len(without), total=len(data.trials), numbers=numbers)
    unsteady = Counter(point.own.unsteady.code for point in found if point.own.unsteady)
    for code, stretches in unsteady.items():
        yield UNSTEADY(count=stretches, total=len(found), why=code)
    if options.slowest is None:
        still = slower(data.trials, data.bench, options.shortest, found)
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
class _Named:
    """Parameters of both directions by name, e.g. `coulomb_torque_positive`.

    `places`: the name that each has in a direction, and which direction it is.
    """

    quantity: Quantity
    found: Mapping[str, Estimate]
    places: Mapping[str, tuple[str, str]]

    @classmethod
    def of(cls, quantity: Quantity, found: Mapping[str, Mapping[str, Estimate]]) -> _Named:
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
    mapped: Mapped, first: Mapped, points: Sequence[Point], data: TestData
) -> Iterator[Parameter]:
    quantity = mapped.quantity
    named = _Named.of(
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
    scaled = {key: _scaled(one, quantity, data) for key, one in named.found.items()}
    largest = max(abs(quantity.read(point).value) for point in points)
    fastest = max(point.speed for point in points)
    matters = {
        key: mattering(name, largest, fastest)
        for key, (name, _) in named.places.items()
        if not name.startswith("stribeck")
    }
    return replace(named, found=admitted_together(scaled, matters)).parameters()


def _scaled(one: Estimate, quantity: Quantity, data: TestData) -> Estimate:
    if one.origin is not Origin.MEASURED or one.name.startswith("stribeck"):
        return one
    first = data.trials[0]
    if data.bench.motor is not None and not first.trial.recording:
        one = with_systematic(one, data.bench, TORQUE_CONSTANT, one.value)
    one = with_scale(one, first, force_of(first))
    return with_scale(one, first, NORMAL_LOAD) if quantity is COEFFICIENT else one


def _settings(
    found: dict[str, dict[str, Estimate]], parameters: Sequence[Parameter]
) -> dict[str, tuple[object, str, str]]:
    """All that a curve needs besides: what is not measured is that of the fitted curve.

    So that nothing stands beside a measured number that the data contradict.
    """
    keys = {each.bench for each in parameters if each.bench}
    if not keys:
        return {}
    told: dict[str, tuple[object, str, str]] = {
        "friction.load.model": ("stribeck", "", "friction of steady sliding")
    }
    for direction, estimates in found.items():
        prefix = "friction.load." + ("negative." if direction == "negative" else "")
        line = {"static_torque": estimates["coulomb_torque"].value, "stribeck_velocity": 1e-3}
        fitted = {name: one.value for name, one in estimates.items() if one.kind == "number"}
        for name, value in ({"viscous_friction": 0.0} | line | fitted).items():
            if name in KEYS and prefix + name not in keys:
                told[prefix + name] = (max(value, 0.0), MEANINGS[name][0], "of the fitted curve")
    return told


def _points_table(points: Sequence[Point], left: Sequence[Point]) -> Table:
    pressed = loaded(points)
    rows: list[dict[str, Cell]] = []
    for point in sorted((*points, *left), key=lambda point: point.own.rate.value):
        row: dict[str, Cell] = {
            "trial": point.trial,
            "rate": point.own.rate,
            "torque": point.own.torque,
            "left_out": str(point.own.unsteady),
        }
        rows.append(row | {"coefficient": point.coefficient} if pressed else row)
    columns = (
        Column("trial", "Trial", exact=True),
        Column("rate", "Rate", "rad/s", "deg/s"),
        Column("torque", "Friction torque", "N m"),
        *((Column("coefficient", "Friction coefficient"),) if pressed else ()),
        *((Column("left_out", "Left out"),) if left else ()),
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
    shown = count(len(points), "steady stretch", "steady stretches")
    plain = quantity is FRICTION
    what = "Friction torque" if plain else "Friction coefficient"
    return Figure(
        key="map" if plain else "coefficient",
        title="Friction over rate" if plain else "Friction coefficient over rate",
        caption=f"{what} of {shown} with their 95 % intervals, and what "
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


MODEL = Model(
    name="friction_map",
    summary="friction over rate, of a map or of steady stretches of any recording",
    options=FrictionMapOptions,
    suits=_suits,
)
