"""Leave-one-out validation of a calibration over the values of a condition."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from campaign.arrays import Array
from campaign.calibration.objective import Simulation
from campaign.calibration.problem import CalibrationProblem
from campaign.calibration.targets import Target
from campaign.estimation.multi_start import Display, Settings, fit_from
from campaign.estimation.objective import Objective


@dataclass(frozen=True)
class LeftOut:
    """One refit without the cells of one value.

    Attributes:
        value: of the condition, SI.
        found: values of these cells from the refitted bench, printed unit; None if missing.
    """

    value: float | int | str
    targets: tuple[Target, ...]
    found: tuple[float | None, ...]


def leave_one_out(
    problem: CalibrationProblem,
    simulation: Simulation,
    objective: Objective,
    settings: Settings,
    display: Display,
    optimum: Array,
) -> list[LeftOut]:
    """Refit from `optimum` without each value of the condition in turn, and predict its cells."""
    condition, targets = problem.options.leave_out, problem.targets
    settings = replace(settings, max_evaluations=problem.options.leave_out_evaluations)
    groups: dict[float | int | str, list[int]] = {}
    for index, target in enumerate(targets):
        value = target.cell.conditions.get(condition)
        if isinstance(value, float | int | str):
            groups.setdefault(value, []).append(index)
    if len(groups) < 2:
        return []
    results = []
    for number, (value, left) in enumerate(sorted(groups.items(), key=_order), 1):
        mask = np.ones(len(targets), dtype=bool)
        mask[left] = False
        if mask.sum() < len(optimum):
            continue
        phase = f"without {condition} {number} of {len(groups)}"
        end = fit_from(objective, optimum, settings, phase, display, used=mask).end
        predicted = simulation.evaluate(problem.space.values(end)).found
        objective.evaluations += 1
        results.append(
            LeftOut(
                value,
                tuple(targets[i] for i in left),
                tuple(predicted.get(targets[i].cell.path) for i in left),
            )
        )
    return results


def deviations(targets: Sequence[Target], found: Sequence[float | None]) -> Array:
    """Deviations in percent; NaN as in `Target.percent`."""
    return np.array([t.percent(value) for t, value in zip(targets, found, strict=True)])


def _order(item: tuple[float | int | str, list[int]]) -> tuple[bool, float | str]:
    value = item[0]
    return isinstance(value, str), value
