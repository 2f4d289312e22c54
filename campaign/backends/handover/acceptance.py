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
"""Tolerance of the start angle as a share of the angle limit."""
STOPPED = 20
"""Samples over which the rate that ends a trial is averaged; a person has also observed it."""
GO_ON = 40
"""Samples that are requested after that rate ..."""
FEWEST = 8
"""... of which so many are kept that this number is above half of the largest rate: a light load
passes the rate within one or two samples, too few for its motion. With 40 the breakaway torque of
a load of 70 kg m^2 is 0.3 % off; its 20 samples before are sufficient."""
LIMITED = {DRIVE_TORQUE: "torque", MOTOR_CURRENT: "current"}
"""Limit of the bench that applies to a torque, by channel."""


class RefusedRecording(Exception):  # noqa: N818 - of a recording, not of this program
    """A recording that does not fit its trial.

    Attributes:
        recording: the refused recording; None if it is unreadable.
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
    """The recording to archive. Raises RefusedRecording if it does not fit the trial.

    Args:
        others: trials to which the recording could belong instead.
        may_clip: channels that may be clipped.
    """
    task = trial.task
    recording, stopped = _until_stopped(trial, recording)
    asked = task.command.sample(recording.time)
    if problem := checks.wrong_length(task, len(recording.time), stopped):
        raise RefusedRecording(problem, recording)
    good = ~recording.lost
    series = {name: values[good] for name, values in recording.by_name.items()}
    for name, values in series.items():
        if not np.isfinite(values).all():
            first = int(np.argmax(~np.isfinite(recording[name]) & good))
            text = f"{name} has no value at {recording.time[first]:.6g} s"
            raise RefusedRecording(checks.RecordingProblem("undefined", text), recording)
    if not good.any():
        raise RefusedRecording(
            checks.RecordingProblem("undefined", "all of its samples are missing"), recording
        )
    asked = asked[good]
    problem, limits, words = None, _limits(trial), partial(shown, trial)
    if limits is not None and RELATIVE_ANGLE in series:
        problem = checks.wrong_start(task, series[RELATIVE_ANGLE], START * limits.angle, words)
    if problem is None and COMMAND in series:
        commands = {
            other.name: other.task.command.sample(recording.time)[good]
            for other in others
            if other.task.mode == task.mode
        }
        problem = checks.wrong_command(series[COMMAND], asked, task.sample_rate, commands, words)
    problem = problem or checks.wrong_motion(task, series, asked)
    unlimited = {name: values for name, values in series.items() if name not in may_clip}
    problem = problem or checks.clipped(task, unlimited, asked, _torque_limits(trial), words)
    if problem is not None:
        raise RefusedRecording(problem, recording)
    return recording


def _until_stopped(trial: Trial, recording: ReturnedRecording) -> tuple[ReturnedRecording, bool]:
    """The recording up to the rate that ends the trial and some samples more; whether reached.

    It is cut before any sample beyond a limit after that rate.
    """
    bound, still = trial.task.stop_rate, isinstance(trial.task.base_acceleration, Zero)
    # With the hull at rest the gyro shows the same rate, without differentiation of an encoder.
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
        kept = recording.cut(violation.index, remark)  # the rate was reached within the limits
    return kept, True


def _enough(size: Array, reached: int) -> int:
    """First index from `reached` with `FEWEST` earlier samples above half of their largest.

    At most `GO_ON` after `reached`; `size`: magnitude of the rate, shape (n,).
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
    """Limits of the bench by channel of torque or current."""
    limits = _limits(trial)
    return {name: float(getattr(limits, key)) for name, key in LIMITED.items()} if limits else {}


def not_completed(trial: Trial, recording: ReturnedRecording) -> str:
    """Why the recorder will not accept the trial as completed; empty if it will."""
    if recording.lost.any():
        return f"lost samples: {int(recording.lost.sum())} of its samples are missing"
    violation = _violation(trial, recording)
    return f"limit: {violation.text}" if violation else ""


def _violation(trial: Trial, recording: ReturnedRecording) -> Violation | None:
    """The first sample beyond a limit of the bench, or None."""
    limits = _limits(trial)
    if limits is None:
        return None
    names = [channel.name for channel in recording.channels]
    watch = LimitWatch(limits, trial.task.sample_rate, names, sides_in(trial.bench))
    return watch.look(recording.time, recording.samples)
