"""Moving the axis to an angle, or to and fro as a warm-up; not analyzed."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Literal

import numpy as np
from pydantic import Field

from campaign.channels import RELATIVE_ANGLE
from campaign.estimation.intervals import of_series, shifted_by
from campaign.estimation.sampled_curve import shifted
from campaign.experiments.interface import Experiment, TestData, TrialData, bench_of, validated
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.result import Cell, Column, Result, Table
from campaign.signals import Polyline
from campaign.trial import Role, Task, TrialRequest
from campaign.units import Angle, AngularAcceleration, AngularRate, Frequency, Time

LOOKED_AT = 0.1
"""Time (s) at the end of a trial over which the reached angle is averaged."""


class MoveOptions(Options):
    """Options of a move."""

    angle: Angle
    """Target angle of the load relative to the hull."""
    position: Angle = 0.0
    """Start angle of the load relative to the hull."""
    speed: AngularRate = Field(default=math.radians(5.0), gt=0)
    """Rate between the ramps; a short move does not reach it."""
    acceleration: AngularAcceleration = Field(default=math.radians(20.0), gt=0)
    """Acceleration of both ramps."""
    role: Literal["home", "warm-up"] = "home"
    """Purpose: moves the axis to the start of the next test, or warms it up."""
    cycles: int = Field(default=0, ge=0, le=10_000)
    """Number of moves there and back; 0: there only."""
    rest: Time = Field(default=0.5, ge=0.2)
    """Standstill after each move."""
    sample_rate: Frequency = Field(default=1000.0, gt=0, le=100_000)
    """Rate of the recording."""


def trapezoid(travel: float, speed: float, acceleration: float) -> tuple[float, float, float]:
    """Duration of a ramp (s), of the stretch between the ramps (s), and the rate there (rad/s).

    The integral over both ramps and the stretch is `travel` (rad), of either sign. A travel too
    short for `speed` (rad/s) gives a triangle.
    """
    distance = abs(travel)
    peak = min(speed, math.sqrt(distance * acceleration))
    ramp = peak / acceleration
    stretch = max(0.0, distance / peak - ramp)
    return ramp, stretch, math.copysign(peak, travel)


def _trials(options: MoveOptions, bench: Bench) -> Iterator[TrialRequest]:
    travel = options.angle - options.position
    if travel == 0:
        raise ValueError("'angle' and 'position' are equal: there is nothing to move")
    if options.role == "warm-up" and not options.cycles:
        raise ValueError("a warm-up goes to and fro: set cycles")
    travels = [travel, -travel] * options.cycles or [travel]
    times, values = [0.0], [0.0]
    for distance in travels:
        ramp, stretch, rate = trapezoid(distance, options.speed, options.acceleration)
        for step, value in ((ramp, rate), (stretch, rate), (ramp, 0.0), (options.rest, 0.0)):
            times.append(times[-1] + step)
            values.append(value)
    yield TrialRequest(
        Task(
            mode="rate",
            command=Polyline(times=tuple(times), values=tuple(values)),
            duration=times[-1],
            window=(times[-1] - options.rest, times[-1]),
            sample_rate=options.sample_rate,
            start_angle=options.position,
        ),
        role=Role(options.role),
        can_use=(RELATIVE_ANGLE,),
    )


def _analyse(data: TestData) -> Result:
    rows = [_row(item) for item in data.trials if item.ending.outcome == "completed"]
    if not rows:
        return Result()
    table = Table(
        key="moves",
        title="Positions of the axis after moves",
        columns=(
            Column("trial", "Trial"),
            Column("role", "Role"),
            Column("target", "End of the command", "rad", "deg", exact=True),
            Column("reached", "Reached", "rad", "deg"),
            Column("deviation", "Deviation", "rad", "deg"),
        ),
        rows=tuple(rows),
        note="The rate loop follows a rate; what friction holds back on the way, it does not undo.",
    )
    return Result((table,))


def _row(data: TrialData) -> dict[str, Cell]:
    options = validated(MoveOptions, data.trial.options)
    target = options.position if options.cycles else options.angle
    recording = data.recording()
    row: dict[str, Cell] = {"trial": data.trial.name, "role": data.trial.role.value}
    row |= {"target": target, "reached": None, "deviation": None}
    if RELATIVE_ANGLE not in recording.channels:
        return row
    last = recording[RELATIVE_ANGLE][recording.time >= data.trial.task.duration - LOOKED_AT]
    if last.size and np.isfinite(last).all():
        count = bench_of(data.trial).sensors.encoder.resolution
        reached = of_series("reached", last, "rad")
        if count > 0:
            # A standing axis shows one count, for any position within that count.
            reached = shifted_by(reached, "resolution of the encoder", count / math.sqrt(12.0))
        row |= {"reached": reached, "deviation": shifted("deviation", reached, -target)}
    return row


EXPERIMENT = Experiment(
    name="move",
    summary="a move to an angle, or moves back and forth as a warm-up; no measurement",
    options=MoveOptions,
    trials=_trials,
    analyse=_analyse,
    can_use={RELATIVE_ANGLE: "angle reached, and no deviation from the command's end"},
)
