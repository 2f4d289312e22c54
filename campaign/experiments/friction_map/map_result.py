"""Result of one friction-velocity map: fits, tables, figures, findings."""

from __future__ import annotations

from collections.abc import Sequence

from campaign.experiments.friction_map.curves import Curves, fit_curves
from campaign.experiments.friction_map.figures import fit_figure, map_figure, rate_figure
from campaign.experiments.friction_map.pilot import settled_enough
from campaign.experiments.friction_map.points import points_of, steady
from campaign.experiments.friction_map.runs import OWN
from campaign.experiments.friction_map.steady_recordings import by_direction, parameters_of
from campaign.experiments.friction_map.tables import (
    curve_findings,
    map_findings,
    map_notes,
    model_table,
    parameter_table,
    point_table,
)
from campaign.experiments.interface import TrialData
from campaign.experiments.shared.captions import trials_of
from campaign.result import Result


def one_map(group: Sequence[TrialData], suffix: str = "") -> tuple[Result, Curves]:
    """The map of runs at one place of a test's matrix."""
    place = {k: v for k, v in group[0].trial.point.items() if k not in OWN}
    told = {k: v for k, v in place.items() if isinstance(v, str | int | float | bool)}
    where = ", ".join(f"{k} = {v}" for k, v in place.items())
    notes: list[str] = []
    kept, left = steady(points_of(settled_enough(group, notes), notes), notes)
    fits = fit_curves(kept, group[0])
    points = point_table((*fits.points, *left), group[0], suffix, where)
    if not fits.is_map:
        notes += (f"{where}: {note}" if where else note for note in fits.notes)
        found = by_direction(parameters_of(fits)) if fits.points else {}
        result = Result(
            (points,),
            (rate_figure(fits, suffix),) if found else (),
            tuple(curve_findings(found, told)),
            tuple(notes),
        )
        return result, fits
    shown = trials_of(group)
    result = Result(
        (parameter_table(fits, suffix, where), model_table(fits, suffix, where), points),
        (map_figure(fits, suffix, where, shown), fit_figure(fits, suffix, where, shown)),
        tuple(map_findings(fits, told)),
        (*notes, *map_notes(fits, where)),
    )
    return result, fits
