"""One simulated trial: outputs as channels, limit checks, recorder."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from campaign.axis_kind import Sides
from campaign.backends.interface import StopFlag
from campaign.backends.step_check import StepCheck
from campaign.channels import (
    BASE_RATE,
    COMMAND,
    COMPENSATION_TORQUE,
    DRIVE_TORQUE,
    FRICTION_TORQUE,
    GYRO_RATE,
    LOAD_RATE,
    MOTOR_CURRENT,
    POINTING_ERROR,
    RELATIVE_ANGLE,
    RELATIVE_RATE,
    axis_of,
    info,
)
from campaign.physics.base_motion import base_rate
from campaign.physics.complete import CompleteBench
from campaign.physics.limit_watch import LimitWatch
from campaign.recording import Array, ChannelInfo, Ending, Event, Outcome, Recorder
from campaign.trial import Task

CHANNELS = tuple(
    info(name)
    for name in (
        COMMAND,
        BASE_RATE,
        GYRO_RATE,
        RELATIVE_RATE,
        RELATIVE_ANGLE,
        MOTOR_CURRENT,
        DRIVE_TORQUE,
        POINTING_ERROR,
        COMPENSATION_TORQUE,
        FRICTION_TORQUE,
        LOAD_RATE,
    )
)
"""In the order of a block; what the command is depends on the task."""

MEASURED = tuple(channel for channel in CHANNELS if channel.measured)
"""What a rig would have, too."""

OUTPUTS = (
    GYRO_RATE,
    RELATIVE_RATE,
    RELATIVE_ANGLE,
    MOTOR_CURRENT,
    POINTING_ERROR,
    COMPENSATION_TORQUE,
    FRICTION_TORQUE,
    LOAD_RATE,
)
"""The channels that the engine's outputs are, in the order of its rows."""


def announced(names: Sequence[str], mode: str, sides: Sides) -> tuple[ChannelInfo, ...]:
    """What the channels are, of a bench with these sides and of a task with this mode."""
    return tuple(info(name, mode, axis=axis_of(name, sides)) for name in names)


class SimulatedTrial:
    """Takes the outputs of the engine until the trial ends."""

    def __init__(
        self,
        bench: CompleteBench,
        task: Task,
        samples: int,
        recorder: Recorder,
        stop: StopFlag,
        check: StepCheck | None = None,
        *,
        told: bool = True,
    ) -> None:
        """A trial of `bench`, as far as those know it who move it.

        Args:
            samples: how many there are when nothing ends the trial before.
            told: whether what only a simulator can know is recorded, too.
        """
        self._bench = bench
        self._task = task
        self._left = samples
        self._check = check
        self._recorder = recorder
        self._stop = stop
        channels = CHANNELS if told else MEASURED
        self._rows = [CHANNELS.index(channel) for channel in channels]
        names = [channel.name for channel in channels]
        self._watch = LimitWatch(bench.limits, task.sample_rate, names, bench.sides)
        recorder.start(announced(names, task.mode, bench.sides))

    def take(self, time: Array, out: Array, half: Array | None = None) -> Ending | None:
        """The next outputs (8, n), rows as `OUTPUTS`, at `time` (n,); None: it goes on.

        `half`: the same outputs at half the step, where that is checked.
        """
        ending = self._take(time, out, half)
        if ending is None or self._check is None:
            return ending
        return replace(ending, telemetry=self._check.telemetry())

    def _take(self, time: Array, out: Array, half: Array | None) -> Ending | None:
        block = self._block(time, out)
        # By the gyro where there is one: an angle, differenced, is too coarse for slow motion.
        rate = block[2] if self._bench.rate_is_of_encoder else block[2] - block[1]
        reached = _first_beyond(rate, self._task.stop_rate)
        end, ending = _first_violation(self._watch, time[:reached], block[:, :reached])
        self._recorder.append(time[:end], block[:, :end])
        if self._check is not None and half is not None:
            self._check.add(out[:, :end], half[:, :end])
        self._left -= len(time)
        if ending is not None:
            late = ending.outcome is Outcome.LIMIT  # its own sample is the last one kept
            self._recorder.event(Event(float(time[end - 1 if late else end]), ending.reason))
            return ending
        if reached < len(time):
            self._recorder.event(
                Event(float(time[reached]), "the rate that ends the trial was reached")
            )
            return Ending(Outcome.COMPLETED)
        if self._stop():
            return Ending(Outcome.INTERRUPTED, "stopped by the operator")
        return None if self._left > 0 else Ending(Outcome.COMPLETED)

    def _block(self, time: Array, out: Array) -> Array:
        """The recorded channels, shape (11, n); fewer where the truth is not told."""
        bench, task = self._bench, self._task
        block = np.empty((len(CHANNELS), len(time)))
        gyro, relative, angle, current, pointing, compensation, friction, load_rate = out
        block[0] = task.command.sample(time)
        block[1] = base_rate(task.base_acceleration, time)
        block[2], block[3], block[4], block[5] = gyro, relative, angle, current
        if task.mode == "spring":  # it pulls the load in place of the motor
            block[6] = task.spring_stiffness * (block[0] - angle)
        else:
            block[6] = current * bench.torque_per_current
        block[7], block[8], block[9], block[10] = pointing, compensation, friction, load_rate
        return block if len(self._rows) == len(block) else block[self._rows]


def _first_beyond(samples: Array, bound: float | None) -> int:
    """Index of the first sample beyond `bound` either way; all of them when there is none."""
    if bound is None:
        return len(samples)
    beyond = np.abs(samples) > bound
    return int(np.argmax(beyond)) if beyond.any() else len(samples)


def _first_violation(watch: LimitWatch, time: Array, block: Array) -> tuple[int, Ending | None]:
    """How many samples are good, and why the trial ends there (None: it goes on).

    Looks at the recorded samples: what exceeds a limit only between two of them is not seen.
    Acceleration has no channel: its limit, like the duration's, is checked in the plan only.
    """
    finite = np.isfinite(block)
    first = len(time) if finite.all() else int(np.argmin(finite.all(axis=0)))
    violation = watch.look(time[:first], block[:, :first])
    if violation is not None:  # the offending sample is kept: it is the evidence
        return violation.index + 1, Ending(Outcome.LIMIT, violation.text)
    if first < len(time):
        reason = f"the simulation diverged at {time[first]:.4g} s: no finite value"
        return first, Ending(Outcome.DIVERGED, reason)
    return len(time), None
