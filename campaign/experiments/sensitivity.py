"""Sensitivity of a model-based compensation to each of its parameters (section 5.2.2.4).

Stabilization under a sinusoidal base motion, with one parameter at a time of the compensation's
friction model changed by a share of itself, in every interface of the model and both directions.
The plant keeps its own friction. How much a parameter may be wrong before the error passes a
threshold says how well it has to be identified, and ranks the parameters (Figure 5.14).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import Field

from campaign.channels import COMPENSATION_TORQUE, POINTING_ERROR, RELATIVE_RATE
from campaign.experiments.common import failures_note, method_label, with_changes
from campaign.experiments.interface import Experiment, TestData, TrialData, bench_of
from campaign.experiments.model_variation import model_figures, model_trials
from campaign.experiments.stabilization import stabilization_error
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.result import (
    Array,
    Axis,
    Column,
    Curve,
    Figure,
    Finding,
    Mark,
    Panel,
    Result,
    Table,
    Value,
)
from campaign.signals import Sine
from campaign.trial import Task, TrialRequest
from campaign.units import Angle, AngularAcceleration, Frequency

SYMBOLS = {
    "bristle_stiffness": "σ0",
    "bristle_damping": "σ1",
    "viscous_friction": "σ2",
    "static_torque": "Ts",
    "coulomb_torque": "Tc",
    "stribeck_velocity": "vs",
}
CHANGES = (-0.8, -0.65, -0.5, -0.4, -0.3, -0.2, -0.1, 0.1, 0.2, 0.3, 0.4, 0.5, 0.65, 0.8)


class SensitivityOptions(Options):
    """Options of a sensitivity study."""

    compensation: str = "lugre"
    """The model-based compensation that is varied, by its name on the bench."""
    parameters: tuple[str, ...] = Field(default=tuple(SYMBOLS), min_length=1)
    """Parameters of its friction model, varied one at a time."""
    changes: tuple[float, ...] = Field(default=CHANGES, min_length=1, max_length=1000)
    """Relative changes of each; -0.2 is 20 % less."""
    repeats: int = Field(default=3, ge=1, le=1000)
    """Trials at each value, whose errors are averaged."""
    threshold: Angle = Field(default=0.2e-3, gt=0)
    """Error whose passing counts as too much."""
    threshold_ratio: float | None = Field(default=None, gt=1)
    """Instead: how many times the error with the unchanged model counts as too much."""
    frequency: Frequency = Field(default=0.24, gt=0)
    """Frequency of the base motion."""
    acceleration: AngularAcceleration = Field(default=float(np.deg2rad(18.0)), gt=0)
    """Amplitude of the base's angular acceleration."""
    cycles: int = Field(default=3, ge=1, le=10_000)
    """Whole cycles of the base motion that are measured."""
    settle_cycles: int = Field(default=1, ge=0, le=1_000)
    """Cycles before them, for the transient to pass."""
    sample_rate: Frequency = Field(default=1000.0, gt=0, le=100_000)
    """Rate of the recording."""
    model_output: bool = True
    """Also run the model alone at a prescribed rate (Figures 5.12, 5.13): in simulation only."""
    model_change: float = Field(default=0.5, gt=0, lt=1)
    """Relative change, either way, that its output is shown for."""


def varied_paths(bench: Bench, compensation: str, parameter: str) -> dict[str, float]:
    """Dotted path on the bench to value (SI), wherever the compensation's model has `parameter`."""
    if compensation not in bench.compensation:
        named = ", ".join(bench.compensation) or "none"
        raise ValueError(f"the bench has no compensation '{compensation}'; it has {named}")
    interfaces = bench.compensation[compensation].model_dump(mode="json").get("friction")
    if not isinstance(interfaces, Mapping):
        raise ValueError(f"'{compensation}' has no friction model whose parameters could vary")
    found: dict[str, float] = {}
    for name, model in interfaces.items():
        where = f"compensation.{compensation}.friction.{name}"
        for prefix, table in (("", model), ("negative.", model.get("negative") or {})):
            value = table.get(parameter)
            if isinstance(value, float | int):
                found[f"{where}.{prefix}{parameter}"] = float(value)
    return found


def _varied(bench: Bench, options: SensitivityOptions, parameter: str, change: float) -> Any:
    """The bench's tree with one parameter changed; ValueError when the bench refuses it."""
    paths = varied_paths(bench, options.compensation, parameter)
    return with_changes(bench, {path: value * (1.0 + change) for path, value in paths.items()})


def _refusals(bench: Bench, options: SensitivityOptions) -> dict[tuple[str, float], str]:
    """Changes that the bench cannot have, and why."""
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
    start = options.settle_cycles / options.frequency
    stop = start + options.cycles / options.frequency
    task = Task(
        mode="rate",
        base_acceleration=Sine(amplitude=options.acceleration, frequency=options.frequency),
        compensation=options.compensation,
        duration=stop,
        window=(start, stop),
        sample_rate=options.sample_rate,
    )
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
            )
    if options.model_output:
        yield from model_trials(bench, options, known, _varied)


@dataclass(frozen=True)
class Response:
    """Error over the change of one parameter; changes increase, 0 among them.

    Attributes:
        change, error: shape (n,), relative and rad: the mean over repetitions.
        dots: every trial's (change, error), shape (m, 2).
    """

    change: Array
    error: Array
    dots: Array


def crossing(change: Array, error: Array, threshold: float) -> float | None:
    """Smallest size of a change at which `error` passes `threshold`, linearly interpolated.

    Both sides are followed outwards from no change, and the nearer crossing counts. 0 when the
    error is beyond it unchanged; None when it is passed nowhere. Shapes (n,), changes increasing.
    """
    middle = int(np.argmin(np.abs(change)))
    if error[middle] > threshold:
        return 0.0
    found = []
    for side in (range(middle + 1, len(change)), range(middle - 1, -1, -1)):
        before = middle
        for here in side:
            if error[here] > threshold:
                share = (threshold - error[before]) / (error[here] - error[before])
                found.append(abs(change[before] + share * (change[here] - change[before])))
                break
            before = here
    return float(min(found)) if found else None


def ranking(responses: Mapping[str, Response], threshold: float) -> dict[str, int]:
    """Rank of each parameter, 1 the most important: by the threshold, then by the largest error."""

    def order(parameter: str) -> tuple[float, float]:
        response = responses[parameter]
        passed = crossing(response.change, response.error, threshold)
        largest = float(np.max(response.error))
        return (np.inf if passed is None else passed), -largest

    return {name: rank for rank, name in enumerate(sorted(responses, key=order), start=1)}


def _responses(measured: Sequence[TrialData], options: SensitivityOptions) -> dict[str, Response]:
    """By parameter; the trials with the model as it is belong to every one of them."""
    errors: dict[str, dict[float, list[float]]] = {}
    for data in measured:
        if data.trial.task.mode != "rate":
            continue
        cut = data.recording().window(*data.trial.task.window)
        error = stabilization_error(cut, options.frequency)
        place = errors.setdefault(str(data.trial.point["parameter"]), {})
        place.setdefault(float(str(data.trial.point["change"])), []).append(error)
    unchanged = errors.pop("", {})
    responses = {}
    for parameter, by_change in errors.items():
        ordered = sorted({**unchanged, **by_change}.items())
        responses[parameter] = Response(
            change=np.array([change for change, _ in ordered]),
            error=np.array([float(np.mean(values)) for _, values in ordered]),
            dots=np.array([(change, value) for change, values in ordered for value in values]),
        )
    return responses if unchanged else {}


def _analyse(data: TestData) -> Result:
    notes = list(failures_note(data))
    measured = list(data.completed())
    if not measured:
        return Result(notes=tuple(notes))
    options = SensitivityOptions.model_validate(measured[0].trial.options, context={"si": True})
    responses = _responses(measured, options)
    figures = tuple(model_figures(measured, options.compensation))
    if not responses:
        notes.append("No trial with the unchanged model completed: there is nothing to compare.")
        return Result(figures=figures, notes=tuple(notes))
    first = next(iter(responses.values()))
    unchanged = float(first.error[np.argmin(np.abs(first.change))])
    ratio = options.threshold_ratio
    threshold = options.threshold if ratio is None else ratio * unchanged
    if unchanged > threshold:
        notes.append(
            f"The error is {unchanged * 1e3:.3g} mrad with the unchanged model, already beyond "
            f"the threshold of {threshold * 1e3:.3g} mrad; no change has a meaning then."
        )
    ranks = ranking(responses, threshold)
    rows = [_row(name, responses[name], ranks[name], threshold, unchanged) for name in responses]
    told: dict[str, Value] = {
        "compensation": options.compensation,
        "frequency": options.frequency,
        "acceleration": options.acceleration,
    }
    findings: list[Finding] = []
    if len(measured) == len(data.trials):
        findings += _findings(rows, told)
    else:
        notes.append("Thresholds and ranks are not compared: they need every trial.")
    findings.append(Finding("stabilization_error", unchanged, "rad", told))
    notes += _skipped_notes(measured, options)
    return Result(
        (_table(rows, threshold),),
        (*figures, _figure(responses, ranks, threshold, options)),
        tuple(findings),
        tuple(notes),
    )


def _row(
    name: str, response: Response, rank: int, threshold: float, unchanged: float
) -> dict[str, Value]:
    passed = crossing(response.change, response.error, threshold)
    reach = float(min(-response.change[0], response.change[-1]))
    low = float(response.error[0])
    high = float(response.error[-1])
    return {
        "parameter": name,
        "symbol": SYMBOLS.get(name, name),
        "threshold": passed,
        "reach": reach,
        "rank": rank,
        "unchanged": unchanged,
        "lowest_change": float(response.change[0]),
        "low": low,
        "highest_change": float(response.change[-1]),
        "high": high,
        "said": "" if passed is not None else f"none below {reach:.0%}",
    }


def _findings(rows: Sequence[Mapping[str, Value]], told: Mapping[str, Value]) -> Iterator[Finding]:
    """Threshold and rank. Where nothing passes, the largest change tried is a lower bound."""
    for row in rows:
        where = {**told, "parameter": row["parameter"]}
        passed, reach = row["threshold"], row["reach"]
        bound = passed if isinstance(passed, float) else reach
        beyond = passed is None
        yield Finding("sensitivity_threshold", float(str(bound)), "", where, lower_bound=beyond)
        yield Finding("sensitivity_rank", float(str(row["rank"])), "", where)


def _table(rows: Sequence[Mapping[str, Value]], threshold: float) -> Table:
    return Table(
        key="sensitivity",
        title=f"Change of each parameter at which the error passes {threshold * 1e3:.3g} mrad",
        columns=(
            Column("symbol", "Parameter"),
            Column("parameter", "Name"),
            Column("threshold", "Change", "", "percent"),
            Column("said", "Within the changes tried"),
            Column("rank", "Rank"),
            Column("unchanged", "Error, unchanged", "rad", "mrad"),
            Column("lowest_change", "Largest decrease", "", "percent"),
            Column("low", "Error there", "rad", "mrad"),
            Column("highest_change", "Largest increase", "", "percent"),
            Column("high", "Error there", "rad", "mrad"),
        ),
        rows=tuple(sorted(rows, key=lambda row: float(str(row["rank"])))),
        thesis=("figure 5.14",),
        note="The smaller of decrease and increase counts, interpolated between the changes tried. "
        "Parameters that never pass are ranked by their largest error.",
    )


def _figure(
    responses: Mapping[str, Response],
    ranks: Mapping[str, int],
    threshold: float,
    options: SensitivityOptions,
) -> Figure:
    top = 1.08 * max(float(np.max(r.dots[:, 1])) for r in responses.values())
    error = Axis("Stabilization error (1σ)", "rad", "mrad", limits=(0.0, max(top, 1.1 * threshold)))
    panels = []
    for name, response in responses.items():
        symbol = SYMBOLS.get(name, name)
        passed = crossing(response.change, response.error, threshold)
        marks = [Mark(f"{threshold * 1e3:.3g} mrad", y=threshold)]
        said = "not passed" if passed is None else f"passes at {passed:.0%}"
        mean = Curve(response.change, response.error, "mean", "measured", "line")
        dots = Curve(response.dots[:, 0], response.dots[:, 1], "each trial", "measured", "points")
        curves = [mean, dots] if options.repeats > 1 else [mean]
        change = Axis(f"Change of {symbol}", "", "percent")
        title = f"{symbol}: {said}, rank {ranks[name]}"
        panels.append(Panel(change, error, curves, title, marks))
    return Figure(
        key="sensitivity",
        title=f"Error over the change of each parameter, {method_label(options.compensation)}",
        caption="Each panel changes one parameter of the compensation's model and leaves the "
        "others and the true friction alone. The steeper the valley, the better the parameter has "
        "to be known; the horizontal line is the threshold. All panels have one scale.",
        alt="Stabilization error over the relative change of each model parameter, one panel per "
        "parameter, with a dot for every trial and a line at the threshold.",
        panels=tuple(panels),
        thesis=("5.14",),
        across=2,
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
    requires={POINTING_ERROR: "the stabilization error"},
    can_use={
        COMPENSATION_TORQUE: "figures of the model alone",
        RELATIVE_RATE: "figure of the model alone for its parameters of sliding",
    },
    # A model stiffer than the bristles it stands for takes away more than there is.
    seeks_instability=True,
)
