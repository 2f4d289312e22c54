"""What friction models say to a prescribed sinusoidal rate, without a plant (Figures 4.10, 4.14).

The load is moved exactly as prescribed, so nothing but the model decides the torque. The friction
of the bench can be described by several models, its compensators run on the same rate, and each
parameter can be varied (Figures 5.12 and 5.13).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from pydantic import Field, JsonValue

from campaign.channels import COMPENSATION_TORQUE, FRICTION_TORQUE, LOAD_RATE
from campaign.estimate import Estimate
from campaign.experiments.conclusions.behaviour import model_output_conclusions
from campaign.experiments.interface import Experiment, TestData, TrialData, bench_of
from campaign.experiments.shared.common import (
    conditions,
    failures_note,
    grouped,
    method_label,
    with_changes,
)
from campaign.experiments.shared.friction_models import (
    OF_ONE,
    combined,
    in_models,
    model_label,
    model_series,
    places,
    simulated,
)
from campaign.identification.sampled import LOST, at_sample, bracketed, named, peak
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.physics.steady_friction import steady_friction
from campaign.result import (
    Array,
    Axis,
    Cell,
    Column,
    Curve,
    Figure,
    Finding,
    Mark,
    Panel,
    Result,
    Style,
    Table,
)
from campaign.signals import Sine
from campaign.trial import Recording, Task, Tree, TrialRequest
from campaign.units import AngularRate, Frequency

OWN = ("model", "compensation")
VARIED = ("parameter", "factor")
UNCHANGED = "unchanged"
RATE = Axis("Rate", "rad/s", "deg/s")
TORQUE = Axis("Friction torque", "N m", "N m")
LEFT = Axis("Friction less compensation", "N m", "N m")
WHAT_IS_LEFT = "What compensation leaves is the friction of the bench less the output of its model."
METRICS = ("peak", "at_amplitude", "at_reversal")
JUMP = 20.0
"""times the step of the torque from sample to sample beside it."""
CYCLES = 2
"""of the prescribed rate; the first brings the bristles into their cycle, the last is shown."""
NEAR_ZERO = 0.08
"""Share of the amplitude that is shown around zero rate."""
SYMBOLS = {
    "bristle_stiffness": "bristle stiffness σ0",
    "bristle_damping": "bristle damping σ1",
    "viscous_friction": "viscous friction σ2",
    "static_torque": "static torque Ts",
    "coulomb_torque": "Coulomb torque Tc",
    "stribeck_velocity": "Stribeck velocity vs",
    "stribeck_exponent": "Stribeck exponent δ",
}


class ModelOutputOptions(Options):
    """Options of a model-output test."""

    amplitude: AngularRate = Field(default=0.2, gt=0)
    """Amplitude of the prescribed rate."""
    frequency: Frequency = Field(default=0.24, gt=0)
    """Frequency of the prescribed rate."""
    models: tuple[str, ...] = ("stribeck", "lugre")
    """Friction models to describe the bench's friction by, beside each other; none: its own."""
    compensation: tuple[str, ...] = ()
    """Compensations of the bench with a friction model inside, shown beside the friction."""
    vary: tuple[str, ...] = ()
    """Parameters of the bench's friction to vary, one at a time."""
    factors: tuple[float, ...] = Field(default=(0.5, 1.5), max_length=100)
    """What each varied parameter is multiplied by."""
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
        yield _request(options, {**point, "parameter": UNCHANGED, "factor": 1.0}, tree)
        for parameter in options.vary:
            for factor in options.factors:
                if changes := _scaled(own, parameter, factor):
                    known.add(parameter)
                    varied = {**point, "parameter": parameter, "factor": factor}
                    yield _request(options, varied, with_changes(own, changes))
    if missing := [name for name in options.vary if name not in known]:
        raise ValueError(f"no friction of the bench '{bench.name}' has a '{missing[0]}' to vary")
    for name in options.compensation:
        if name not in bench.compensation:
            raise ValueError(
                f"the bench '{bench.name}' has no compensation '{name}'; it has "
                f"{', '.join(bench.compensation) or 'none'}"
            )
        if not getattr(bench.compensation[name], "friction", None):
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
        requires=(LOAD_RATE, _shown_torque(compensation)),
    )


def _shown_torque(compensation: str) -> str:
    """The channel that a trial is about: of friction or of compensation."""
    return FRICTION_TORQUE if compensation == "none" else COMPENSATION_TORQUE


def _scaled(bench: Bench, parameter: str, factor: float) -> dict[str, Any]:
    """Values (SI) by dotted path: the parameter in every interface and direction that has it."""
    changes = {}
    for name, friction in bench.friction.items():
        for path, holder in (("", friction), ("negative.", getattr(friction, "negative", None))):
            value = getattr(holder, parameter, None)
            if isinstance(value, float):
                changes[f"friction.{name}.{path}{parameter}"] = value * factor
    return changes


def _analyse(data: TestData) -> Result:
    measured = list(data.completed())
    rows: list[dict[str, Cell]] = []
    findings: list[Finding] = []
    plain = places((item for item in measured if "parameter" not in item.trial.point), OWN)
    varied = places((item for item in measured if "parameter" in item.trial.point), VARIED)
    for place in (*plain, *varied):
        for repeats in grouped(place.trials).values():
            found = combined(repeats, _measure)
            row = {name: found.get(f"model_{name}") or _not_found(name) for name in METRICS}
            rows.append({**place.point, "source": _source(repeats[0]), **row})
            findings += [
                Finding.of(row[name], conditions(repeats[0])) for name in ("peak", "at_reversal")
            ]
    figures: list[Figure] = []
    for number, place in enumerate(plain, start=1):
        suffix = f"-{number}" if len(plain) > 1 else ""
        figures += [
            _static_figure(place.trials[0], suffix),
            _sine_figure(place.trials, suffix),
        ]
    for number, place in enumerate(varied, start=1):
        figures += _variation_figures(place.trials, f"-{number}" if len(varied) > 1 else "")
    if not rows:
        return Result(notes=failures_note(data))
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
    options = ModelOutputOptions.model_validate(measured[0].trial.options, context={"si": True})
    conclusions = model_output_conclusions(rows, options.amplitude, options.frequency)
    return Result(
        (table,),
        tuple(figures),
        tuple(findings),
        failures_note(data),
        conclusions,
        telling=next((figure.key for figure in figures if figure.key.startswith("sine")), ""),
    )


def _cycle(data: TrialData) -> tuple[Recording, Array]:
    """The last cycle, and the torque that this trial is about."""
    cut = data.recording().window(*data.trial.task.window)
    return cut, cut[_shown_torque(data.trial.task.compensation)]


def _source(data: TrialData) -> str:
    point = data.trial.point
    if "compensation" in point:
        return f"{method_label(str(point['compensation']))} (compensation)"
    if "parameter" in point:
        parameter = str(point["parameter"])
        same = parameter == UNCHANGED
        return parameter if same else f"{_symbol(parameter)} × {point['factor']}"
    return model_label(str(point["model"])) if "model" in point else "friction of the bench"


def _symbol(parameter: str) -> str:
    return SYMBOLS.get(parameter, parameter.replace("_", " "))


def _measure(data: TrialData) -> tuple[Estimate, ...]:
    """Torque of the last cycle: the largest, at the largest rate, and where the rate reverses.

    Without what cannot be told because samples of the rate were lost (NaN).
    """
    cut, torque = _cycle(data)
    rate = cut[LOAD_RATE]
    found = [peak("peak", torque, "N m")]
    if np.all(np.isfinite(rate)):
        found.append(at_sample("at_amplitude", torque, int(np.argmax(rate)), "N m"))
        found += _at_reversal(rate, torque)
    return simulated(named(each, f"model_{each.name}") for each in found)


def _not_found(name: str) -> Estimate:
    reason = f"the rate does not fall through zero, or {LOST}" if name == "at_reversal" else LOST
    return Estimate.without_interval(f"model_{name}", math.nan, "N m", reason)


def _at_reversal(rate: Array, torque: Array) -> Iterator[Estimate]:
    """Torque (N m) where the rate falls through zero: between two samples, unless it jumps there.

    A jump is a step between neighbours that is far larger than those beside it.
    """
    falling = np.flatnonzero((rate[:-1] > 0) & (rate[1:] <= 0))
    if not len(falling):
        return
    at = int(falling[0])
    value = float(torque[at])
    near = torque[max(at - 2, 0) : at + 5]
    if not np.all(np.isfinite(near)):
        yield Estimate.without_interval("at_reversal", math.nan, "N m", LOST)
        return
    steps = np.abs(np.diff(near))
    if np.max(steps) > JUMP * np.median(steps):
        # A sine's zero is not quite zero, and a jump goes through it.
        middle = 0.0 if abs(value) < 1e-9 * float(np.nanmax(torque)) else value
        reason = "the torque jumps where the rate changes its sign"
        yield Estimate.without_interval("at_reversal", middle, "N m", reason)
        return
    ends = value, float(torque[at + 1])
    yield bracketed("at_reversal", value, "N m", ends, "between the samples around it")


def _static_figure(data: TrialData, suffix: str) -> Figure:
    options = ModelOutputOptions.model_validate(data.trial.options, context={"si": True})
    bench = bench_of(data.trial)
    half = np.geomspace(1e-5 * options.amplitude, options.amplitude, 400)
    rate = np.concatenate([-half[::-1], half])
    dry, viscous = steady_friction(bench, rate)
    gap = np.where(np.arange(len(rate)) == len(half), np.nan, 1.0)  # no line through the jump
    return Figure(
        key=f"static-curve{suffix}",
        title="Friction of steady sliding and its parts",
        caption="The Stribeck part s(v) falls from static to Coulomb friction, the viscous part "
        "rises with the rate; their sum is what every model here comes to at a constant rate.",
        alt="Friction torque over rate in both directions: the Stribeck part, the straight viscous "
        "part, and their sum, with a jump at zero rate.",
        panels=(
            Panel(
                RATE,
                TORQUE,
                [
                    Curve(rate, (dry + viscous) * gap, "s(v) sgn(v) + σ2 v", "fit"),
                    Curve(rate, dry * gap, "Stribeck part s(v) sgn(v)", "static"),
                    Curve(rate, viscous, "viscous part σ2 v", "reference"),
                ],
            ),
        ),
        thesis=("4.10",),
    )


def _sine_figure(trials: Sequence[TrialData], suffix: str) -> Figure:
    compensated = any("compensation" in item.trial.point for item in trials)
    curves = []
    for item in trials:
        cut, torque = _cycle(item)
        point = item.trial.point
        name = str(point.get("compensation", model_series(str(point.get("model", "none")))))
        thin = compensated and "compensation" not in point
        style: Style = "thin" if thin else "line"
        curves.append(Curve(*_closed(cut[LOAD_RATE], torque), _source(item), name, style))
    near = NEAR_ZERO * max(_largest(curve.x) for curve in curves)
    zoom = Axis(RATE.label, "rad/s", "deg/s", limits=(-near, near))
    mark = (Mark("", x=0.0),)
    left = _left(trials)
    return Figure(
        key=f"sine{suffix}",
        title="Output of the models over a sinusoidal rate",
        caption="A static model jumps where the rate changes its sign. In a dynamic one the "
        "bristles have to turn around first, so the torque comes late and without a jump, on "
        "another branch for rising than for falling rate." + (f" {WHAT_IS_LEFT}" if left else ""),
        alt="Torque over rate for each model in one cycle of a sinusoidal rate, and the same near "
        "zero rate, where the static model jumps and the dynamic one makes a loop.",
        panels=(
            Panel(RATE, TORQUE, curves, "Whole cycle"),
            Panel(zoom, TORQUE, [_near(c, near) for c in curves], "Near zero rate", marks=mark),
            *([Panel(RATE, LEFT, left, "What compensation leaves")] if left else []),
        ),
        thesis=("4.14",),
        across=2,
    )


def _left(trials: Sequence[TrialData]) -> list[Curve]:
    """Friction less each compensation at the same rate; nothing of several frictions."""
    plain = [item for item in trials if "compensation" not in item.trial.point]
    if len(plain) != 1:
        return []
    _, friction = _cycle(plain[0])
    curves = []
    for item in trials:
        name = item.trial.point.get("compensation")
        if name is None:
            continue
        cut, torque = _cycle(item)
        if len(torque) == len(friction):
            rest = _closed(cut[LOAD_RATE], friction - torque)
            curves.append(Curve(*rest, _source(item), str(name)))
    return curves


def _closed(rate: Array, torque: Array) -> tuple[Array, Array]:
    return np.append(rate, rate[0]), np.append(torque, torque[0])


def _largest(rate: Array) -> float:
    """The largest of the samples that were not lost; 1 rad/s where all were."""
    known = rate[np.isfinite(rate)]
    return float(np.max(known)) if len(known) else 1.0


def _near(curve: Curve, rate: float) -> Curve:
    """The parts of a curve at rates up to twice `rate`, with gaps between them.

    A drawing shows so many points of a curve: this way it shows them where it looks.
    """
    inside = np.flatnonzero(np.abs(curve.x) <= 2.0 * rate)
    parts = np.split(inside, np.flatnonzero(np.diff(inside) > 1) + 1)
    gap = np.array([np.nan])
    x = np.concatenate([np.append(curve.x[part], gap) for part in parts])
    y = np.concatenate([np.append(curve.y[part], gap) for part in parts])
    return Curve(x, y, curve.label, curve.series, curve.style)


def _variation_figures(trials: Sequence[TrialData], suffix: str) -> Iterator[Figure]:
    """Parameters that steady sliding does not show (Figure 5.12), and the others (5.13)."""
    by_parameter: dict[str, list[TrialData]] = {}
    for item in trials:
        by_parameter.setdefault(str(item.trial.point["parameter"]), []).append(item)
    plain = by_parameter.pop(UNCHANGED, [])
    dynamic = {name: items for name, items in by_parameter.items() if _is_dynamic(items, plain)}
    static = {name: items for name, items in by_parameter.items() if name not in dynamic}
    if dynamic:
        yield Figure(
            key=f"dynamic-parameters{suffix}",
            title="Output of the model for variations of its dynamic parameters",
            caption="Near zero rate only, because steady sliding does not know these parameters: "
            "they decide how the torque turns around.",
            alt="Torque over rate near zero for lower, unchanged and higher values, one panel per "
            "dynamic parameter.",
            panels=tuple(_variation(name, items, plain, True) for name, items in dynamic.items()),
            thesis=("5.12",),
            across=2,
        )
    if static:
        yield Figure(
            key=f"static-parameters{suffix}",
            title="Output of the model for variations of its static parameters",
            caption="Torques move the whole curve, viscous friction its slope, and the Stribeck "
            "velocity only the fall at low rates.",
            alt="Torque over rate for lower, unchanged and higher values, one panel per static "
            "parameter.",
            panels=tuple(_variation(name, items, plain, False) for name, items in static.items()),
            thesis=("5.13",),
            across=2,
        )


def _is_dynamic(varied: list[TrialData], plain: list[TrialData]) -> bool:
    """Whether steady sliding is the same for all values of a parameter."""
    rate = np.linspace(1e-6, 1.0, 50) * _largest(varied[0].recording()[LOAD_RATE])
    curves = [np.add(*steady_friction(bench_of(item.trial), rate)) for item in (*plain, *varied)]
    return all(np.allclose(curve, curves[0], rtol=1e-12) for curve in curves)


def _variation(
    parameter: str, varied: list[TrialData], plain: list[TrialData], near_zero: bool
) -> Panel:
    ordered = sorted((*varied, *plain), key=lambda item: float(str(item.trial.point["factor"])))
    curves = []
    for item in ordered:
        factor = float(str(item.trial.point["factor"]))
        cut, torque = _cycle(item)
        series = "reference" if factor == 1.0 else f"factor {factor:g}"
        label = UNCHANGED if factor == 1.0 else f"× {factor:g}"
        curves.append(Curve(*_closed(cut[LOAD_RATE], torque), label, series))
    largest = _largest(curves[0].x)
    shown = NEAR_ZERO * largest if near_zero else largest
    axis = Axis(RATE.label, "rad/s", "deg/s", limits=(-1.02 * shown, 1.02 * shown))
    if near_zero:
        curves = [_near(curve, shown) for curve in curves]
    return Panel(axis, TORQUE, curves, _symbol(parameter))


EXPERIMENT = Experiment(
    name="model_output",
    summary="friction models at a prescribed sinusoidal rate, without a plant (Figures 4.10, 4.14)",
    options=ModelOutputOptions,
    trials=_trials,
    analyse=_analyse,
    perturbs_bench=True,
    requires={
        LOAD_RATE: "the rate that the models are told",
        FRICTION_TORQUE: "the output of a friction model",
        COMPENSATION_TORQUE: "the output of a compensation",
    },
    measure=_measure,
)
