"""Sensitivity of a model-based compensation to each of its parameters (section 5.2.2.4).

Stabilization under a sinusoidal base motion. One parameter at a time of the compensation's friction
model has a relative change, in every interface of the model and in both directions. The plant keeps
its own friction. The change at which the error passes a threshold states how accurately a parameter
must be identified, and ranks the parameters (Figure 5.14).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import Field

from campaign.channels import COMPENSATION_TORQUE, POINTING_ERROR, RELATIVE_RATE
from campaign.estimate import Estimate
from campaign.estimation.stabilization_error import over_trials
from campaign.estimation.threshold import Threshold
from campaign.experiments.interface import Experiment, TestData, TrialData, bench_of, key, validated
from campaign.experiments.sensitivity.model_variation import model_figures, model_trials
from campaign.experiments.sensitivity.results import (
    SYMBOLS,
    Response,
    judge,
    sensitivity_figure,
    sensitivity_findings,
    sensitivity_table,
    thresholds_figure,
)
from campaign.experiments.shared import default_options
from campaign.experiments.shared.common import compensation_of, parameter_paths, with_changes
from campaign.experiments.shared.pointing_error import (
    SineMotionOptions,
    error_of,
    found,
    measured_part,
    of_each,
    seen_through,
    windows_of,
)
from campaign.physics.bench import Bench
from campaign.result import Finding, Result, Value
from campaign.trial import TrialRequest
from campaign.units import Angle, in_words

CHANGES = (-0.8, -0.65, -0.5, -0.4, -0.3, -0.2, -0.1, 0.1, 0.2, 0.3, 0.4, 0.5, 0.65, 0.8)


class SensitivityOptions(SineMotionOptions):
    """Options of a sensitivity study."""

    compensation: str = "lugre"
    """Name of the bench's model-based compensation to vary."""
    parameters: tuple[str, ...] = Field(default=tuple(SYMBOLS), min_length=1)
    """Parameters of its friction model to vary, one at a time."""
    changes: tuple[float, ...] = Field(default=CHANGES, min_length=1, max_length=1000)
    """Relative changes of each; -0.2 is 20 % less."""
    repeats: int = Field(default=3, ge=1, le=1000)
    """Trials at each value; their errors are averaged."""
    threshold: Angle = Field(default=0.2e-3, gt=0)
    """Largest admissible error."""
    threshold_ratio: float | None = Field(default=None, gt=1)
    """Instead: largest admissible ratio to the error with the unchanged model."""
    model_output: bool = True
    """Also run the model alone at a prescribed rate (Figures 5.12, 5.13): in simulation only."""
    model_change: float = Field(default=0.5, gt=0, lt=1)
    """Relative change, up and down, for which its output is shown."""

    def without_effect(self) -> frozenset[str]:
        threshold = set() if self.threshold_ratio is None else {"threshold"}
        return frozenset(threshold | (set() if self.model_output else {"model_change"}))


def varied_paths(bench: Bench, compensation: str, parameter: str) -> dict[str, float]:
    """Dotted path on the bench to value (SI), wherever the compensation's model has `parameter`."""
    interfaces = compensation_of(bench, compensation).model_dump(mode="json").get("friction")
    if not isinstance(interfaces, Mapping):
        raise ValueError(f"'{compensation}' has no friction model whose parameters could vary")
    return parameter_paths(interfaces, f"compensation.{compensation}.friction", parameter)


def _varied(bench: Bench, options: SensitivityOptions, parameter: str, change: float) -> Any:
    """The bench's tree with one parameter changed; ValueError when the bench refuses it."""
    paths = varied_paths(bench, options.compensation, parameter)
    return with_changes(bench, {path: value * (1.0 + change) for path, value in paths.items()})


def _refusals(bench: Bench, options: SensitivityOptions) -> dict[tuple[str, float], str]:
    """Changes that the bench refuses, with the reason."""
    refused = {}
    for parameter in options.parameters:
        if not varied_paths(bench, options.compensation, parameter):
            continue
        for change in options.changes:
            try:
                _varied(bench, options, parameter, change)
            except ValueError as error:
                refused[parameter, change] = str(error)
    return refused


def _trials(options: SensitivityOptions, bench: Bench) -> Iterator[TrialRequest]:
    known = [p for p in options.parameters if varied_paths(bench, options.compensation, p)]
    if not known:
        raise ValueError(
            f"the model of '{options.compensation}' has none of {', '.join(options.parameters)}"
        )
    task = options.task(options.compensation)
    refused = _refusals(bench, options)
    places: list[tuple[str, float]] = [("", 0.0)]
    places += [(p, c) for p in known for c in options.changes if c and (p, c) not in refused]
    for parameter, change in places:
        tree = _varied(bench, options, parameter, change) if parameter else None
        for repetition in range(1, options.repeats + 1):
            yield TrialRequest(
                task,
                can_use=(),
                point={"parameter": parameter, "change": change, "repetition": repetition},
                note=f"{parameter} {change:+.0%}" if parameter else "the model as it is",
                bench=tree,
                windows=windows_of(task),
            )
    if options.model_output:
        yield from model_trials(bench, options, known, _varied)


def _measure(data: TrialData) -> list[Estimate]:
    """Stabilization error; trials of the model alone have no metric, only figures."""
    if data.trial.task.mode != "rate":
        return []
    return found([error_of(measured_part(data), data.trial.task)])


def _responses(measured: Sequence[TrialData]) -> dict[str, Response]:
    """Response by parameter; the trials with the unchanged model belong to each of them."""
    errors: dict[str, dict[float, list[Estimate]]] = {}
    for data in measured:
        for error in of_each([data], _measure, "stabilization_error"):
            place = errors.setdefault(str(data.trial.point["parameter"]), {})
            place.setdefault(float(str(data.trial.point["change"])), []).append(error)
    unchanged = errors.pop("", {})
    responses = {}
    for parameter, by_change in errors.items():
        ordered = sorted({**unchanged, **by_change}.items())
        responses[parameter] = Response(
            change=np.array([change for change, _ in ordered]),
            errors=tuple(over_trials(each) for _, each in ordered),
            dots=np.array([(change, one.value) for change, each in ordered for one in each]),
        )
    return responses if unchanged else {}


def _analyse(data: TestData) -> Result:
    measured = list(data.completed())
    if not measured:
        return Result()
    notes: list[str] = []
    options = validated(SensitivityOptions, measured[0].trial.options)
    responses = _responses(measured)
    figures = tuple(model_figures(measured, options.compensation))
    if not responses:
        notes.append("No trial with the unchanged model completed: there is nothing to compare.")
        return Result(figures=figures, notes=tuple(notes))
    unchanged = next(iter(responses.values())).unchanged
    ratio = options.threshold_ratio
    limit = Threshold(options.threshold if ratio is None else ratio * unchanged.value, ratio)
    if unchanged.value > limit.value:
        notes.append(
            f"The error is {in_words(unchanged.value, 'rad', 'mrad')} with the unchanged model, "
            f"already beyond the threshold of {in_words(limit.value, 'rad', 'mrad')}; no change "
            "has a meaning then."
        )
    judged = judge(responses, limit)
    conditions: dict[str, Value] = {
        "compensation": options.compensation,
        "frequency": options.frequency,
        "acceleration": options.acceleration,
    }
    findings: list[Finding] = []
    whole = len(measured) == len(data.trials) and not data.left_out
    if whole:
        findings += sensitivity_findings(judged, conditions)
    else:
        notes.append("Thresholds and ranks are not compared: they need every trial.")
    findings.append(Finding.of(unchanged, conditions))
    notes += _skipped_notes(measured, options)
    name = options.compensation
    return Result(
        (sensitivity_table(judged, limit, seen_through(measured[0].trial)),),
        (
            *thresholds_figure(judged, limit, name, conditions if whole else None),
            sensitivity_figure(judged, limit, name),
            *figures,
        ),
        tuple(findings),
        tuple(notes),
    )


def _skipped_notes(measured: Sequence[TrialData], options: SensitivityOptions) -> Iterator[str]:
    plain = next((d for d in measured if not d.trial.point["parameter"]), None)
    if plain is None:
        return
    bench = bench_of(plain.trial)
    for parameter in options.parameters:
        if not varied_paths(bench, options.compensation, parameter):
            yield f"The model of '{options.compensation}' has no {parameter}; it was not varied."
    for (parameter, change), why in _refusals(bench, options).items():
        yield f"{parameter} {change:+.0%} was skipped: {why}."


EXPERIMENT = Experiment(
    name="sensitivity",
    summary="error over the change of each parameter of a compensation's model (Figure 5.14)",
    options=SensitivityOptions,
    trials=_trials,
    analyse=_analyse,
    fit=default_options.base_motion,
    perturbs_bench=True,
    measure=_measure,
    needs_samples=False,
    requires={POINTING_ERROR: "the stabilization error"},
    can_use={
        COMPENSATION_TORQUE: "figures of the model alone",
        RELATIVE_RATE: "figure of the model alone for its parameters of sliding",
    },
    # A model that is stiffer than the bristles overcompensates.
    seeks_instability=True,
    key_numbers=(
        key("sensitivity_threshold"),
        key("stabilization_error"),
    ),
)
