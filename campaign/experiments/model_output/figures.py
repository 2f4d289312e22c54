"""Figures of model outputs at a sinusoidal rate."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from campaign.channels import COMPENSATION_TORQUE, FRICTION_TORQUE, LOAD_RATE
from campaign.experiments.interface import TrialData, bench_of
from campaign.experiments.shared.common import closed, method_label, number_of
from campaign.experiments.shared.friction_models import PARAMETER_LABELS, model_label, model_series
from campaign.physics.steady_friction import steady_friction
from campaign.recording import Recording
from campaign.result import Array, Axis, Curve, Figure, Mark, Panel, Style

UNCHANGED = "unchanged"
RATE = Axis("Rate", "rad/s", "deg/s")
TORQUE = Axis("Friction torque", "N m", "N m")
LEFT = Axis("Friction less compensation", "N m", "N m")
WHAT_IS_LEFT = "What compensation leaves is the friction of the bench less the output of its model."
NEAR_ZERO = 0.08
"""Shown share of the amplitude around zero rate."""


def shown_torque(compensation: str) -> str:
    """The torque channel of a trial: of friction or of compensation."""
    return FRICTION_TORQUE if compensation == "none" else COMPENSATION_TORQUE


def cycle(data: TrialData) -> tuple[Recording, Array]:
    """The last cycle of a trial, and its torque."""
    cut = data.recording().window(*data.trial.task.window)
    return cut, cut[shown_torque(data.trial.task.compensation)]


def source(data: TrialData) -> str:
    """Label of a trial's output: a model, a compensation or a varied parameter."""
    point = data.trial.point
    if "compensation" in point:
        return f"{method_label(str(point['compensation']))} (compensation)"
    if "parameter" in point:
        parameter = str(point["parameter"])
        same = parameter == UNCHANGED
        return parameter if same else f"{_symbol(parameter)} × {point['factor']}"
    return model_label(str(point["model"])) if "model" in point else "friction of the bench"


def _symbol(parameter: str) -> str:
    return PARAMETER_LABELS.get(parameter, parameter.replace("_", " "))


def static_figure(data: TrialData, amplitude: float) -> Figure:
    """Friction of steady sliding and its parts, up to an amplitude of the rate (rad/s)."""
    bench = bench_of(data.trial)
    half = np.geomspace(1e-5 * amplitude, amplitude, 400)
    rate = np.concatenate([-half[::-1], half])
    dry, viscous = steady_friction(bench, rate)
    gap = np.where(np.arange(len(rate)) == len(half), np.nan, 1.0)  # no line through the jump
    return Figure(
        key="static-curve",
        title="Friction of steady sliding and its parts",
        caption="The Stribeck part s(v) falls from static to Coulomb friction, the viscous part "
        "rises with the rate; their sum is the torque of every model at a constant rate.",
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


def sine_figure(trials: Sequence[TrialData]) -> Figure:
    """Torque over a cycle of the rate, for each model."""
    compensated = any("compensation" in item.trial.point for item in trials)
    curves = []
    for item in trials:
        cut, torque = cycle(item)
        point = item.trial.point
        name = str(point.get("compensation", model_series(str(point.get("model", "none")))))
        thin = compensated and "compensation" not in point
        style: Style = "thin" if thin else "line"
        curves.append(Curve(*closed(cut[LOAD_RATE], torque), source(item), name, style))
    near = NEAR_ZERO * max(_largest(curve.x) for curve in curves)
    zoom = Axis(RATE.label, "rad/s", "deg/s", limits=(-near, near))
    mark = (Mark("", x=0.0),)
    left = _left(trials)
    return Figure(
        key="sine",
        title="Output of the models over a sinusoidal rate",
        caption="A static model jumps where the rate changes its sign. In a dynamic one the "
        "bristles reverse first: the torque comes late, without a jump, on different branches for "
        "rising and falling rate." + (f" {WHAT_IS_LEFT}" if left else ""),
        alt="Torque over rate for each model in one cycle of a sinusoidal rate, and near zero "
        "rate. There the static model jumps and the dynamic one makes a loop.",
        panels=(
            Panel(RATE, TORQUE, curves, "Whole cycle"),
            Panel(zoom, TORQUE, [_near(c, near) for c in curves], "Near zero rate", marks=mark),
            *([Panel(RATE, LEFT, left, "What compensation leaves")] if left else []),
        ),
        thesis=("4.14",),
        across=2,
    )


def _left(trials: Sequence[TrialData]) -> list[Curve]:
    """Friction less each compensation at the same rate; empty for several friction models."""
    plain = [item for item in trials if "compensation" not in item.trial.point]
    if len(plain) != 1:
        return []
    _, friction = cycle(plain[0])
    curves = []
    for item in trials:
        name = item.trial.point.get("compensation")
        if name is None:
            continue
        cut, torque = cycle(item)
        if len(torque) == len(friction):
            rest = closed(cut[LOAD_RATE], friction - torque)
            curves.append(Curve(*rest, source(item), str(name)))
    return curves


def _largest(rate: Array) -> float:
    """The largest of the samples that were not lost; 1 rad/s if all were lost."""
    known = rate[np.isfinite(rate)]
    return float(np.max(known)) if len(known) else 1.0


def _near(curve: Curve, rate: float) -> Curve:
    """The parts of a curve at rates up to twice `rate`, with gaps between them.

    A drawing shows a limited number of points of a curve; all of them are near zero rate then.
    """
    inside = np.flatnonzero(np.abs(curve.x) <= 2.0 * rate)
    parts = np.split(inside, np.flatnonzero(np.diff(inside) > 1) + 1)
    gap = np.array([np.nan])
    x = np.concatenate([np.append(curve.x[part], gap) for part in parts])
    y = np.concatenate([np.append(curve.y[part], gap) for part in parts])
    return Curve(x, y, curve.label, curve.series, curve.style)


def variation_figures(trials: Sequence[TrialData]) -> Iterator[Figure]:
    """Parameters that steady sliding does not show (Figure 5.12), and the others (5.13)."""
    by_parameter: dict[str, list[TrialData]] = {}
    for item in trials:
        by_parameter.setdefault(str(item.trial.point["parameter"]), []).append(item)
    plain = by_parameter.pop(UNCHANGED, [])
    dynamic = {name: items for name, items in by_parameter.items() if _is_dynamic(items, plain)}
    static = {name: items for name, items in by_parameter.items() if name not in dynamic}
    if dynamic:
        yield Figure(
            key="dynamic-parameters",
            title="Output of the model for variations of its dynamic parameters",
            caption="Only near zero rate: steady sliding does not depend on these parameters. They "
            "determine how the torque reverses.",
            alt="Torque over rate near zero for lower, unchanged and higher values, one panel per "
            "dynamic parameter.",
            panels=tuple(_variation(name, items, plain, True) for name, items in dynamic.items()),
            thesis=("5.12",),
            across=2,
        )
    if static:
        yield Figure(
            key="static-parameters",
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
    ordered = sorted((*varied, *plain), key=lambda item: number_of(item.trial, "factor"))
    curves = []
    for item in ordered:
        factor = number_of(item.trial, "factor")
        cut, torque = cycle(item)
        series = "reference" if factor == 1.0 else f"factor {factor:g}"
        label = UNCHANGED if factor == 1.0 else f"× {factor:g}"
        curves.append(Curve(*closed(cut[LOAD_RATE], torque), label, series))
    largest = _largest(curves[0].x)
    shown = NEAR_ZERO * largest if near_zero else largest
    axis = Axis(RATE.label, "rad/s", "deg/s", limits=(-1.02 * shown, 1.02 * shown))
    if near_zero:
        curves = [_near(curve, shown) for curve in curves]
    return Panel(axis, TORQUE, curves, _symbol(parameter))
