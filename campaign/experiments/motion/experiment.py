"""Any recorded motion: course, force, tracking error, friction over rate.

For recordings without a planned experiment of this program. Friction is estimated where the axis
slides steadily (Equation 4.1 without acceleration), in both directions. The rest of the motion is
only described.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

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
from campaign.experiments.friction_map.stretches import StretchOptions, force_of
from campaign.experiments.friction_map.tables import point_table
from campaign.experiments.interface import Experiment, TestData, TrialData, metrics, validated
from campaign.experiments.motion.account import (
    Motion,
    account_of,
    line_table,
    motion_findings,
    summary_table,
)
from campaign.experiments.motion.figures import friction_figure, motion_figure
from campaign.experiments.shared.common import COUNTED, numbered, of_recording
from campaign.experiments.shared.recorded_motion import nothing_to_plan
from campaign.physics.bench import Bench
from campaign.recording import Recording
from campaign.result import Array, Result
from campaign.trial import OfferedRecording, Task, TrialRequest
from campaign.units import Length

CAN_USE = {
    RELATIVE_ANGLE: "position over time",
    REFERENCE: "tracking error",
    NORMAL_LOAD: "friction coefficient",
    JOINT_TORQUE: "friction without what accelerates the load",
}
"""Optional channels, and the results that need them."""
MOST_SAMPLES = 10_000_000
"""Largest number of samples of a recording: at 1 kHz about three hours."""


class MotionOptions(StretchOptions):
    """Options of a recorded motion."""

    radius: Length | None = Field(default=None, gt=0)
    """Radius of a normal load on a rotary axis, for friction over normal load."""


def _found(
    options: MotionOptions, bench: Bench, offered: OfferedRecording
) -> Iterator[TrialRequest]:
    """The whole recording; a sensor in the joint measures friction without inertia torque."""
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


def _measure(data: TrialData) -> Sequence[Estimate]:
    """Extremes of the motion."""
    recording = data.recording()
    channels = [RELATIVE_RATE, force_of(data)]
    lost = ~np.isfinite([recording[name] for name in channels]).all(axis=0)
    return [
        *_extremes(recording, recording[force_of(data)]),
        Estimate("lost", float(lost.sum()), "", kind="count", reason=COUNTED()),
    ]


def _extremes(recording: Recording, torque: Array) -> Iterator[Estimate]:
    rate = recording[RELATIVE_RATE]
    yield of_recording("duration", float(recording.time[-1]), "s")
    yield of_recording("top_rate", float(np.nanmax(np.abs(rate))), "rad/s")
    yield of_recording("peak_torque", float(np.nanmax(np.abs(torque))), "N m")
    yield of_recording("rms_torque", float(np.sqrt(np.nanmean(torque**2))), "N m")
    if RELATIVE_ANGLE in recording.channels:
        angle = recording[RELATIVE_ANGLE]
        yield of_recording("travel", float(np.nanmax(angle) - np.nanmin(angle)), "rad")
        if REFERENCE in recording.channels:
            error = recording[REFERENCE] - angle
            yield of_recording("rms_error", float(np.sqrt(np.nanmean(error**2))), "rad")
            yield of_recording("peak_error", float(np.nanmax(np.abs(error))), "rad")


def _analyse(data: TestData) -> Result:
    notes: list[str] = []
    motions = [
        account_of(
            item,
            metrics(item, _measure),
            validated(MotionOptions, item.trial.options),
            notes,
        )
        for item in data.completed()
    ]
    if not motions:
        return Result()
    lines = (line_table(motions),) if any(motion.coulomb for motion in motions) else ()
    each = numbered(map(_of_motion, motions))
    return Result(
        (summary_table(motions), *lines, *each.tables),
        each.figures,
        tuple(finding for motion in motions for finding in motion_findings(motion)),
        tuple(notes),
        telling=next((f.key for f in each.figures if f.key.startswith("friction")), ""),
    )


def _of_motion(motion: Motion) -> Result:
    """Stretches of one recording, its course, and its friction over rate."""
    sliding, trial = motion.sliding, motion.data.trial
    every = (*sliding.points, *sliding.left)
    return Result(
        (point_table(every, motion.data, trial.label),) if every else (),
        (motion_figure(motion), *((friction_figure(motion),) if sliding.maps else ())),
    )


EXPERIMENT = Experiment(
    name="motion",
    summary="any recorded motion: time series, tracking error, friction of steady parts",
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
