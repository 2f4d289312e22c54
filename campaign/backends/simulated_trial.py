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
"""Channels in the order of a block; the quantity of the command depends on the task."""

MEASURED = tuple(channel for channel in CHANNELS if channel.measured)
"""Channels that a rig can also measure."""

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
"""Channels of the engine's outputs, in the order of its rows."""


def announced(names: Sequence[str], mode: str, sides: Sides) -> tuple[ChannelInfo, ...]:
    """Channels for a bench with these sides and a task with this mode."""
    return tuple(info(name, mode, axis=axis_of(name, sides)) for name in names)


class SimulatedTrial:
    """Records the outputs of the engine until the trial ends."""

    def __init__(
        self,
        bench: CompleteBench,
        task: Task,
        samples: int,
        recorder: Recorder,
        stop: StopFlag,
        check: StepCheck | None = None,
        *,
        internal: bool = True,
    ) -> None:
        """Begin a trial of the stated `bench` (not its truth).

        Args:
            samples: number of samples of the whole trial.
            internal: whether channels that only a simulation provides are recorded, too.
        """
        self._bench = bench
        self._task = task
        self._left = samples
        self._check = check
        self._recorder = recorder
        self._stop = stop
        channels = CHANNELS if internal else MEASURED
        self._rows = [CHANNELS.index(channel) for channel in channels]
        names = [channel.name for channel in channels]
        self._watch = LimitWatch(bench.limits, task.sample_rate, names, bench.sides)
        recorder.start(announced(names, task.mode, bench.sides))

    def take(
        self, time: Array, inputs: tuple[Array, Array], out: Array, half: Array | None = None
    ) -> Ending | None:
        """Record the next outputs (8, n), rows as `OUTPUTS`; the ending, or None.

        Args:
            time: of the samples (s), shape (n,) or longer.
            inputs: command and rate of the hull at `time`.
            half: the same outputs at half the step, for a step check.
        """
        ending = self._take(time[: out.shape[1]], inputs, out, half)
        if ending is None or self._check is None:
            return ending
        return replace(ending, telemetry=self._check.telemetry())

    def _take(
        self, time: Array, inputs: tuple[Array, Array], out: Array, half: Array | None
    ) -> Ending | None:
        block = self._block(inputs, out)
        # From the gyro if available: a differentiated angle is too coarse for slow motion.
        rate = block[2] if self._bench.rate_is_of_encoder else block[2] - block[1]
        reached = _first_beyond(rate, self._task.stop_rate)
        end, ending = _first_violation(self._watch, time[:reached], block[:, :reached])
        self._recorder.append(time[:end], block[:, :end])
        if self._check is not None and half is not None:
            self._check.add(out[:, :end], half[:, :end])
        self._left -= len(time)
        if ending is not None:
            late = ending.outcome is Outcome.LIMIT  # the sample beyond the limit is kept, as last
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

    def _block(self, inputs: tuple[Array, Array], out: Array) -> Array:
        """The recorded channels, shape (11, n); fewer rows if the truth is not recorded."""
        bench, task = self._bench, self._task
        block = np.empty((len(CHANNELS), out.shape[1]))
        gyro, relative, angle, current, pointing, compensation, friction, load_rate = out
        block[0], block[1] = (samples[: out.shape[1]] for samples in inputs)
        block[2], block[3], block[4], block[5] = gyro, relative, angle, current
        if task.mode == "spring":  # the spring pulls the load instead of the motor
            block[6] = task.spring_stiffness * (block[0] - angle)
        else:
            block[6] = current * bench.torque_per_current
        block[7], block[8], block[9], block[10] = pointing, compensation, friction, load_rate
        return block if len(self._rows) == len(block) else block[self._rows]


def _first_beyond(samples: Array, bound: float | None) -> int:
    """Index of the first sample with a magnitude above `bound`; the sample count without any."""
    if bound is None:
        return len(samples)
    beyond = np.abs(samples) > bound
    return int(np.argmax(beyond)) if beyond.any() else len(samples)


def _first_violation(watch: LimitWatch, time: Array, block: Array) -> tuple[int, Ending | None]:
    """Number of samples to record, and the ending at that sample (None: no violation).

    Checks the recorded samples; an excess between two samples is not detected. Acceleration has no
    channel: its limit and that of the duration are checked in the plan only.
    """
    finite = np.isfinite(block)
    first = len(time) if finite.all() else int(np.argmin(finite.all(axis=0)))
    violation = watch.look(time[:first], block[:, :first])
    if violation is not None:  # the violating sample is kept as evidence
        return violation.index + 1, Ending(Outcome.LIMIT, violation.text)
    if first < len(time):
        reason = f"the simulation diverged at {time[first]:.4g} s: no finite value"
        return first, Ending(Outcome.DIVERGED, reason)
    return len(time), None
