"""Friction-velocity map: the drive torque of constant-velocity runs, and its Stribeck fit.

Each trial runs out at one speed and back at the same, so it ends where it began and needs no
homing. Steady sliding needs no drive but friction (Eq. 4.1 without acceleration), so the mean drive
torque over a settled window, less J times the residual acceleration, is one point of the map.
"""

from __future__ import annotations

from campaign.channels import COMMAND
from campaign.experiments.friction_map import fitting
from campaign.experiments.friction_map.choice import STAGE
from campaign.experiments.friction_map.conclusions import map_conclusions
from campaign.experiments.friction_map.figures import example_figure, fit_figure, map_figure
from campaign.experiments.friction_map.fits import fit_map
from campaign.experiments.friction_map.map_fit import stretches_found
from campaign.experiments.friction_map.pilot import PilotedMapOptions, settled_enough, trials
from campaign.experiments.friction_map.points import measure, points_of, steady
from campaign.experiments.friction_map.runs import (
    CAN_USE,
    DIRECTIONS,
    OWN,
    REQUIRED,
    settling_notes,
)
from campaign.experiments.friction_map.tables import (
    map_findings,
    map_notes,
    model_table,
    parameter_table,
    point_table,
)
from campaign.experiments.friction_map.warnings import map_warnings
from campaign.experiments.interface import Experiment, TestData, TrialData, bench_of
from campaign.experiments.shared.captions import trials_of
from campaign.experiments.shared.common import failures_note, grouped
from campaign.experiments.shared.conclusion_parts import Settings
from campaign.result import Figure, Finding, Result, Table


def _analyse(data: TestData) -> Result:
    notes = [*failures_note(data), *settling_notes(item.trial for item in data.completed())]
    groups = list(grouped(data.completed(), own=OWN).values())
    parts = []
    for number, group in enumerate(groups, start=1):
        parts.append(_one_map(group, f"-{number}" if len(groups) > 1 else ""))
    findings = [finding for part in parts for finding in part.findings]
    speeds = [float(str(item.trial.point["speed"])) for item in data.completed()]
    return Result(
        tuple(table for part in parts for table in part.tables),
        (*(figure for part in parts for figure in part.figures), *example_figure(data)),
        tuple(findings),
        (*notes, *(note for part in parts for note in part.notes)),
        map_conclusions(findings, speeds, Settings.of(data, PilotedMapOptions)),
    )


def _one_map(group: tuple[TrialData, ...], suffix: str) -> Result:
    """One place of the test's matrix."""
    place = {k: v for k, v in group[0].trial.point.items() if k not in OWN}
    told = {k: v for k, v in place.items() if isinstance(v, str | int | float | bool)}
    where = ", ".join(f"{k} = {v}" for k, v in place.items())
    bench = bench_of(group[0].trial)
    notes: list[str] = []
    points = points_of(settled_enough(group, notes), bench, notes)
    kept, left = steady(points, notes)
    try:
        fits = fit_map(kept, bench)
    except ValueError as error:
        notes.append(f"No fit{f' for {where}' if where else ''}: {error}.")
        return Result(tables=(point_table((*kept, *left), suffix, where),), notes=tuple(notes))
    tables: list[Table] = [
        parameter_table(fits, suffix, where),
        model_table(fits, suffix, where),
        point_table((*fits.points, *left), suffix, where),
    ]
    shown = trials_of(group)
    figures: list[Figure] = [
        map_figure(fits, suffix, where, shown),
        fit_figure(fits, suffix, where, shown),
    ]
    findings: list[Finding] = list(map_findings(fits, told))
    notes += map_notes(fits, where)
    return Result(tuple(tables), tuple(figures), tuple(findings), tuple(notes))


EXPERIMENT = Experiment(
    name="velocity_map",
    summary="friction torque over constant velocity, and its Stribeck fit (Table 4.3)",
    options=PilotedMapOptions,
    trials=trials,
    analyse=_analyse,
    measure=measure,
    fit=fitting.velocity_map,
    warnings=map_warnings,
    requires=REQUIRED,
    can_use={COMMAND: "command in the figure of one point", **CAN_USE},
    stages=(STAGE,),
    recorded=stretches_found,
    windows=tuple(DIRECTIONS),
)
