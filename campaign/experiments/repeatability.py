"""Repeatability of the friction-velocity map: how far its parameters scatter from set to set.

The whole map is measured several times, on different days or simply again. Each map is fitted on
its own, in both directions; every parameter then has a mean and a relative standard deviation over
all sets and directions (Table 4.4 and section 4.3.2). The thesis counts the two directions of one
map as two sets, so that three maps are sets 1 to 6.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from campaign.experiments.common import failures_note
from campaign.experiments.interface import Experiment, TestData, TrialData
from campaign.experiments.velocity_map import (
    DIRECTIONS,
    REQUIRED,
    SYMBOLS,
    DirectionFit,
    MapPoint,
    VelocityMapOptions,
    fit_direction,
    map_points,
    map_trials,
)
from campaign.identification.velocity_map import PARAMETERS, UNITS
from campaign.result import (
    Axis,
    Column,
    Curve,
    Figure,
    Finding,
    Mark,
    Panel,
    Result,
    Table,
    Value,
)
from campaign.trial import canonical_json

SCORED = tuple(name for name in PARAMETERS if name != "stribeck_exponent")
"""Parameters of Table 4.4; the exponent is fitted beside them, and scatters most."""
DISPLAY = {"stribeck_velocity": "rad/s"}


@dataclass(frozen=True)
class MapSet:
    """One complete map.

    Attributes:
        name: of its two sets, e.g. "1-2".
        where: what is particular about it, e.g. `bench.variation.day = 1`.
        fits: by direction, the exponent free.
    """

    name: str
    where: str
    points: tuple[MapPoint, ...]
    fits: Mapping[str, DirectionFit]

    def value(self, direction: str, parameter: str) -> float:
        return self.fits[direction].free.values[parameter]


def _sets(data: TestData, notes: list[str]) -> Iterator[MapSet]:
    """The maps in plan order: one for each point of the sweep and each repetition."""
    groups: dict[str, list[TrialData]] = {}
    for item in data.completed():
        place = {k: v for k, v in item.trial.point.items() if k != "speed"}
        groups.setdefault(canonical_json([place, item.trial.repeat]), []).append(item)
    for number, group in enumerate(groups.values(), start=1):
        first = group[0].trial
        place = {k: v for k, v in first.point.items() if k != "speed"}
        where = ", ".join(f"{path} = {value}" for path, value in place.items())
        name = f"{2 * number - 1}-{2 * number}"
        points = [point for item in group for point in map_points(item)]
        try:
            fits = {word: fit_direction(points, sign) for word, sign in DIRECTIONS.items()}
        except ValueError as error:
            notes.append(f"Sets {name} have no fit: {error}.")
            continue
        yield MapSet(name, where or f"repetition {first.repeat}", tuple(points), fits)


def relative_deviation(values: Sequence[float]) -> float:
    """Standard deviation over mean, of these values and no others (n, not n - 1).

    Table 4.4's deviations of Tc and vs follow with n from its own columns, and with n - 1 none.
    """
    return float(np.std(values) / np.mean(values))


def _analyse(data: TestData) -> Result:
    notes = list(failures_note(data))
    sets = list(_sets(data, notes))
    if not sets:
        return Result(notes=tuple(notes))
    if len(sets) == 1:
        notes.append("One map says nothing about repeatability; repeat it, or sweep the day.")
    for each in sets:
        for direction, fit in each.fits.items():
            notes += [f"Sets {each.name}, {direction}: {doubt}." for doubt in fit.free.doubts]
    figures = (_overlay(sets), _scatter(sets)) if len(sets) > 1 else (_overlay(sets),)
    return Result((_table(sets),), figures, tuple(_findings(sets)), tuple(notes))


def _all_values(sets: Sequence[MapSet], parameter: str) -> list[float]:
    return [each.value(direction, parameter) for each in sets for direction in DIRECTIONS]


def _findings(sets: Sequence[MapSet]) -> Iterator[Finding]:
    deviations = []
    for parameter in SCORED:
        for each in sets:
            for direction in DIRECTIONS:
                where: dict[str, Value] = {"set": each.name, "direction": direction}
                yield Finding(parameter, each.value(direction, parameter), UNITS[parameter], where)
        if len(sets) > 1:
            values = _all_values(sets, parameter)
            mean, deviation = float(np.mean(values)), relative_deviation(values)
            deviations.append(deviation)
            yield Finding(parameter, mean, UNITS[parameter], {"statistic": "mean"})
            told: dict[str, Value] = {"statistic": "relative standard deviation"}
            yield Finding(parameter, deviation, "", told)
    if deviations:
        yield Finding("relative_standard_deviation", max(deviations), "", {"parameters": "worst"})


def _table(sets: Sequence[MapSet]) -> Table:
    columns = [Column("parameter", "Parameter"), Column("unit", "Unit")]
    for each in sets:
        columns += [
            Column(f"{direction}_{each.name}", f"{direction.capitalize()} {each.name}")
            for direction in ("negative", "positive")
        ]
    columns += [Column("mean", "Mean"), Column("deviation", "Rel. std. deviation", "", "percent")]
    rows = []
    for parameter in PARAMETERS:
        values = _all_values(sets, parameter)
        row: dict[str, Value] = {"parameter": SYMBOLS[parameter], "unit": UNITS[parameter]}
        for each in sets:
            for direction in DIRECTIONS:
                row[f"{direction}_{each.name}"] = each.value(direction, parameter)
        row["mean"] = float(np.mean(values))
        row["deviation"] = relative_deviation(values) if len(sets) > 1 else None
        rows.append(row)
    told = "; ".join(f"sets {each.name}: {each.where}" for each in sets)
    return Table(
        key="repeatability",
        title="Static friction parameters of all sets",
        columns=tuple(columns),
        rows=tuple(rows),
        thesis=("4.4",),
        note=f"{told}. The deviation is taken over all columns, with n; δ is fitted, too.",
    )


def _overlay(sets: Sequence[MapSet]) -> Figure:
    """Figure 4.9: the first two maps on one another."""
    shown = list(sets[:2])
    series = ("measured", "alternative")
    panels = []
    for direction, sign in DIRECTIONS.items():
        curves = []
        for each, word in zip(shown, series, strict=False):
            fit = each.fits[direction]
            curves.append(Curve(sign * fit.rate, fit.torque, f"sets {each.name}", word, "points"))
        x = Axis("Rate", "rad/s", "deg/s")
        y = Axis("Friction torque, in its direction", "N m", "N m")
        panels.append(Panel(x, y, curves, f"{direction.capitalize()} direction"))
    return Figure(
        key="sets",
        title="Two friction-velocity maps on one another",
        caption="The same speeds, measured twice: the shape of the curve stays, the level of "
        "friction drifts.",
        alt="Friction torque over rate in both directions, dots of two complete maps in each.",
        panels=tuple(reversed(panels)),
        thesis=("4.9",),
        across=2,
    )


def _scatter(sets: Sequence[MapSet]) -> Figure:
    number = Axis("Map", limits=(0.5, len(sets) + 0.5))
    panels = []
    places = np.arange(1.0, len(sets) + 1)
    for parameter in SCORED:
        curves = []
        for direction in DIRECTIONS:
            values = np.array([each.value(direction, parameter) for each in sets])
            curves.append(Curve(places, values, f"{direction} direction", direction, "points"))
        everything = _all_values(sets, parameter)
        mean = float(np.mean(everything))
        unit = UNITS[parameter]
        axis = Axis(SYMBOLS[parameter], unit, DISPLAY.get(parameter, unit))
        title = f"{SYMBOLS[parameter]}: {100 * relative_deviation(everything):.1f} %"
        panels.append(Panel(number, axis, curves, title, [Mark("mean", y=mean)]))
    return Figure(
        key="scatter",
        title="Scatter of the parameters from map to map",
        caption="Each dot is one direction of one map; the line is the mean of all, "
        "and the titles give the standard deviation of all dots, relative to it.",
        alt="One panel for each parameter with a dot for every map and direction, and a line at "
        "their mean.",
        panels=tuple(panels),
        across=2,
    )


EXPERIMENT = Experiment(
    name="repeatability",
    summary="friction-velocity maps of several days, and the scatter of their fits (Table 4.4)",
    options=VelocityMapOptions,
    trials=map_trials,
    analyse=_analyse,
    requires=REQUIRED,
)
