"""Friction-velocity map: drive torque at constant velocities, with a Stribeck fit.

Each trial runs out at one speed and back at the same, so it ends where it began and needs no
homing. Steady sliding needs no drive but friction (Eq. 4.1 without acceleration), so the mean drive
torque over a settled window, less J times the residual acceleration, is one point of the map.
"""

from __future__ import annotations

from dataclasses import replace

from campaign.channels import COMMAND
from campaign.experiments.friction_map import default_options
from campaign.experiments.friction_map.figures import example_figure
from campaign.experiments.friction_map.map_result import MODEL, identified, one_map
from campaign.experiments.friction_map.pilot import STAGE, PilotedMapOptions, trials
from campaign.experiments.friction_map.points import measure
from campaign.experiments.friction_map.runs import (
    CAN_USE,
    DIRECTIONS,
    OWN,
    REQUIRED,
    settling_notes,
    stretches_found,
)
from campaign.experiments.friction_map.warnings import map_warnings
from campaign.experiments.interface import Experiment, TestData, key
from campaign.experiments.shared.common import of_each_place
from campaign.result import Result


def _analyse(data: TestData) -> Result:
    if data.model is not None:
        return identified(data)
    maps = of_each_place(data.completed(), OWN, lambda group: one_map(group)[0])
    notes = settling_notes(item.trial for item in data.completed())
    figures = (*maps.figures, *example_figure(data))
    return replace(maps, figures=figures, notes=(*notes, *maps.notes))


EXPERIMENT = Experiment(
    name="velocity_map",
    summary="friction torque over constant velocity, and its Stribeck fit (Table 4.3)",
    options=PilotedMapOptions,
    trials=trials,
    analyse=_analyse,
    measure=measure,
    needs_samples=False,
    fit=default_options.velocity_map,
    warnings=map_warnings,
    requires=REQUIRED,
    can_use={COMMAND: "command in the figure of one point", **CAN_USE},
    stages=(STAGE,),
    recorded=stretches_found,
    windows=tuple(DIRECTIONS),
    model=MODEL,
    key_numbers=tuple(
        key(name, direction=direction, exponent="free")
        for direction in DIRECTIONS
        for name in ("coulomb_torque", "static_torque", "stribeck_velocity", "viscous_friction")
    ),
)
