"""The Stribeck curve, measured: friction of steady sliding at many constant speeds.

The load is moved at each speed exactly as prescribed, without a drive, in both directions. Once the
bristles have settled, the friction torque lies on the curve that the model promises for steady
sliding (Figure 2.9, Equation 4.6); what the measurement adds is that it does get there.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from pydantic import Field

from campaign.channels import FRICTION_TORQUE, LOAD_RATE
from campaign.experiments.common import failures_note
from campaign.experiments.friction_models import Place, in_models, places
from campaign.experiments.interface import Experiment, TestData, bench_of
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
from campaign.units import Angle, AngularRate, Frequency, Time

OWN = ("speed",)
RAMP = 0.1
"""s, from rest to the speed."""
SHOWN = 1.5
"""Share of the fastest speed that has no point but is drawn, either way."""


def default_speeds() -> tuple[float, ...]:
    """25 speeds at equal ratios from 0.001 to 1 rad/s."""
    return tuple(float(speed) for speed in np.geomspace(1e-3, 1.0, 25))


class StribeckCurveOptions(Options):
    """Options of a Stribeck-curve test."""

    speeds: tuple[AngularRate, ...] = Field(
        default_factory=default_speeds, min_length=1, max_length=10_000
    )
    """Constant speeds; each is run in both directions."""
    settle_angle: Angle = Field(default=0.02, ge=0)
    """Travel before a reading: many times what the bristles deflect."""
    settle_time: Time = Field(default=0.2, ge=0)
    """Shortest time at constant speed before a reading."""
    window_time: Time = Field(default=0.1, gt=0)
    """Length of the reading."""
    sample_rate: Frequency = Field(default=1000.0, gt=0, le=100_000)
    """Rate of the recording."""
    models: tuple[str, ...] = ()
    """Friction models to describe the bench's friction by, one after the other; none: its own."""


def _trials(options: StribeckCurveOptions, bench: Bench) -> Iterator[TrialRequest]:
    if options.window_time * options.sample_rate < 1:
        raise ValueError("the window holds no sample; raise window_time or sample_rate")
    for point, tree in in_models(bench, options.models):
        for speed in options.speeds:
            if speed <= 0:
                raise ValueError("speeds are positive; each is run in both directions")
            settled = RAMP + max(options.settle_time, options.settle_angle / speed)
            stop = settled + options.window_time
            for rate in (speed, -speed):
                yield TrialRequest(
                    Task(
                        mode="prescribed",
                        command=Polyline(times=(0.0, RAMP), values=(0.0, rate)),
                        duration=stop,
                        window=(settled, stop),
                        sample_rate=options.sample_rate,
                        start_angle=-0.5 * rate * (stop - 0.5 * RAMP),
                    ),
                    point={**point, "speed": rate},
                    bench=tree,
                )


def _points(place: Place) -> tuple[Array, Array]:
    """Rate (rad/s) and mean friction torque (N m) of each run, both signed; (n,), by rate."""
    points = []
    for item in place.trials:
        cut = item.recording().window(*item.trial.task.window)
        points.append((float(np.mean(cut[LOAD_RATE])), float(np.mean(cut[FRICTION_TORQUE]))))
    rate, torque = np.array(sorted(points)).T
    return rate, torque


def _analyse(data: TestData) -> Result:
    found = places(data.completed(), OWN)
    if not found:
        return Result(notes=failures_note(data))
    rows: list[dict[str, Value]] = []
    findings, panels = [], []
    for place in found:
        rate, torque = _points(place)
        promised = np.add(*steady_friction(bench_of(place.trials[0].trial), rate))
        rows += [
            {
                **place.point,
                "rate": float(v),
                "torque": float(t),
                "curve": float(p),
            }
            for v, t, p in zip(rate, torque, promised, strict=True)
        ]
        largest = float(np.max(np.abs(torque / promised - 1.0)))
        findings.append(Finding("stribeck_deviation", largest, "", place.point))
        panels.append(_panel(place, rate, torque))
    worst = max(finding.value for finding in findings)
    table = Table(
        key="stribeck-curve",
        title="Friction of steady sliding",
        columns=(
            *found[0].columns,
            Column("rate", "Rate", "rad/s", "deg/s"),
            Column("torque", "Friction torque", "N m", "N m"),
            Column("curve", "Stribeck curve", "N m", "N m"),
        ),
        rows=tuple(rows),
        note=f"Measured torque and curve agree within {max(worst, 1e-12):.0e} of the torque.",
    )
    figure = Figure(
        key="stribeck-curve",
        title="Stribeck curve",
        caption="From rest, friction first falls as the contact slides faster (velocity weakening) "
        "and then rises with the viscous part (velocity strengthening). The points are measured "
        "in steady sliding, the lines are the model's own curve and its two parts.",
        alt="Friction torque over speed on a logarithmic axis: points measured in both directions "
        "on the line of the model, which falls from static to Coulomb friction and rises again.",
        panels=tuple(panels),
        thesis=("2.9",),
        across=min(2, len(panels)),
    )
    return Result((table,), (figure,), tuple(findings), failures_note(data))


def _panel(place: Place, rate: Array, torque: Array) -> Panel:
    bench = bench_of(place.trials[0].trial)
    speed = np.abs(rate)
    fine = np.geomspace(speed.min() / SHOWN, speed.max() * SHOWN, 400)
    dry, viscous = steady_friction(bench, fine)
    forwards, backwards = rate > 0, rate < 0
    curves = [
        Curve(fine, dry + viscous, "s(v) + σ2 v", "fit"),
        Curve(fine, dry, "Stribeck part s(v)", "alternative", "thin"),
        Curve(fine, viscous, "viscous part σ2 v", "reference", "thin"),
        Curve(speed[forwards], torque[forwards], "positive direction", "positive", "points"),
        Curve(speed[backwards], -torque[backwards], "negative direction", "negative", "points"),
    ]
    lower = -np.add(*steady_friction(bench, -fine))
    if not np.allclose(lower, dry + viscous):
        curves.insert(1, Curve(fine, lower, "the same, negative direction", "fit-2"))
    return Panel(
        Axis("Speed", "rad/s", "deg/s", scale="log"),
        Axis("Friction torque", "N m", "N m"),
        curves,
        place.label,
    )


EXPERIMENT = Experiment(
    name="stribeck_curve",
    summary="friction of steady sliding at constant speeds, beside the model's curve (Figure 2.9)",
    options=StribeckCurveOptions,
    trials=_trials,
    analyse=_analyse,
    requires={FRICTION_TORQUE: "the friction of each point", LOAD_RATE: "the rate of each point"},
)
