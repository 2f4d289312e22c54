"""A plan as plain data for `campaign plan --json`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from pydantic import JsonValue

from campaign.physics.loop_margins import LoopMargins
from campaign.physics.plan_loops import LoopUse
from campaign.protocol.plan import LimitUse, Plan, PlannedTest
from campaign.protocol.stages import PlannedStage
from campaign.trial import Most, Trial

POLES = 8
"""Reported poles of each loop, the fastest growing first."""


def as_tree(plan: Plan) -> dict[str, Any]:
    """A plan without the text of its files, as JSON-compatible data: SI, stable names."""
    protocol = plan.protocol
    return {
        "protocol": protocol.path.name,
        "title": protocol.title,
        "description": protocol.description,
        "operator": protocol.operator,
        "notes": protocol.notes,
        "tags": list(protocol.tags),
        "published": protocol.published,
        "fingerprint": plan.fingerprint,
        "seed": plan.seed,
        "overrides": list(protocol.overrides),
        "only": list(plan.only),
        "sources": sorted(protocol.sources),
        "policy": protocol.policy.model_dump(mode="json"),
        "duration_s": plan.duration,
        "following": _most(plan.following),
        "samples": plan.samples,
        "bytes": plan.size,
        "tests": [_test(test) for test in plan.tests],
        "trials": [_trial(trial) for trial in plan.trials],
        "breaches": [_use(use) for use in plan.breaches],
    }


def _test(test: PlannedTest) -> dict[str, Any]:
    return {
        "name": test.name,
        "kind": test.kind,
        "title": test.title,
        "description": test.description,
        "group": test.group,
        "leading_figure": test.leading_figure,
        "reproduces": list(test.reproduces),
        "bench": test.bench,
        "options": test.options,
        "chosen": dict(test.chosen),
        "matrix": {path: list(values) for path, values in test.matrix.items()},
        "order": test.order,
        "seed": test.seed,
        "repeat": test.repeat,
        "trials": list(test.numbers),
        "duration_s": test.duration,
        "limits": [_use(use) for use in test.closest],
        "loops": [{"trial": use.trial, **loop_tree(use)} for use in test.loops],
        "seeks_instability": test.seeks_instability,
        "coarse": [_use(use) for use in test.coarse],
        "stages": [stage_tree(stage) for stage in test.stages],
        "warnings": list(test.warnings),
    }


def stage_tree(stage: PlannedStage) -> dict[str, Any]:
    """A stage as plain data, readable by `planned_stage`."""
    return {
        "number": stage.number,
        "name": stage.name,
        "why": stage.why,
        "point": dict(stage.point),
        "seed": stage.seed,
        "most": _most(stage.most),
    }


def planned_stage(test: str, tree: Mapping[str, Any]) -> PlannedStage:
    """A stage from its tree. Raises LookupError, TypeError or ValueError."""
    most = tree["most"]
    return PlannedStage(
        test=test,
        number=int(tree["number"]),
        name=str(tree["name"]),
        why=str(tree["why"]),
        point=dict(tree["point"]),
        seed=int(tree["seed"]),
        most=Most(int(most["trials"]), float(most["duration_s"]), int(most["samples"])),
    )


def _most(most: Most) -> dict[str, JsonValue]:
    return {"trials": most.trials, "duration_s": most.duration, "samples": most.samples}


def _trial(trial: Trial) -> dict[str, Any]:
    return {
        "number": trial.number,
        "name": trial.name,
        "test": trial.test,
        "role": trial.role.value,
        "point": trial.point,
        "repeat": trial.repeat,
        "seed": trial.seed,
        "duration_s": trial.task.duration,
        "compensation": trial.task.compensation,
        "note": trial.note,
        "setup": list(trial.setup),
        "set_by_operator": list(trial.set_by_operator),
        "requires": list(trial.requires),
        "can_use": list(trial.can_use),
        "fingerprint": trial.fingerprint,
        "truth": trial.truth,
    }


def _use(use: LimitUse) -> dict[str, JsonValue]:
    margin = use.margin
    return {
        "limit": margin.limit,
        "sensor": margin.sensor,
        "trial": use.trial,
        "value": _finite(margin.value),
        "bound": margin.bound,
        "unit": margin.unit,
        "fraction": _finite(margin.fraction),
        "broken": margin.broken,
    }


def loop_tree(use: LoopUse) -> dict[str, JsonValue]:
    """A loop with its margins; a margin without a crossing is null."""
    return {
        "compensation": use.compensation,
        "mode": use.mode,
        "regime": use.regime,
        **margins_tree(use.margins),
    }


def margins_tree(margins: LoopMargins) -> dict[str, JsonValue]:
    """Margins and poles, SI; an unstable loop has no margins."""
    margin: dict[str, JsonValue] = {
        "phase_margin_rad": margins.phase_margin,
        "gain_margin": margins.gain_margin,
        "gain_crossing_rad_s": margins.gain_crossing,
        "delay_margin_s": margins.delay_margin,
    }
    return {
        "stable": margins.stable,
        "low_margin": margins.low,
        "crossovers_rad_s": list(margins.crossovers),
        "crossover_rad_s": margins.crossover,
        **(margin if margins.stable else dict.fromkeys(margin)),
        "growth_1_s": _finite(margins.growth),
        "poles_1_s": [[pole.real, pole.imag] for pole in margins.poles[:POLES]],
    }


def _finite(value: float) -> float | None:
    """None for infinity, which JSON lacks: the acceleration of a command that jumps."""
    return value if math.isfinite(value) else None
