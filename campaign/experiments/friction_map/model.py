"""Friction over rate as parameters: of the runs of a map, or of wherever a recording is steady.

Runs of a map are analysed as in their report; stretches of other recordings as in theirs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from campaign.channels import DRIVE_TORQUE, JOINT_TORQUE, RELATIVE_RATE
from campaign.estimate import Estimate
from campaign.experiments.friction_map.conclusions import map_conclusions
from campaign.experiments.friction_map.map_result import one_map
from campaign.experiments.friction_map.over_rate import FRICTION, MEANINGS
from campaign.experiments.friction_map.runs import DIRECTIONS, REQUIRED
from campaign.experiments.friction_map.sliding import KEYS, Named, sliding_of
from campaign.experiments.friction_map.sliding_shown import (
    sliding_conclusions,
    sliding_figure,
    stretch_table,
)
from campaign.experiments.friction_map.stretches import StretchOptions
from campaign.experiments.interface import EMPTY, Model, TestData, TrialData
from campaign.experiments.shared.conclusion_parts import Settings
from campaign.parameter import Identified, Parameter
from campaign.result import Finding, Result


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
    parameters = tuple(Named.of(FRICTION, found).parameters())
    speeds = [point.speed for point in fits.points]
    return replace(
        result,
        conclusions=map_conclusions(result.findings, speeds, Settings({})),
        identified=Identified(parameters, settings=_settings(found, parameters)),
    )


def _of_stretches(data: TestData) -> Result:
    sliding = sliding_of(data.trials, data.model)
    if not sliding.points:
        lost = map(str, sliding.left_out)
        raise ValueError("; ".join(["nowhere does the axis slide steadily", *lost]))
    if not sliding.parameters:
        raise ValueError("; ".join(note.rstrip(".") for note in sliding.notes))
    return Result(
        tables=(stretch_table(sliding),),
        figures=tuple(sliding_figure(sliding, each) for each in sliding.maps),
        findings=tuple(Finding.of(each.estimate, {}) for each in sliding.parameters),
        notes=sliding.notes,
        conclusions=tuple(sliding_conclusions(sliding.found)),
        identified=Identified(
            sliding.parameters,
            settings=_settings(sliding.maps[0].found, sliding.parameters),
            left_out=sliding.left_out,
        ),
    )


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


MODEL = Model(
    name="friction_map",
    summary="friction over rate, of a map or of steady stretches of any recording",
    options=StretchOptions,
    suits=_suits,
)
