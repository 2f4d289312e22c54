"""Acceptance of a returned recording, or its refusal with a reason."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import partial

import numpy as np
from pydantic import ValidationError

from campaign.axis_kind import sides_in
from campaign.backends.handover import checks
from campaign.backends.handover.excitation import shown
from campaign.backends.handover.returned_recording import ReturnedRecording
from campaign.channels import (
    COMMAND,
    DRIVE_TORQUE,
    GYRO_RATE,
    MOTOR_CURRENT,
    RELATIVE_ANGLE,
    RELATIVE_RATE,
)
from campaign.physics.bench import LimitsOptions
from campaign.physics.limit_watch import LimitWatch, Violation
from campaign.recording import Array
from campaign.signals import Zero
from campaign.trial import Trial

START = 0.02
"""of the angle limit, by which a trial may begin beside where it was asked to."""
STOPPED = 20
"""samples over which the rate that ends a trial is averaged: a person has looked at it as well."""
GO_ON = 40
"""samples that are asked for behind that rate ..."""
FEWEST = 8
"""... of which as many are kept as it takes to have these above half of the last rate: a light load
passes the rate within one or two, and nothing is told of what it did there. With 40 the breakaway
torque of a load of 70 kg m^2 is 0.3 % off, whose 20 before are enough."""
LIMITED = {DRIVE_TORQUE: "torque", MOTOR_CURRENT: "current"}
"""The limit of a bench that holds a torque, by channel."""


class RefusedRecording(Exception):  # noqa: N818 - of a recording, not of this program
    """A recording that is not what was asked.

    Attributes:
        recording: what there is of it, None when it cannot be read.
    """

    def __init__(
        self, found: checks.RecordingProblem, recording: ReturnedRecording | None = None
    ) -> None:
        self.found = found
        self.recording = recording
        super().__init__(str(found))


def accepted_recording(
    trial: Trial,
    recording: ReturnedRecording,
    others: Sequence[Trial],
    may_clip: Collection[str] = (),
) -> ReturnedRecording:
    """The recording as it is archived. Raises RefusedRecording when it is not what was asked.

    Args:
        others: trials whose recording it could be instead.
        may_clip: channels that may stand at their limit.
    """
    task = trial.task
    recording, stopped = _until_stopped(trial, recording)
    asked = task.command.sample(recording.time)
    if found := checks.wrong_length(task, len(recording.time), stopped):
        raise RefusedRecording(found, recording)
    good = ~recording.lost
    series = {name: values[good] for name, values in recording.by_name.items()}
    for name, values in series.items():
        if not np.isfinite(values).all():
            first = int(np.argmax(~np.isfinite(recording[name]) & good))
            told = f"{name} has no value at {recording.time[first]:.6g} s"
            raise RefusedRecording(checks.RecordingProblem("undefined", told), recording)
    if not good.any():
        raise RefusedRecording(
            checks.RecordingProblem("undefined", "all of its samples are missing"), recording
        )
    asked = asked[good]
    found, limits, words = None, _limits(trial), partial(shown, trial)
    if limits is not None and RELATIVE_ANGLE in series:
        found = checks.wrong_start(task, series[RELATIVE_ANGLE], START * limits.angle, words)
    if found is None and COMMAND in series:
        theirs = {
            other.name: other.task.command.sample(recording.time)[good]
            for other in others
            if other.task.mode == task.mode
        }
        found = checks.wrong_command(series[COMMAND], asked, task.sample_rate, theirs, words)
    found = found or checks.wrong_motion(task, series, asked)
    unlimited = {name: values for name, values in series.items() if name not in may_clip}
    found = found or checks.clipped(task, unlimited, asked, _torque_limits(trial), words)
    if found is not None:
        raise RefusedRecording(found, recording)
    return recording


def _until_stopped(trial: Trial, recording: ReturnedRecording) -> tuple[ReturnedRecording, bool]:
    """Up to the rate that ends the trial, and as far behind it as is needed; whether it got there.

    Nothing behind that rate breaks a limit.
    """
    bound, still = trial.task.stop_rate, isinstance(trial.task.base_acceleration, Zero)
    # Of a hull at rest the gyro tells the same rate, and is not differenced from an encoder.
    names = (GYRO_RATE, RELATIVE_RATE) if still else (RELATIVE_RATE,)
    name = next((name for name in names if name in recording.by_name), None)
    if bound is None or name is None:
        return recording, False
    rate = np.nan_to_num(recording[name])
    size = min(STOPPED, len(rate))
    mean = np.convolve(rate, np.full(size, 1.0 / size), mode="valid")
    beyond = np.abs(mean) > bound
    if not beyond.any():
        return recording, False
    reached = int(np.argmax(beyond)) + size - 1
    remark = f"{name} reached the rate that ends the trial"
    kept = recording.cut(_enough(np.abs(rate), reached), remark)
    if (violation := _violation(trial, kept)) is not None and violation.index > reached:
        kept = recording.cut(violation.index, remark)  # it had reached it within the limits
    return kept, True


def _enough(size: Array, reached: int) -> int:
    """The first stop from `reached` on with `FEWEST` samples above half of the largest before it.

    At most `GO_ON` behind; `size` of the rate, shape (n,).
    """
    for stop in range(reached, reached + GO_ON):
        part = size[:stop]
        if np.sum(part > 0.5 * np.max(part)) >= FEWEST:
            return stop
    return reached + GO_ON


def _limits(trial: Trial) -> LimitsOptions | None:
    try:
        return LimitsOptions.model_validate(trial.bench.get("limits"), context={"si": True})
    except ValidationError:
        return None


def _torque_limits(trial: Trial) -> dict[str, float]:
    """By channel, the limit of the bench that may hold it."""
    limits = _limits(trial)
    return {name: float(getattr(limits, key)) for name, key in LIMITED.items()} if limits else {}


def not_completed(trial: Trial, recording: ReturnedRecording) -> str:
    """Why the recorder will not take it for completed, in words; empty where it will."""
    if recording.lost.any():
        return f"lost samples: {int(recording.lost.sum())} of its samples are missing"
    violation = _violation(trial, recording)
    return f"limit: {violation.text}" if violation else ""


def _violation(trial: Trial, recording: ReturnedRecording) -> Violation | None:
    """The first sample beyond a limit of the bench."""
    limits = _limits(trial)
    if limits is None:
        return None
    names = [channel.name for channel in recording.channels]
    watch = LimitWatch(limits, trial.task.sample_rate, names, sides_in(trial.bench))
    return watch.look(recording.time, recording.samples)
