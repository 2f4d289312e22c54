"""Any motion, as it was recorded: its course, its force, its tracking error, friction over rate.

For recordings that nobody planned as an experiment of this program. Friction is read where the axis
happens to slide steadily (Equation 4.1 without acceleration), in both directions; nothing is
claimed of the rest of the motion but what it was.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from pydantic import Field

from campaign.channels import (
    DRIVE_TORQUE,
    JOINT_TORQUE,
    NORMAL_LOAD,
    REFERENCE,
    RELATIVE_ANGLE,
    RELATIVE_RATE,
)
from campaign.estimate import Estimate
from campaign.estimation.steady_sliding import steady_sliding
from campaign.estimation.steady_stretches import FEWEST, SHORTEST_TIME, steady_stretches
from campaign.experiments.interface import Experiment, TestData, TrialData, bench_of, metrics
from campaign.experiments.motion.account import account_of
from campaign.experiments.motion.conclusions import motion_conclusions
from campaign.experiments.motion.figures import friction_figure, motion_figure
from campaign.experiments.motion.tables import (
    friction_table,
    line_findings,
    line_table,
    summary_table,
)
from campaign.experiments.shared.common import COUNTED, OF_RECORDING, failures_note
from campaign.experiments.shared.recorded_motion import nothing_to_plan
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.recording import Recording
from campaign.result import Result
from campaign.trial import Offered, Task, Trial, TrialRequest
from campaign.units import Length, Time

MOST_STRETCHES = 400
"""of one recording that are looked at; of more, as many evenly over all of it."""
CAN_USE = {
    RELATIVE_ANGLE: "position over time",
    REFERENCE: "tracking error",
    NORMAL_LOAD: "friction coefficient",
    JOINT_TORQUE: "friction without what accelerates the load",
}
"""Further channels, and what there is none of without them."""
MOST_SAMPLES = 10_000_000
"""of a recording that is looked at in one: at 1 kHz some three hours."""


class MotionOptions(Options):
    """Options of a recorded motion."""

    shortest: Time = Field(default=SHORTEST_TIME, gt=0)
    """Shortest steady stretch that friction is read from, where no windows are named."""
    radius: Length | None = Field(default=None, gt=0)
    """At which a normal load rubs, of an axis that turns: for friction over normal load."""


def _found(options: MotionOptions, bench: Bench, offered: Offered) -> Iterator[TrialRequest]:
    """The whole recording; a sensor in the joint tells friction without what accelerates."""
    force = JOINT_TORQUE if JOINT_TORQUE in offered.channels else DRIVE_TORQUE
    yield TrialRequest(
        Task(
            mode="recorded",
            duration=offered.duration,
            window=(0.0, offered.duration),
            sample_rate=offered.sample_rate,
        ),
        windows=offered.windows,
        requires=(RELATIVE_RATE, force),
        can_use=tuple(name for name in CAN_USE if name in offered.channels),
    )


def force_of(recording: Recording) -> str:
    """The channel that friction is read from: the joint's own, or else the drive's."""
    return JOINT_TORQUE if JOINT_TORQUE in recording.channels else DRIVE_TORQUE


def _measure(data: TrialData) -> Sequence[Estimate]:
    """Extremes of the motion, and rate and friction torque of each steady stretch of it."""
    options = MotionOptions.model_validate(data.trial.options, context={"si": True})
    recording = data.recording()
    force = force_of(recording)
    # A sensor in the joint is not told what accelerates the load.
    inertia = 0.0 if force == JOINT_TORQUE else bench_of(data.trial).axis.inertia
    channels = [RELATIVE_RATE, force]
    channels += [NORMAL_LOAD] if NORMAL_LOAD in recording.channels else []
    samples = np.array([recording[name] for name in channels])
    lost = ~np.isfinite(samples).all(axis=0)
    every = _stretches_of(data.trial, recording, options)
    chosen = np.unique(np.linspace(0, len(every) - 1, MOST_STRETCHES).astype(int))
    found = [
        *_extremes(recording),
        Estimate("lost", float(lost.sum()), "", kind="count", reason=COUNTED()),
        Estimate("stretches_found", float(len(every)), "", kind="count", reason=COUNTED()),
    ]
    number = 0
    for first, stop in (every[place] for place in chosen if every):
        there = np.flatnonzero(~lost[first:stop]) + first
        if len(there) < FEWEST:
            continue
        number += 1
        rate, torque, *load = samples[:, there]
        own = steady_sliding(recording.time[there], rate, torque, None, inertia)
        found += [
            replace(own.rate, name=f"rate_{number}"),
            replace(own.torque, name=f"friction_torque_{number}"),
            _plain(f"first_{number}", float(recording.time[there[0]]), "s"),
            _plain(f"last_{number}", float(recording.time[there[-1]]), "s"),
        ]
        found += [_plain(f"normal_load_{number}", float(np.mean(each)), "N") for each in load]
    found.append(Estimate("stretches", float(number), "", kind="count", reason=COUNTED()))
    return found


def _stretches_of(
    trial: Trial, recording: Recording, options: MotionOptions
) -> list[tuple[int, int]]:
    """Samples [first, stop) of the windows that somebody has named, or of what is steady."""
    rate = trial.task.sample_rate
    if trial.windows:
        return [(round(each.start * rate), round(each.stop * rate)) for each in trial.windows]
    torque = recording[force_of(recording)]
    steady = steady_stretches(
        recording[RELATIVE_RATE], rate, torque, options.shortest, driven=False
    )
    return [(each.first, each.stop) for each in steady]


def _extremes(recording: Recording) -> Iterator[Estimate]:
    rate, torque = recording[RELATIVE_RATE], recording[force_of(recording)]
    yield _plain("duration", float(recording.time[-1]), "s")
    yield _plain("top_rate", float(np.nanmax(np.abs(rate))), "rad/s")
    yield _plain("peak_torque", float(np.nanmax(np.abs(torque))), "N m")
    yield _plain("rms_torque", float(np.sqrt(np.nanmean(torque**2))), "N m")
    if RELATIVE_ANGLE in recording.channels:
        angle = recording[RELATIVE_ANGLE]
        yield _plain("travel", float(np.nanmax(angle) - np.nanmin(angle)), "rad")
        if REFERENCE in recording.channels:
            error = recording[REFERENCE] - angle
            yield _plain("rms_error", float(np.sqrt(np.nanmean(error**2))), "rad")
            yield _plain("peak_error", float(np.nanmax(np.abs(error))), "rad")


def _plain(name: str, value: float, unit: str) -> Estimate:
    return Estimate.without_interval(name, value, unit, OF_RECORDING())


def _analyse(data: TestData) -> Result:
    notes = list(failures_note(data))
    radius = MotionOptions.model_validate(
        {k: v for k, v in data.options.items() if k in MotionOptions.model_fields},
        context={"si": True},
    ).radius
    motions = [
        account_of(item, metrics(item, _measure), radius, notes) for item in data.completed()
    ]
    if not motions:
        return Result(notes=tuple(notes))
    several = len(motions) > 1
    tables = [summary_table(motions)]
    figures = []
    for number, motion in enumerate(motions, start=1):
        suffix = f"-{number}" if several else ""
        figures.append(motion_figure(motion, suffix))
        if motion.stretches:
            figures.append(friction_figure(motion, suffix))
            tables.append(friction_table(motion, suffix))
    if any(motion.lines for motion in motions):
        tables.insert(1, line_table(motions))
    return Result(
        tuple(tables),
        tuple(figures),
        tuple(finding for motion in motions for finding in line_findings(motion)),
        tuple(dict.fromkeys(notes)),
        motion_conclusions(motions),
        telling=next((each.key for each in figures if each.key.startswith("friction")), ""),
    )


EXPERIMENT = Experiment(
    name="motion",
    summary="any recorded motion: its course, tracking error, and friction where it is steady",
    options=MotionOptions,
    trials=nothing_to_plan,
    analyse=_analyse,
    measure=_measure,
    requires={
        RELATIVE_RATE: "the motion",
        DRIVE_TORQUE: "what drives it",
    },
    can_use=CAN_USE,
    recorded=_found,
    most_samples=MOST_SAMPLES,
)
