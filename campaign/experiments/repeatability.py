"""Repeatability of the parameters of a friction-velocity map.

The whole map is measured several times, on different days or in repetitions. Each map is fitted on
its own, in both directions; every parameter then has a mean and a relative standard deviation over
all sets and directions (Table 4.4 and section 4.3.2). The thesis counts the two directions of one
map as two sets, so that three maps are sets 1 to 6.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from campaign.estimate import Estimate, Origin
from campaign.estimation.intervals import of_repeats
from campaign.estimation.scatter import relative_scatter
from campaign.estimation.stribeck import PARAMETERS, SYMBOLS, UNITS
from campaign.estimation.velocity_map import doubts
from campaign.experiments.friction_map import default_options
from campaign.experiments.friction_map.curves import fit_map
from campaign.experiments.friction_map.points import measure, points_of, steady
from campaign.experiments.friction_map.repeated_maps import (
    MapSet,
    by_map,
    overlay_figure,
    scatter_figure,
)
from campaign.experiments.friction_map.runs import (
    CAN_USE,
    DIRECTIONS,
    OWN,
    REQUIRED,
    VelocityMapOptions,
    map_trials,
    settling_notes,
)
from campaign.experiments.friction_map.warnings import map_warnings
from campaign.experiments.interface import Experiment, TestData, TrialData, key
from campaign.experiments.shared.captions import trials_of
from campaign.experiments.shared.systematic import shared_parts
from campaign.reason import Cause
from campaign.result import Cell, Column, Finding, Result, Table, Value
from campaign.trial import canonical_json

DOUBTFUL = Cause("doubtful values", "{doubtful} of {values} values are {origins}")
LARGEST = Cause("largest of several", "the largest of several: each has its own interval")
SCORED = tuple(name for name in PARAMETERS if name != "stribeck_exponent")
"""Parameters of Table 4.4; the exponent is fitted, too, and scatters most."""


def _sets(data: TestData, notes: list[str]) -> Iterator[MapSet]:
    """The maps in plan order: one for each point of the sweep and each repetition."""
    groups: dict[str, list[TrialData]] = {}
    for item in data.completed():
        place = {k: v for k, v in item.trial.point.items() if k not in OWN}
        groups.setdefault(canonical_json([place, item.trial.repeat]), []).append(item)
    for number, group in enumerate(groups.values(), start=1):
        first = group[0].trial
        place = {k: v for k, v in first.point.items() if k not in OWN}
        where = ", ".join(f"{path} = {value}" for path, value in place.items())
        name = f"{2 * number - 1}-{2 * number}"
        points, _ = steady(points_of(group, notes), notes)
        try:
            fits = fit_map(points, group[0])
        except ValueError as error:
            notes.append(f"Sets {name} have no fit: {error}.")
            continue
        where = where or f"repetition {first.repeat}"
        yield MapSet(name, where, fits, fits.estimates("free"))


def _analyse(data: TestData) -> Result:
    notes = list(settling_notes(item.trial for item in data.completed()))
    sets = list(_sets(data, notes))
    if not sets:
        return Result(notes=tuple(notes))
    if len(sets) == 1:
        notes.append("One map says nothing about repeatability; repeat it, or sweep the day.")
    for each in sets:
        for direction, fit in each.fits.fits.items():
            notes += [f"Sets {each.name}, {direction}: {doubt}." for doubt in doubts(fit)]
    shown = trials_of(data.completed())
    figures = [overlay_figure(sets, shown)]
    if len(sets) > 1:
        means = {name: _mean(sets, name) for name in SCORED}
        deviations = {name: _deviation(sets, name) for name in SCORED}
        figures.append(scatter_figure(sets, means, deviations, shown))
    findings = tuple(_findings(sets))
    return Result((_table(sets),), tuple(figures), findings, tuple(notes))


def _mean(sets: Sequence[MapSet], parameter: str) -> Estimate:
    """Mean of a parameter over all maps and directions; each map is one repetition.

    Both directions of a map share its day, so only the mean of each map is a repetition. The
    bench's constants shift all maps equally.
    """
    parts = shared_parts(_found(sets, parameter))
    values, unit = by_map(sets, parameter).mean(axis=1), UNITS[parameter]
    mean = of_repeats(parameter, values, unit, "maps", systematic=parts)
    return _flagged(mean, _found(sets, parameter))


def _deviation(sets: Sequence[MapSet], parameter: str) -> Estimate:
    """Relative standard deviation over all maps and directions, as in Table 4.4."""
    deviation = relative_scatter(parameter, by_map(sets, parameter))
    return _flagged(deviation, _found(sets, parameter))


def _found(sets: Sequence[MapSet], parameter: str) -> list[Estimate]:
    return [each.found[name][parameter] for each in sets for name in DIRECTIONS]


def _flagged(told: Estimate, found: Sequence[Estimate]) -> Estimate:
    """Estimate over all maps, not determined if one map does not determine the parameter.

    Values at a bound, and values that are not determined, do not follow from the data: their
    scatter has no meaning. Omitting them would be a selection: of values near zero, only the large
    ones are determined. The number remains for display.
    """
    doubtful = [each for each in found if each.origin in (Origin.AT_BOUND, Origin.NOT_DETERMINED)]
    if not doubtful or math.isnan(told.value):
        return told
    origins = " or ".join(dict.fromkeys(str(each.origin) for each in doubtful))
    return Estimate(
        told.name,
        told.value,
        told.unit,
        origin=Origin.NOT_DETERMINED,
        reason=DOUBTFUL(doubtful=len(doubtful), values=len(found), origins=origins),
        systematic=told.systematic,
    )


def _findings(sets: Sequence[MapSet]) -> Iterator[Finding]:
    deviations = []
    for parameter in SCORED:
        for each in sets:
            for direction in DIRECTIONS:
                where: dict[str, Value] = {"set": each.name, "direction": direction}
                yield Finding.of(each.found[direction][parameter], where)
        if len(sets) > 1:
            deviation = _deviation(sets, parameter)
            deviations.append(deviation)
            yield Finding.of(_mean(sets, parameter), {"statistic": "mean"})
            yield Finding.of(deviation, {"statistic": "relative standard deviation"})
    if known := [each for each in deviations if each.origin is not Origin.NOT_DETERMINED]:
        worst = max(known, key=lambda each: each.value)
        largest = Estimate.without_interval(
            "relative_standard_deviation", worst.value, "", LARGEST()
        )
        yield Finding.of(largest, {"parameters": "worst"})


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
        row: dict[str, Cell] = {"parameter": SYMBOLS[parameter], "unit": UNITS[parameter]}
        for each in sets:
            for direction in DIRECTIONS:
                row[f"{direction}_{each.name}"] = each.found[direction][parameter]
        row["mean"] = _mean(sets, parameter)
        row["deviation"] = _deviation(sets, parameter) if len(sets) > 1 else None
        rows.append(row)
    maps = "; ".join(f"sets {each.name}: {each.where}" for each in sets)
    return Table(
        key="repeatability",
        title="Static friction parameters of all sets",
        columns=tuple(columns),
        rows=tuple(rows),
        thesis=("4.4",),
        note=f"{maps}. The standard deviation is over all columns, divided by n; δ is fitted, too. "
        "The interval of the mean is that of the maps. That of the deviation includes the "
        "difference between the directions, which is the same in all maps. Errors of the bench's "
        "constants shift all maps equally: the interval of the mean includes them. Neither has an "
        "interval where a map has its value at a bound or does not determine it.",
    )


EXPERIMENT = Experiment(
    name="repeatability",
    summary="friction-velocity maps of several days, and the scatter of their fits (Table 4.4)",
    options=VelocityMapOptions,
    trials=map_trials,
    analyse=_analyse,
    measure=measure,
    needs_samples=False,
    fit=default_options.velocity_map,
    warnings=map_warnings,
    requires=REQUIRED,
    can_use=CAN_USE,
    key_numbers=tuple(
        key(name, statistic=statistic)
        for statistic in ("mean", "relative standard deviation")
        for name in ("coulomb_torque", "static_torque", "stribeck_velocity", "viscous_friction")
    ),
)
