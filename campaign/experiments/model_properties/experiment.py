"""Properties of friction models: Table 3.1 of the thesis, from virtual experiments.

Each model gets each parameter set, without parameters that the equations of its source lack.
Virtual experiments give numbers; `rules` turn them into marks. A mark holds for all sets, or the
property depends on the parameters.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from statistics import median_low
from typing import Any

from pydantic import Field, JsonValue

from campaign.channels import DRIVE_TORQUE, FRICTION_TORQUE, LOAD_RATE, RELATIVE_ANGLE
from campaign.estimate import Estimate
from campaign.estimation.sampled_curve import bracketed
from campaign.experiments.interface import Experiment, TestData, TrialData, bench_of, key, metrics
from campaign.experiments.model_properties.parameter_set import Scale, options_of, with_friction
from campaign.experiments.model_properties.rules import MARKS, MET, RULES, ModelVerdict
from campaign.experiments.model_properties.tables_and_figures import figures, tables
from campaign.experiments.model_properties.virtual_experiments import (
    estimates,
    numbers_of,
    requests,
)
from campaign.experiments.shared.common import COUNTED
from campaign.experiments.shared.friction_models import places
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.physics.friction import friction_models
from campaign.reason import Cause
from campaign.result import Finding, Result
from campaign.trial import TrialRequest, canonical_json

STEP = 1e-4
"""s; time step that sets the state size of models with a stored history."""
OWN = ("set", "model", "part", "torque_rate", "speed", "frequency", "rest")
RULED = Cause("by a rule", "a mark by a rule")


class ModelPropertiesOptions(Options):
    """Options of a test of model properties."""

    models: tuple[str, ...] = Field(min_length=1, max_length=100)
    """Friction models to classify."""
    sets: dict[str, dict[str, JsonValue]] = Field(min_length=1, max_length=10)
    """Parameter sets by name, as in `[friction.NAME]`; a model takes its own parameters. `model` of
    a set is the one whose Ts, Tc, vs and σ0 scale the experiments."""


def _trials(options: ModelPropertiesOptions, bench: Bench) -> Iterator[TrialRequest]:
    inertia = bench.axis.inertia
    if inertia is None:
        raise ValueError("the bench does not say axis.inertia: a pushed load needs one")
    known = {key for model in friction_models().values() for key in model.options.model_fields}
    for name, given in options.sets.items():
        if wrong := given.keys() - known:
            raise ValueError(f"sets.{name}: no friction model has the parameter '{min(wrong)}'")
        for model in options.models:
            tree = with_friction(bench, options_of(model, given, own=True))
            scale = Scale.of(given, inertia, model)
            for request in requests(scale, bench):
                point = {"set": name, "model": model, **request.point}
                yield replace(request, bench=tree, point=point)


def _scale(data: TrialData) -> Scale:
    given: Any = data.trial.options["sets"]
    inertia: Any = bench_of(data.trial).axis.inertia
    point = data.trial.point
    return Scale.of(given[str(point["set"])], inertia, str(point["model"]))


def _measure(data: TrialData) -> tuple[Estimate, ...]:
    return tuple(estimates(data, _scale(data)))


def _sizes(model: str, given: Any) -> dict[str, int | None]:
    """Numbers of parameters that a model takes from a set, of its state and switch functions."""
    options, kind = options_of(model, given, own=True), friction_models()[model]
    return {
        "parameters": len(options.model_fields_set - {"model"}),
        "state": kind.state_size(options, STEP),
        "switches": kind.switches and kind.switches(options),
    }


def _options(data: TestData) -> ModelPropertiesOptions:
    return ModelPropertiesOptions.model_validate(data.trials[0].trial.options, context={"si": True})


def _judged(data: TestData, notes: list[str]) -> Iterator[ModelVerdict]:
    """Verdicts of the models whose trials are complete; notes on the others."""
    options = _options(data)
    done = list(data.completed())
    if len(places(done, OWN)) > 1:
        raise ValueError("Table 3.1 is of one bench: leave the matrix of the test out")
    for model in options.models:
        numbers = {}
        for name in options.sets:
            own = [
                item
                for item in done
                if item.trial.point["model"] == model and item.trial.point["set"] == name
            ]
            points = {canonical_json(item.trial.point) for item in own}
            planned = requests(_scale(own[0]), bench_of(own[0].trial)) if own else ()
            if not own or len(points) < len(list(planned)):
                notes.append(f"{model}, {name}: trials are missing; the model is left out.")
                break
            measured = [(each.trial.point, metrics(each, _measure)) for each in own]
            try:
                numbers[name] = numbers_of(measured, _scale(own[0]))
            except ValueError as error:
                notes.append(f"{model}, {name}: {error}; the model is left out.")
                break
        else:
            yield ModelVerdict(model, numbers, _sizes(model, next(iter(options.sets.values()))))


def _findings(judged: ModelVerdict) -> Iterator[Finding]:
    conditions = {"model": judged.model}
    for rule in RULES:
        marks = judged.marks(rule)
        ends = marks[0], marks[-1]
        if ends[0] == ends[1]:
            mark = Estimate.without_interval("model_property", ends[0], "", RULED())
        else:
            mark = bracketed("model_property", median_low(marks), "", ends, "over parameter sets")
        yield Finding.of(mark, {**conditions, "property": rule.name})
    parameters = judged.sizes["parameters"] or 0
    count = Estimate("model_parameters", parameters, "", kind="count", reason=COUNTED())
    yield Finding.of(count, conditions)
    met = sum(judged.sign(rule) == MARKS[MET] for rule in RULES)
    number = Estimate("properties_met", met, "", kind="count", reason=COUNTED())
    yield Finding.of(number, {**conditions, "of": len(RULES)})


def _analyse(data: TestData) -> Result:
    notes: list[str] = []
    verdicts = list(_judged(data, notes))
    if not verdicts:
        return Result(notes=tuple(notes))
    return Result(
        tables(verdicts, _options(data).sets),
        figures(verdicts, data),
        tuple(finding for each in verdicts for finding in _findings(each)),
        tuple(notes),
    )


EXPERIMENT = Experiment(
    name="model_properties",
    summary="friction properties of each model, by rules (Table 3.1)",
    options=ModelPropertiesOptions,
    trials=_trials,
    analyse=_analyse,
    perturbs_bench=True,
    requires={
        FRICTION_TORQUE: "all properties",
        LOAD_RATE: "breakaway, sliding, stick-slip",
        DRIVE_TORQUE: "the torque of the spring",
        RELATIVE_ANGLE: "presliding, drift",
    },
    measure=_measure,
    key_numbers=(key("properties_met"),),
)
