"""Output of friction models at a sinusoidal rate, without a plant (Figures 4.10, 4.14).

The load moves exactly as prescribed, so only the model determines the torque. Several models can
describe the friction of the bench, its compensators get the same rate, and each parameter can be
varied (Figures 5.12 and 5.13).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from pydantic import Field, JsonValue

from campaign.channels import COMPENSATION_TORQUE, FRICTION_TORQUE, LOAD_RATE
from campaign.estimate import Estimate
from campaign.estimation.sampled_curve import LOST, at_sample, bracketed, peak
from campaign.experiments.interface import Experiment, TestData, TrialData, key, validated
from campaign.experiments.model_output.figures import (
    UNCHANGED,
    cycle,
    shown_torque,
    sine_figure,
    source,
    static_figure,
    variation_figures,
)
from campaign.experiments.shared.common import (
    compensation_of,
    conditions,
    grouped,
    numbered,
    parameter_paths,
    with_changes,
)
from campaign.experiments.shared.friction_models import (
    OF_ONE,
    combined,
    in_models,
    places,
    simulated,
)
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.reason import Cause
from campaign.result import Array, Cell, Column, Finding, Result, Table
from campaign.signals import Sine
from campaign.trial import Task, Tree, TrialRequest
from campaign.units import AngularRate, Frequency

OWN = ("model", "compensation")
VARIED = ("parameter", "factor")
METRICS = ("peak", "at_amplitude", "at_reversal")
JUMP = 20.0
"""Ratio of a torque step to the median step around it, above which it is a jump."""
NO_REVERSAL = Cause("no reversal", "the rate does not fall through zero, or {why}")
JUMPS = Cause("torque that jumps", "the torque jumps where the rate changes its sign")
CYCLES = 2
"""of the prescribed rate; in the first one the bristles settle, the last one is shown."""


class ModelOutputOptions(Options):
    """Options of a model-output test."""

    amplitude: AngularRate = Field(default=0.2, gt=0)
    """Amplitude of the prescribed rate."""
    frequency: Frequency = Field(default=0.24, gt=0)
    """Frequency of the prescribed rate."""
    models: tuple[str, ...] = ("stribeck", "lugre")
    """Friction models to describe the bench's friction, side by side; none: its own."""
    compensation: tuple[str, ...] = ()
    """Compensations of the bench with a friction model, shown beside the friction."""
    vary: tuple[str, ...] = ()
    """Parameters of the bench's friction to vary, one at a time."""
    factors: tuple[float, ...] = Field(default=(0.5, 1.5), max_length=100)
    """Factors of each varied parameter."""
    sample_rate: Frequency = Field(default=2000.0, gt=0, le=100_000)
    """Rate of the recording."""

    def without_effect(self) -> frozenset[str]:
        return frozenset(() if self.vary else {"factors"})


def _trials(options: ModelOutputOptions, bench: Bench) -> Iterator[TrialRequest]:
    known: set[str] = set()
    for point, tree in in_models(bench, options.models):
        if not options.vary:
            yield _request(options, point, tree)
            continue
        own = bench if tree is None else Bench.model_validate(tree, context={"si": True})
        interfaces = own.model_dump(mode="json")["friction"]
        yield _request(options, {**point, "parameter": UNCHANGED, "factor": 1.0}, tree)
        for parameter in options.vary:
            for factor in options.factors:
                if paths := parameter_paths(interfaces, "friction", parameter):
                    changes = {path: value * factor for path, value in paths.items()}
                    known.add(parameter)
                    varied = {**point, "parameter": parameter, "factor": factor}
                    yield _request(options, varied, with_changes(own, changes))
    if missing := [name for name in options.vary if name not in known]:
        raise ValueError(f"no friction of the bench '{bench.name}' has a '{missing[0]}' to vary")
    for name in options.compensation:
        if not getattr(compensation_of(bench, name), "friction", None):
            raise ValueError(f"the compensation '{name}' has no friction model to show")
        yield _request(options, {"compensation": name}, None, name)


def _request(
    options: ModelOutputOptions,
    point: dict[str, JsonValue],
    bench: Tree | None,
    compensation: str = "none",
) -> TrialRequest:
    duration = CYCLES / options.frequency
    return TrialRequest(
        Task(
            mode="prescribed",
            command=Sine(amplitude=options.amplitude, frequency=options.frequency),
            compensation=compensation,
            duration=duration,
            window=(duration - 1.0 / options.frequency, duration),
            sample_rate=options.sample_rate,
            start_angle=-options.amplitude / (2.0 * np.pi * options.frequency),
        ),
        point=point,
        bench=bench,
        requires=(LOAD_RATE, shown_torque(compensation)),
    )


def _analyse(data: TestData) -> Result:
    measured = list(data.completed())
    rows: list[dict[str, Cell]] = []
    findings: list[Finding] = []
    plain = places((item for item in measured if "parameter" not in item.trial.point), OWN)
    varied = places((item for item in measured if "parameter" in item.trial.point), VARIED)
    for place in (*plain, *varied):
        for repeats in grouped(place.trials).values():
            combination = combined(repeats, _measure)
            row = {name: combination.get(f"model_{name}") or _not_found(name) for name in METRICS}
            rows.append({**place.point, "source": source(repeats[0]), **row})
            findings += [
                Finding.of(row[name], conditions(repeats[0])) for name in ("peak", "at_reversal")
            ]
    if not rows:
        return Result()
    options = validated(ModelOutputOptions, measured[0].trial.options)
    top = options.amplitude
    shown = [
        Result(figures=(static_figure(p.trials[0], top), sine_figure(p.trials))) for p in plain
    ]
    variations = [Result(figures=tuple(variation_figures(place.trials))) for place in varied]
    figures = (*numbered(shown).figures, *numbered(variations).figures)
    table = Table(
        key="model-output",
        title="Output of the models at a sinusoidal rate",
        columns=(
            *(*plain, *varied)[0].columns,
            Column("source", "Model"),
            Column("peak", "Largest torque", "N m", "N m"),
            Column("at_amplitude", "At the largest rate", "N m", "N m"),
            Column("at_reversal", "Where the rate falls through zero", "N m", "N m"),
        ),
        rows=tuple(rows),
        note="Where the rate falls through zero a static model jumps, and a dynamic one still "
        "holds the torque of its bristles. " + OF_ONE,
    )
    return Result(
        (table,),
        figures,
        tuple(findings),
        telling=next((figure.key for figure in figures if figure.key.startswith("sine")), ""),
    )


def _measure(data: TrialData) -> tuple[Estimate, ...]:
    """Torque of the last cycle: the largest, at the largest rate, and at the reversal of the rate.

    Without the last two if samples of the rate were lost (NaN).
    """
    cut, torque = cycle(data)
    rate = cut[LOAD_RATE]
    metrics = [peak("peak", torque, "N m")]
    if np.all(np.isfinite(rate)):
        metrics.append(at_sample("at_amplitude", torque, int(np.argmax(rate)), "N m"))
        metrics += _at_reversal(rate, torque)
    return simulated(replace(each, name=f"model_{each.name}") for each in metrics)


def _not_found(name: str) -> Estimate:
    reason = NO_REVERSAL(why=LOST()) if name == "at_reversal" else LOST()
    return Estimate.without_interval(f"model_{name}", math.nan, "N m", reason)


def _at_reversal(rate: Array, torque: Array) -> Iterator[Estimate]:
    """Torque (N m) where the rate falls through zero: between two samples, unless it jumps there.

    A jump is a step of more than `JUMP` times the median of the steps around it.
    """
    falling = np.flatnonzero((rate[:-1] > 0) & (rate[1:] <= 0))
    if not len(falling):
        return
    at = int(falling[0])
    value = float(torque[at])
    near = torque[max(at - 2, 0) : at + 5]
    if not np.all(np.isfinite(near)):
        yield Estimate.without_interval("at_reversal", math.nan, "N m", LOST())
        return
    steps = np.abs(np.diff(near))
    if np.max(steps) > JUMP * np.median(steps):
        # A sampled sine is not exactly zero there, and a jump passes through zero.
        middle = 0.0 if abs(value) < 1e-9 * float(np.nanmax(torque)) else value
        yield Estimate.without_interval("at_reversal", middle, "N m", JUMPS())
        return
    ends = value, float(torque[at + 1])
    yield bracketed("at_reversal", value, "N m", ends, "between the samples around it")


EXPERIMENT = Experiment(
    name="model_output",
    summary="friction models at a prescribed sinusoidal rate, without a plant (Figures 4.10, 4.14)",
    options=ModelOutputOptions,
    trials=_trials,
    analyse=_analyse,
    perturbs_bench=True,
    requires={
        LOAD_RATE: "the rate that the models are given",
        FRICTION_TORQUE: "the output of a friction model",
        COMPENSATION_TORQUE: "the output of a compensation",
    },
    measure=_measure,
    key_numbers=(
        key("model_peak", parameter="unchanged"),
        key("model_at_reversal", parameter="unchanged"),
    ),
)
