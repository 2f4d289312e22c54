"""Friction lag: loops of friction over a positive, oscillating rate.

The rate never changes its sign, so the contact always slides. Friction is larger while the rate
rises than while it falls, because the state of the contact follows the rate with a delay; the
faster the swing, the wider the loop (Figure 2.10).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import Field

from campaign.channels import FRICTION_TORQUE, LOAD_RATE
from campaign.estimate import Estimate, Window
from campaign.estimation.gate import admitted
from campaign.estimation.intervals import of_repeats, shifted_by
from campaign.estimation.sampled_curve import LOST, SAMPLES, drop_interval_if_deterministic
from campaign.experiments.interface import Experiment, TestData, TrialData, bench_of, validated
from campaign.experiments.shared.captions import amount, listed, sentence, surely_above, trials_of
from campaign.experiments.shared.common import closed, number_of
from campaign.experiments.shared.friction_models import (
    OF_ONE,
    ConditionGroup,
    combined,
    in_models,
    places,
    resolved,
    simulated,
)
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.physics.steady_friction import steady_friction
from campaign.result import Array, Axis, Column, Curve, Figure, Finding, Panel, Result, Table
from campaign.signals import Polyline
from campaign.trial import Task, TrialRequest
from campaign.units import AngularRate, Frequency

OWN = ("frequency",)
METRICS = {
    "friction_lag_width": "N m",
    "friction_lag_widest": "N m",
    "friction_lag_area": "N m rad/s",
}
"""Metrics of one recording, with their units."""
COLUMNS = ("frequency", "width", "widest", "area")
PER_CYCLE = 400
"""Samples, and linear segments of the prescribed rate, in a cycle."""

SLOW = 0.01
"""rad/s; rates up to here are shown in mrad/s."""


class FrictionLagOptions(Options):
    """Options of a friction-lag test."""

    mean_rate: AngularRate = Field(default=0.04, gt=0)
    """Mean rate of the oscillation."""
    amplitude: AngularRate = Field(default=0.035, gt=0)
    """Amplitude of the oscillation; below the mean rate, so that the load never stops."""
    frequencies: tuple[Frequency, ...] = Field(default=(1.0, 5.0, 20.0), min_length=1)
    """Frequencies of the oscillation."""
    cycles: int = Field(default=4, ge=2, le=1000)
    """Cycles of the oscillation; the first one is not measured."""
    models: tuple[str, ...] = ()
    """Friction models to describe the bench's friction, one by one; none: its own."""


def _trials(options: FrictionLagOptions, bench: Bench) -> Iterator[TrialRequest]:
    if options.amplitude >= options.mean_rate:
        raise ValueError("the amplitude must be below the mean rate, or the load stops")
    for point, tree in in_models(bench, options.models):
        for frequency in options.frequencies:
            if frequency <= 0:
                raise ValueError("frequencies are positive")
            cycle = 1.0 / frequency
            stop = (1 + options.cycles) * cycle
            yield TrialRequest(
                Task(
                    mode="prescribed",
                    command=swing(options, frequency),
                    duration=stop,
                    window=(stop - cycle, stop),
                    sample_rate=PER_CYCLE * frequency,
                    start_angle=-0.5 * options.mean_rate * stop,
                ),
                point={**point, "frequency": frequency},
                bench=tree,
                windows=cycle_windows(options, frequency),
            )


def cycle_windows(options: FrictionLagOptions, frequency: float) -> tuple[Window, ...]:
    """The cycles that are measured: all but the first, in which the contact settles."""
    return tuple(
        Window(f"cycle-{cycle}", cycle / frequency, (cycle + 1) / frequency)
        for cycle in range(2, options.cycles + 1)
    )


def swing(options: FrictionLagOptions, frequency: float) -> Polyline:
    """Rate command: from rest to the lowest rate within one cycle, then the cycles of the swing."""
    phase = np.arange(options.cycles * PER_CYCLE + 1) / PER_CYCLE
    rate = options.mean_rate - options.amplitude * np.cos(2.0 * np.pi * phase)
    times = (0.0, *((1.0 + phase) / frequency))
    return Polyline(times=tuple(map(float, times)), values=(0.0, *map(float, rate)))


@dataclass(frozen=True)
class Loop:
    """The loops at one frequency: rate (rad/s) and friction (N m) of the last one, shape (n,).

    Attributes:
        width: friction while the rate rises less friction while it falls, at the mean rate (N m).
        widest: the largest such difference over all rates (N m).
        area: enclosed by the loop (N m rad/s); no energy, but a measure of the lag.
    """

    frequency: float
    rate: Array
    friction: Array
    width: Estimate
    widest: Estimate
    area: Estimate

    @property
    def is_flat(self) -> bool:
        """Whether friction is equal for rising and falling rates: a line without a direction."""
        return self.widest.value == 0.0


def _measure(data: TrialData) -> tuple[Estimate, ...]:
    """Width, largest width and area of the loops, each the mean of the cycles.

    Not determined where samples of a cycle were lost (NaN).
    """
    options = validated(FrictionLagOptions, data.trial.options)
    frequency = number_of(data.trial, "frequency")
    common = options.mean_rate + options.amplitude * np.linspace(-0.98, 0.98, 99)
    recording = data.recording()
    shapes, coarse = [], []
    for window in data.trial.windows or cycle_windows(options, frequency):
        cut = recording.window(window.start, window.stop)
        rate, friction = cut[LOAD_RATE], cut[FRICTION_TORQUE]
        if not (np.all(np.isfinite(rate)) and np.all(np.isfinite(friction))):
            return simulated(map(_lost, METRICS))
        shapes.append(loop_shape(rate, friction, common))
        coarse.append(loop_shape(rate[::2], friction[::2], common))
    # Errors of trapezoids and linear interpolation grow with the square of the sample step.
    errors = np.max(np.abs(np.array(coarse) - np.array(shapes)), axis=0) / 3.0
    torque = float(np.max(np.abs(friction)))
    scales = torque, torque, torque * options.amplitude
    each = zip(METRICS.items(), np.array(shapes).T, errors, scales, strict=True)
    return simulated(
        drop_interval_if_deterministic(_mean(name, values, unit, float(error)), scale)
        for (name, unit), values, error, scale in each
    )


def _lost(name: str) -> Estimate:
    return Estimate.without_interval(name, math.nan, METRICS[name], LOST())


def _mean(name: str, values: Array, unit: str, error: float) -> Estimate:
    """Mean of the cycles; `error`: of sampling, equal in each."""
    mean = of_repeats(name, values, unit, "cycles")
    return shifted_by(mean, SAMPLES, error / math.sqrt(3.0))


def loop_shape(rate: Array, friction: Array, common: Array) -> tuple[float, float, float]:
    """Width at the middle one of the rates `common`, largest width, and area of one cycle.

    rate, friction: shape (n,), from the lowest rate up and down again. A width is friction while
    the rate rises less friction while it falls, at the same rate.
    """
    top = int(np.argmax(rate))
    rising = np.interp(common, rate[: top + 1], friction[: top + 1])
    falling = np.interp(common, rate[top:][::-1], friction[top:][::-1])
    difference = rising - falling
    widest = float(difference[np.argmax(np.abs(difference))])
    closed_rate, closed_friction = closed(rate, friction)
    area = float(np.trapezoid(closed_friction, closed_rate))
    return float(difference[len(common) // 2]), widest, area


def _loop(frequency: float, trials: Sequence[TrialData]) -> Loop:
    estimates = combined(trials, _measure)
    cut = trials[0].recording().window(*trials[0].trial.task.window)
    rate, friction = closed(cut[LOAD_RATE], cut[FRICTION_TORQUE])
    largest = float(np.nanmax(np.abs(friction), initial=0.0))
    swing = 0.5 * float(np.ptp(trials[0].trial.task.command.sample(cut.time)))
    scales = largest, largest, largest * swing
    sizes = (admitted(estimates.get(name) or _lost(name)) for name in METRICS)
    return Loop(frequency, rate, friction, *map(resolved, sizes, scales))


def _analyse(data: TestData) -> Result:
    groups = places(data.completed(), OWN)
    if not groups:
        return Result()
    loops = [(place, [_loop(*each) for each in place.by("frequency").items()]) for place in groups]
    every = [(place.point, loop) for place, own in loops for loop in own]
    table = Table(
        key="friction-lag",
        title="Width of the loops of friction lag",
        columns=(
            *groups[0].columns,
            Column("frequency", "Frequency", "Hz", "Hz", exact=True),
            Column("width", "Width at the mean rate", "N m", "N m"),
            Column("widest", "Largest width", "N m", "N m"),
            Column("area", "Area of the loop", "N m rad/s", "N m rad/s"),
        ),
        rows=tuple(
            {**point, **{name: getattr(loop, name) for name in COLUMNS}} for point, loop in every
        ),
        note="Width: friction while the rate rises less friction while it falls, at the same rate. "
        "Each number is the mean of all cycles but the first. " + OF_ONE,
    )
    findings = tuple(
        Finding.of(loop.width, {**point, "frequency": loop.frequency}) for point, loop in every
    )
    figure = Figure(
        key="friction-lag",
        title="Friction lag around the Stribeck curve",
        caption="The rate stays above zero; arrows show which way a loop runs. "
        + " ".join(_what_shows(place, own) for place, own in loops),
        alt="Friction torque over rate: one loop per frequency around the curve of steady sliding.",
        panels=tuple(_panel(place, own) for place, own in loops),
        thesis=("2.10",),
        across=min(2, len(loops)),
        trials=trials_of(items[0] for place in groups for items in place.by("frequency").values()),
    )
    return Result((table,), (figure,), findings)


def _what_shows(place: ConditionGroup, loops: list[Loop]) -> str:
    """Caption sentence: widths of the loops at the mean rate."""
    start = f"{place.label}: " if place.label else ""
    known = [loop for loop in loops if math.isfinite(loop.width.value)]
    if not known:
        return ""
    if all(loop.is_flat for loop in known):
        return sentence(f"{start}no loop shows, friction is the same up and down")
    widths = [
        f"{amount(loop.width.value, 'N m', digits=2)} at {loop.frequency:.4g} Hz" for loop in known
    ]
    higher = all(surely_above(loop.width, 0.0) for loop in known)
    up, by = ("is higher than", " by") if higher else ("less that", ":")
    return sentence(f"{start}friction on the way up {up} on the way down{by} {listed(widths)}")


def _panel(place: ConditionGroup, loops: list[Loop]) -> Panel:
    curves = [
        Curve(loop.rate, loop.friction, name, name, "line" if loop.is_flat else "loop")
        for loop in loops
        for name in [f"{loop.frequency:.4g} Hz"]
    ]
    known = [rate for loop in loops if len(rate := loop.rate[np.isfinite(loop.rate)])]
    display = "deg/s"
    if known:
        fine = np.linspace(min(rate.min() for rate in known), known[0].max(), 300)
        steady = np.add(*steady_friction(bench_of(place.trials[0].trial), fine))
        curves.append(Curve(fine, steady, "steady sliding", "reference", "thin"))
        display = "mrad/s" if fine[-1] < SLOW else "deg/s"
    axis = Axis("Rate", "rad/s", display)
    return Panel(axis, Axis("Friction torque", "N m", "N m"), curves, place.label)


EXPERIMENT = Experiment(
    name="friction_lag",
    summary="friction over a rate that oscillates above zero: loop width (Figure 2.10)",
    options=FrictionLagOptions,
    trials=_trials,
    analyse=_analyse,
    perturbs_bench=True,
    requires={FRICTION_TORQUE: "the loops", LOAD_RATE: "the loops"},
    measure=_measure,
)
