"""Stick-slip: the load pulled through a spring whose far end moves at a constant rate.

The load sticks while the spring is wound up, breaks loose at the static torque, overtakes the
spring because sliding friction is smaller, and sticks again (Figure 2.12).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from pydantic import Field

from campaign.channels import COMMAND, DRIVE_TORQUE, LOAD_RATE, RELATIVE_ANGLE
from campaign.experiments.common import failures_note
from campaign.experiments.friction_models import in_models, model_series, places
from campaign.experiments.interface import Experiment, TestData, TrialData
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.result import Axis, Column, Curve, Figure, Finding, Panel, Result, Table, Value
from campaign.signals import Polyline
from campaign.trial import Recording, Task, TrialRequest
from campaign.units import AngularRate, Frequency, RotationalStiffness, Time


class StickSlipOptions(Options):
    """Options of a stick-slip test."""

    stiffness: RotationalStiffness = Field(default=100.0, gt=0)
    """Of the spring."""
    pull_rate: AngularRate = Field(default=0.02, gt=0)
    """Rate of the spring's far end."""
    duration: Time = Field(default=60.0, gt=0)
    """Length of the pull."""
    slip_rate: AngularRate = Field(default=0.02, gt=0)
    """Rate of the load that counts as a slip."""
    sample_rate: Frequency = Field(default=1000.0, gt=0, le=100_000)
    """Rate of the recording; slips are timed to one sample."""
    models: tuple[str, ...] = ()
    """Friction models to describe the bench's friction by, one after the other; none: its own."""


def _trials(options: StickSlipOptions, bench: Bench) -> Iterator[TrialRequest]:
    far = options.pull_rate * options.duration
    for point, tree in in_models(bench, options.models):
        yield TrialRequest(
            Task(
                mode="spring",
                spring_stiffness=options.stiffness,
                command=Polyline(times=(0.0, options.duration), values=(0.0, far)),
                duration=options.duration,
                window=(0.0, options.duration),
                sample_rate=options.sample_rate,
            ),
            point=point,
            bench=tree,
        )


@dataclass(frozen=True)
class StickSlip:
    """What one pull shows; NaN where it never came to that.

    Attributes:
        slips: how many there were.
        first_slip: time of the first (s).
        period: mean time between slips (s). The first is left out: its spring began unstretched.
        peak_torque: largest torque of the spring (N m).
        top_rate: largest rate of the load (rad/s).
    """

    slips: int
    first_slip: float
    period: float
    peak_torque: float
    top_rate: float


def slip_times(recording: Recording, slip_rate: float) -> list[float]:
    """Times (s) at which the load passes `slip_rate` (rad/s) upwards."""
    fast = recording[LOAD_RATE] > slip_rate
    return [float(t) for t in recording.time[1:][fast[1:] & ~fast[:-1]]]


def _measure(data: TrialData) -> StickSlip:
    options = StickSlipOptions.model_validate(data.trial.options, context={"si": True})
    recording = data.recording()
    times = slip_times(recording, options.slip_rate)
    return StickSlip(
        slips=len(times),
        first_slip=times[0] if times else float("nan"),
        period=float(np.mean(np.diff(times[1:]))) if len(times) > 2 else float("nan"),
        peak_torque=float(np.max(recording[DRIVE_TORQUE])),
        top_rate=float(np.max(recording[LOAD_RATE])),
    )


UNITS = {"first_slip": "s", "period": "s", "peak_torque": "N m", "top_rate": "rad/s"}


def _analyse(data: TestData) -> Result:
    found = places(data.completed(), own=())
    if not found:
        return Result(notes=failures_note(data))
    measured = [(place, _measure(place.trials[0])) for place in found]
    rows: list[dict[str, Value]] = [{**place.point, **vars(m)} for place, m in measured]
    table = Table(
        key="stick-slip",
        title="Stick-slip of a load pulled through a spring",
        columns=(
            *found[0].columns,
            Column("slips", "Slips"),
            Column("first_slip", "First slip", "s", "s"),
            Column("period", "Period", "s", "s"),
            Column("peak_torque", "Largest torque of the spring", "N m", "N m"),
            Column("top_rate", "Largest rate of the load", "rad/s", "rad/s"),
        ),
        rows=tuple(rows),
        note="The period is the mean time between slips after the first one, which started from "
        "an unstretched spring.",
    )
    findings = tuple(
        Finding(f"stick_slip_{quantity}", float(getattr(m, quantity)), unit, place.point)
        for place, m in measured
        for quantity, unit in UNITS.items()
    )
    notes = tuple(
        f"{place.label or 'The load'}: fewer than three slips, so there is no period; pull longer, "
        "slower, or through a softer spring."
        for place, m in measured
        if m.slips < 3
    )
    shown = [(place.label, str(place.point.get("model", "")), place.trials[0]) for place in found]
    return Result((table,), (_figure(shown),), findings, failures_note(data) + notes)


def _figure(shown: list[tuple[str, str, TrialData]]) -> Figure:
    time = Axis("Time", "s", "s")
    torque, rate, angle = [], [], []
    for label, model, item in shown:
        recording = item.recording()
        series = model_series(model) or "measured"
        torque.append(Curve(recording.time, recording[DRIVE_TORQUE], label, series))
        rate.append(Curve(recording.time, recording[LOAD_RATE], label, series))
        if RELATIVE_ANGLE in recording.channels:
            angle.append(Curve(recording.time, recording[RELATIVE_ANGLE], label, series))
    if COMMAND in recording.channels:
        angle.append(Curve(recording.time, recording[COMMAND], "end of the spring", "reference"))
    angles = (Panel(time, Axis("Angle", "rad", "rad"), angle, "Angle of the load"),)
    return Figure(
        key="stick-slip",
        title="Stick-slip motion",
        caption="The spring is wound up while the load sticks; then the load slips, faster than "
        "it is pulled, and sticks again before the spring is slack.",
        alt="Torque of the spring as a sawtooth, rate of the load as one pulse per slip, and angle "
        "of the load as a staircase under the straight line of the spring's end.",
        panels=(
            Panel(time, Axis("Spring torque", "N m", "N m"), torque, "Torque of the spring"),
            Panel(time, Axis("Rate", "rad/s", "rad/s"), rate, "Rate of the load"),
            *(angles if angle else ()),
        ),
        thesis=("2.12",),
    )


EXPERIMENT = Experiment(
    name="stick_slip",
    summary="a load pulled through a spring: period, first slip, peaks (Figure 2.12)",
    options=StickSlipOptions,
    trials=_trials,
    analyse=_analyse,
    requires={
        LOAD_RATE: "the slips",
        DRIVE_TORQUE: "the torque of the spring",
    },
    can_use={
        RELATIVE_ANGLE: "angle of the load in the figure",
        COMMAND: "far end of the spring in the figure",
    },
)
