"""Output of a compensation's model with one changed parameter (Figures 5.12, 5.13).

The model runs alone on a prescribed sinusoidal rate, without plant and loop: unchanged, and with
each parameter lower and higher. Presliding parameters are shown over time around a reversal,
sliding parameters over the rate.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np

from campaign.channels import COMPENSATION_TORQUE, RELATIVE_RATE
from campaign.estimate import Window
from campaign.experiments.interface import TrialData, with_samples
from campaign.experiments.shared.common import method_label, number_of
from campaign.experiments.shared.friction_models import PARAMETER_LABELS
from campaign.physics.bench import Bench
from campaign.recording import Recording
from campaign.result import Axis, Curve, Figure, Panel
from campaign.signals import Sine
from campaign.trial import Task, TrialRequest

CYCLES = 1.5
"""Cycles of the prescribed rate; the second reversal is shown, when the bristles move."""
AROUND = 0.05
"""Share of a cycle that is shown before that reversal; twice as much is shown after it."""
REVERSAL = "reversal"
CYCLE = "cycle"
SLOW = 0.35
"""Half width of the rate axis, as a share of the largest rate, for the Stribeck effect."""
FAST = ("viscous_friction",)
DYNAMIC = ("bristle_stiffness", "bristle_damping")


def model_trials(
    bench: Bench,
    options: Any,
    parameters: Sequence[str],
    varied: Callable[[Bench, Any, str, float], Any],
) -> Iterator[TrialRequest]:
    """Trials of the unchanged model, and of each parameter lower and higher by `model_change`."""
    amplitude = options.acceleration / (2 * np.pi * options.frequency)
    duration = CYCLES / options.frequency
    task = Task(
        mode="prescribed",
        command=Sine(amplitude=amplitude, frequency=options.frequency),
        compensation=options.compensation,
        duration=duration,
        window=(0.0, duration),
        sample_rate=options.sample_rate,
    )
    size = options.model_change
    places = [("", 0.0)] + [(p, c) for p in parameters for c in (-size, size)]
    for parameter, change in places:
        try:
            tree = varied(bench, options, parameter, change) if parameter else None
        except ValueError:  # a change that the bench refuses
            continue
        yield TrialRequest(
            task,
            point={"parameter": parameter, "change": change, "repetition": 1},
            note="the model alone, at a prescribed rate",
            bench=tree,
            windows=model_windows(task),
            requires=(),  # used in figures only
            can_use=(COMPENSATION_TORQUE, RELATIVE_RATE),
        )


def model_windows(task: Task) -> tuple[Window, Window]:
    """Windows of the model's output, for the plan and for archived trials without windows.

    The reversal after half a cycle, at a third of its window, and one whole cycle.
    """
    command = task.command
    frequency = command.frequency if isinstance(command, Sine) else 1.0
    middle, around = 0.5 / frequency, AROUND / frequency
    return (
        Window(REVERSAL, middle - around, middle + 2 * around),
        Window(CYCLE, middle, 1.5 / frequency),
    )


def _cut(data: TrialData, name: str) -> tuple[Window, Recording]:
    """A window of the trial and the recording within it."""
    windows = (*data.trial.windows, *model_windows(data.trial.task))
    window = next(each for each in windows if each.name == name)
    return window, data.recording().window(window.start, window.stop)


def model_figures(measured: Sequence[TrialData], compensation: str) -> Iterator[Figure]:
    """Figures 5.12 and 5.13 from the trials of `model_trials`, as far as their channels allow."""
    runs: dict[str, dict[float, TrialData]] = {}
    for data in with_samples(measured):
        if data.trial.task.mode == "prescribed":
            by_change = runs.setdefault(str(data.trial.point["parameter"]), {})
            by_change[number_of(data.trial, "change")] = data
    plain = runs.pop("", {}).get(0.0)
    if plain is None:
        return
    dynamic = [name for name in runs if name in DYNAMIC]
    static = [name for name in runs if name not in DYNAMIC]
    shown = [plain, *(data for by_change in runs.values() for data in by_change.values())]
    recorded = frozenset.intersection(*(data.channel_names() for data in shown))
    if COMPENSATION_TORQUE not in recorded:
        return
    if RELATIVE_RATE not in recorded:
        static = []
    if dynamic:
        yield Figure(
            key="model-dynamic",
            title=f"Output of the {method_label(compensation)}: parameters of presliding",
            caption="Around a reversal of a sinusoidal rate. Stiffer bristles forget the reversal "
            "sooner; with more damping the torque overshoots after it. Away from the reversal "
            "the curves are one: steady sliding knows neither parameter.",
            alt="Model friction torque over time around a reversal, for lower, unchanged and "
            "higher bristle stiffness and bristle damping.",
            panels=tuple(_panel(name, {**runs[name], 0.0: plain}, _reversal) for name in dynamic),
            thesis=("5.12",),
            across=2,
        )
    if static:
        yield Figure(
            key="model-static",
            title=f"Output of the {method_label(compensation)}: parameters of sliding",
            caption="Over one cycle of a sinusoidal rate. The Coulomb torque moves the whole "
            "curve, the static torque only its slow part, and the Stribeck velocity says how slow "
            "that is. Viscous friction shows at high rates only, so its panel reaches further.",
            alt="Model friction torque over rate, for lower, unchanged and higher values of each "
            "static parameter, one panel per parameter.",
            panels=tuple(
                _panel(name, {**runs[name], 0.0: plain}, partial(_over_rate, share=share))
                for name in static
                for share in [1.0 if name in FAST else SLOW]
            ),
            thesis=("5.13",),
            across=2,
        )


View = Callable[[TrialData], tuple[Axis, Any, Any]]


def _panel(name: str, runs: dict[float, TrialData], view: View) -> Panel:
    torque = Axis("Model torque", "N m", "N m")
    curves, axis = [], Axis("")
    for change, data in sorted(runs.items()):
        axis, x, y = view(data)
        series = "reference" if change == 0 else ("low" if change < 0 else "high")
        label = "unchanged" if change == 0 else f"{change:+.0%}".replace("-", "−")
        curves.append(Curve(x, y, label, series))
    title = PARAMETER_LABELS.get(name, name)
    return Panel(axis, torque, curves, title[:1].upper() + title[1:])


def _reversal(data: TrialData) -> tuple[Axis, Any, Any]:
    """Torque around the reversal after half a cycle, over the time from it."""
    window, cut = _cut(data, REVERSAL)
    middle = window.start + (window.stop - window.start) / 3
    axis = Axis("Time from the reversal", "s", "s")
    return axis, cut.time - middle, cut[COMPENSATION_TORQUE]


def _over_rate(data: TrialData, share: float) -> tuple[Axis, Any, Any]:
    """Torque over rate, one whole cycle, with an axis up to a share of the largest rate."""
    _, cut = _cut(data, CYCLE)
    rate = cut[RELATIVE_RATE]
    largest = share * float(np.max(np.abs(rate), initial=0.0))
    limits = (-largest, largest) if largest > 0 else None
    axis = Axis("Rate", "rad/s", "deg/s", limits=limits)
    return axis, rate, cut[COMPENSATION_TORQUE]
