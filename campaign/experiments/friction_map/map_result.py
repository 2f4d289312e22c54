"""One friction-velocity map: its fits, and the tables, figures and findings of them."""

from __future__ import annotations

from campaign.experiments.friction_map.figures import fit_figure, map_figure
from campaign.experiments.friction_map.fits import MapFits, fit_map
from campaign.experiments.friction_map.pilot import settled_enough
from campaign.experiments.friction_map.points import points_of, steady
from campaign.experiments.friction_map.runs import OWN
from campaign.experiments.friction_map.tables import (
    map_findings,
    map_notes,
    model_table,
    parameter_table,
    point_table,
)
from campaign.experiments.interface import TrialData, bench_of
from campaign.experiments.shared.captions import trials_of
from campaign.result import Result


def one_map(group: tuple[TrialData, ...], suffix: str = "") -> tuple[Result, MapFits | None]:
    """The map of runs at one place of a test's matrix; no fits where it has too few points."""
    place = {k: v for k, v in group[0].trial.point.items() if k not in OWN}
    told = {k: v for k, v in place.items() if isinstance(v, str | int | float | bool)}
    where = ", ".join(f"{k} = {v}" for k, v in place.items())
    bench = bench_of(group[0].trial)
    notes: list[str] = []
    points = points_of(settled_enough(group, notes), bench, notes)
    kept, left = steady(points, notes)
    try:
        fits = fit_map(kept, bench, group[0])
    except ValueError as error:
        notes.append(f"No fit{f' for {where}' if where else ''}: {error}.")
        table = point_table((*kept, *left), suffix, where)
        return Result(tables=(table,), notes=tuple(notes)), None
    shown = trials_of(group)
    result = Result(
        (
            parameter_table(fits, suffix, where),
            model_table(fits, suffix, where),
            point_table((*fits.points, *left), suffix, where),
        ),
        (map_figure(fits, suffix, where, shown), fit_figure(fits, suffix, where, shown)),
        tuple(map_findings(fits, told)),
        (*notes, *map_notes(fits, where)),
    )
    return result, fits
