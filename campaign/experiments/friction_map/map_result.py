"""Result of a friction-velocity map, for a report and for `campaign identify`.

Runs of a map and stretches of other recordings are analysed as in their reports.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from campaign.channels import DRIVE_TORQUE, JOINT_TORQUE, RELATIVE_RATE
from campaign.estimate import Estimate
from campaign.experiments.friction_map.curves import MEANINGS, Curves, fit_curves
from campaign.experiments.friction_map.figures import fit_figure, map_figure, rate_figure
from campaign.experiments.friction_map.pilot import settled_enough
from campaign.experiments.friction_map.points import points_of, steady
from campaign.experiments.friction_map.runs import DIRECTIONS, OWN, REQUIRED
from campaign.experiments.friction_map.steady_recordings import (
    KEYS,
    by_direction,
    parameters_of,
    sliding_of,
)
from campaign.experiments.friction_map.stretches import StretchOptions
from campaign.experiments.friction_map.tables import (
    curve_findings,
    map_findings,
    map_notes,
    model_table,
    parameter_table,
    point_table,
)
from campaign.experiments.interface import Model, TestData, TrialData
from campaign.experiments.shared.captions import trials_of
from campaign.parameter import IdentifiedRig, Parameter
from campaign.reason import Reason
from campaign.result import Finding, Result


def one_map(group: Sequence[TrialData]) -> tuple[Result, Curves]:
    """Result and curves of the map from runs at one place of a test's matrix."""
    place = {k: v for k, v in group[0].trial.point.items() if k not in OWN}
    conditions = {k: v for k, v in place.items() if isinstance(v, str | int | float | bool)}
    where = ", ".join(f"{k} = {v}" for k, v in place.items())
    notes: list[str] = []
    kept, left = steady(points_of(settled_enough(group, notes), notes), notes)
    fits = fit_curves(kept, group[0])
    points = point_table((*fits.points, *left), group[0], where)
    if not fits.is_map:
        notes += (f"{where}: {note}" if where else note for note in fits.notes)
        estimates = by_direction(parameters_of(fits)) if fits.points else {}
        result = Result(
            (points,),
            (rate_figure(fits),) if estimates else (),
            tuple(curve_findings(estimates, conditions)),
            tuple(notes),
        )
        return result, fits
    shown = trials_of(group)
    result = Result(
        (parameter_table(fits, where), model_table(fits, where), points),
        (map_figure(fits, where, shown), fit_figure(fits, where, shown)),
        tuple(map_findings(fits, conditions)),
        (*notes, *map_notes(fits, where)),
    )
    return result, fits


def _suits(trials: Sequence[TrialData]) -> tuple[Sequence[TrialData], str]:
    """Runs of maps; without any, all trials with a rate and a torque."""
    suitable = [each for each in trials if is_run(each)]
    for each in () if suitable else trials:
        names = each.channel_names()
        if RELATIVE_RATE in names and names & {DRIVE_TORQUE, JOINT_TORQUE}:
            suitable.append(each)
    why = f"no trial has {RELATIVE_RATE}, and {DRIVE_TORQUE} or {JOINT_TORQUE}"
    return suitable, "" if suitable else why


def is_run(data: TrialData) -> bool:
    """Whether a trial is a run of a map, with its speed and the windows of its directions."""
    trial = data.trial
    windows = DIRECTIONS.keys() & {window.name for window in trial.windows}
    return bool(windows) and "speed" in trial.point and REQUIRED.keys() <= data.channel_names()


def identified(data: TestData) -> Result:
    """Friction over rate, by direction. Raises ValueError if there is none."""
    runs = tuple(each for each in data.completed() if is_run(each))
    curves: Curves | None
    lost: tuple[Reason, ...] = ()
    if runs:
        result, curves = one_map(runs)
        parameters = tuple(parameters_of(curves)) if curves.points else ()
    else:
        sliding = sliding_of(data.trials, data.model)
        parameters, lost = sliding.parameters, sliding.left_out
        if not sliding.points:
            raise ValueError("; ".join(["nowhere does the axis slide steadily", *map(str, lost)]))
        result = Result(
            tables=(point_table((*sliding.points, *sliding.left), sliding.first),),
            figures=tuple(map(rate_figure, sliding.maps)),
            findings=tuple(Finding.of(each.estimate, {}) for each in parameters),
            notes=sliding.notes,
        )
        curves = sliding.maps[0] if sliding.maps else None
    if not parameters or curves is None:
        raise ValueError("; ".join(note.rstrip(".") for note in result.notes))
    settings = _settings(curves.found, parameters)
    return replace(result, identified=IdentifiedRig(parameters, settings=settings, left_out=lost))


def _settings(
    found: dict[str, dict[str, Estimate]], parameters: Sequence[Parameter]
) -> dict[str, tuple[object, str, str]]:
    """Bench keys that complete a curve, with values of the fitted curve for what is not measured.

    Other values could contradict the data beside a measured number.
    """
    keys = {each.bench for each in parameters if each.bench}
    if not keys:
        return {}
    filled: dict[str, tuple[object, str, str]] = {
        "friction.load.model": ("stribeck", "", "friction of steady sliding")
    }
    for direction, estimates in found.items():
        prefix = "friction.load." + ("negative." if direction == "negative" else "")
        line = {"static_torque": estimates["coulomb_torque"].value, "stribeck_velocity": 1e-3}
        fitted = {name: one.value for name, one in estimates.items() if one.kind == "number"}
        for name, value in ({"viscous_friction": 0.0} | line | fitted).items():
            if name in KEYS and prefix + name not in keys:
                filled[prefix + name] = (max(value, 0.0), MEANINGS[name][0], "of the fitted curve")
    return filled


MODEL = Model(
    name="friction_map",
    summary="friction over rate, of a map or of steady stretches of any recording",
    options=StretchOptions,
    suits=_suits,
)
