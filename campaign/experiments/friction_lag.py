"""Friction lag: friction over a rate that swings above zero, in loops around the Stribeck curve.

The rate never changes its sign, so the contact always slides. Friction is larger while the rate
rises than while it falls, because the state of the contact follows the rate with a delay; the
faster the swing, the wider the loop (Figure 2.10).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from pydantic import Field

from campaign.channels import FRICTION_TORQUE, LOAD_RATE
from campaign.experiments.common import failures_note
from campaign.experiments.friction_models import Place, in_models, places
from campaign.experiments.interface import Experiment, TestData, TrialData, bench_of
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.physics.steady_friction import steady_friction
from campaign.result import (
    Array,
    Axis,
    Column,
    Curve,
    Figure,
    Finding,
    Panel,
    Result,
    Table,
    Value,
)
from campaign.signals import Polyline
from campaign.trial import Task, TrialRequest
from campaign.units import AngularRate, Frequency

OWN = ("frequency",)
PER_CYCLE = 400
"""Samples, and straight pieces of the prescribed rate, in a cycle."""

SLOW = 0.01
"""rad/s; rates up to here are shown in mrad/s."""


class FrictionLagOptions(Options):
    """Options of a friction-lag test."""

    mean_rate: AngularRate = Field(default=0.04, gt=0)
    """Rate around which the swing goes."""
    amplitude: AngularRate = Field(default=0.035, gt=0)
    """Amplitude of the swing; below the mean rate, so that the load never stops."""
    frequencies: tuple[Frequency, ...] = Field(default=(1.0, 5.0, 20.0), min_length=1)
    """Frequencies of the swing."""
    cycles: int = Field(default=4, ge=2, le=1000)
    """Cycles of the swing; the last one is measured."""
    models: tuple[str, ...] = ()
    """Friction models to describe the bench's friction by, one after the other; none: its own."""


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
            )


def swing(options: FrictionLagOptions, frequency: float) -> Polyline:
    """From rest up to the lowest rate within one cycle, and from there the cycles of the swing."""
    phase = np.arange(options.cycles * PER_CYCLE + 1) / PER_CYCLE
    rate = options.mean_rate - options.amplitude * np.cos(2.0 * np.pi * phase)
    times = (0.0, *((1.0 + phase) / frequency))
    return Polyline(times=tuple(map(float, times)), values=(0.0, *map(float, rate)))


@dataclass(frozen=True)
class Loop:
    """The last cycle at one frequency: rate (rad/s) and friction (N m), shape (n,).

    Attributes:
        width: friction while the rate rises less friction while it falls, at the mean rate (N m).
        widest: the largest such difference over all rates (N m).
        area: enclosed by the loop (N m rad/s); no energy, but a measure of the lag.
    """

    frequency: float
    rate: Array
    friction: Array
    width: float
    widest: float
    area: float


def _loop(data: TrialData) -> Loop:
    options = FrictionLagOptions.model_validate(data.trial.options, context={"si": True})
    cut = data.recording().window(*data.trial.task.window)
    rate, friction = cut[LOAD_RATE], cut[FRICTION_TORQUE]
    top = int(np.argmax(rate))
    common = options.mean_rate + options.amplitude * np.linspace(-0.98, 0.98, 99)
    rising = np.interp(common, rate[: top + 1], friction[: top + 1])
    falling = np.interp(common, rate[top:][::-1], friction[top:][::-1])
    difference = rising - falling
    closed_rate, closed = np.append(rate, rate[0]), np.append(friction, friction[0])
    return Loop(
        frequency=float(str(data.trial.point["frequency"])),
        rate=closed_rate,
        friction=closed,
        width=float(difference[len(common) // 2]),
        widest=float(difference[np.argmax(np.abs(difference))]),
        area=float(np.trapezoid(closed, closed_rate)),
    )


def _analyse(data: TestData) -> Result:
    found = places(data.completed(), OWN)
    if not found:
        return Result(notes=failures_note(data))
    loops = [
        (place, sorted(map(_loop, place.trials), key=lambda o: o.frequency)) for place in found
    ]
    rows: list[dict[str, Value]] = [
        {
            **place.point,
            "frequency": loop.frequency,
            "width": loop.width,
            "widest": loop.widest,
            "area": loop.area,
        }
        for place, own in loops
        for loop in own
    ]
    table = Table(
        key="friction-lag",
        title="Width of the loops of friction lag",
        columns=(
            *found[0].columns,
            Column("frequency", "Frequency", "Hz", "Hz"),
            Column("width", "Width at the mean rate", "N m", "N m"),
            Column("widest", "Largest width", "N m", "N m"),
            Column("area", "Area of the loop", "N m rad/s", "N m rad/s"),
        ),
        rows=tuple(rows),
        note="Width: friction while the rate rises less friction while it falls, at the same rate.",
    )
    findings = tuple(
        Finding(
            "friction_lag_width", loop.width, "N m", {**place.point, "frequency": loop.frequency}
        )
        for place, own in loops
        for loop in own
    )
    figure = Figure(
        key="friction-lag",
        title="Friction lag around the Stribeck curve",
        caption="The rate swings above zero. Friction is larger on the way up than on the way "
        "down, and the loop widens with the frequency; a static model has no loop and stays on "
        "the curve of steady sliding.",
        alt="Friction torque over rate: one loop per frequency around the curve of steady sliding.",
        panels=tuple(_panel(place, own) for place, own in loops),
        thesis=("2.10",),
        across=min(2, len(loops)),
    )
    return Result((table,), (figure,), findings, failures_note(data))


def _panel(place: Place, loops: list[Loop]) -> Panel:
    curves = [
        Curve(loop.rate, loop.friction, f"{loop.frequency:.4g} Hz", f"loop-{number}")
        for number, loop in enumerate(loops)
    ]
    fine = np.linspace(min(loop.rate.min() for loop in loops), loops[0].rate.max(), 300)
    steady = np.add(*steady_friction(bench_of(place.trials[0].trial), fine))
    curves.append(Curve(fine, steady, "steady sliding", "reference", "thin"))
    display = "mrad/s" if fine[-1] < SLOW else "deg/s"
    return Panel(
        Axis("Rate", "rad/s", display), Axis("Friction torque", "N m", "N m"), curves, place.label
    )


EXPERIMENT = Experiment(
    name="friction_lag",
    summary="friction over a rate that swings above zero: loops that widen (Figure 2.10)",
    options=FrictionLagOptions,
    trials=_trials,
    analyse=_analyse,
    requires={FRICTION_TORQUE: "the loops", LOAD_RATE: "the loops"},
)
