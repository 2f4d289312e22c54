"""The simulated bench: executes a trial with the engine of `campaign.physics`."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from campaign.backends.interface import BackendKind, Source, StopFlag
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
    info,
)
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.physics.limit_watch import LimitWatch
from campaign.trial import (
    Array,
    Ending,
    Event,
    Outcome,
    Recorder,
    SafeState,
    Task,
    Trial,
)
from campaign.units import Time

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

COMMANDS = {mode: info(COMMAND, mode) for mode in ("rate", "torque", "prescribed", "spring")}
"""What the command channel holds, by the mode of the task."""

_NAMES = frozenset(channel.name for channel in CHANNELS)


class SimOptions(Options):
    """Options of the simulated bench."""

    longest_step: Time | None = Field(default=None, gt=0, le=0.01)
    """Longest integration step; absent: what the trial needs, 1 ms or 1/2^k of it. Sample rates and
    the frequencies of sines make it shorter."""


class SimBackend:
    """Simulates every trial from rest, whatever came before it."""

    def __init__(self, options: SimOptions) -> None:
        self._options = options

    def __enter__(self) -> SimBackend:
        return self

    def __exit__(self, *exception: object) -> None:
        return None

    def refuses(self, trial: Trial) -> str | None:
        """Why this backend cannot execute `trial`, or None."""
        from campaign.physics.simulate import make_grid

        bench, name = _bench(trial), trial.task.compensation
        if name != "none" and name not in bench.compensation:
            return f"bench {bench.name!r} has no compensation {name!r}"
        try:
            make_grid(bench, trial.task, self._options.longest_step)
        except ValueError as error:
            return str(error)
        return None

    def channels(self, trial: Trial) -> frozenset[str]:
        """All that the simulation knows."""
        return _NAMES

    def execute(self, trial: Trial, recorder: Recorder, stop: StopFlag) -> Ending:
        """Simulate `trial`; end it at a limit, at a divergence, or when `stop()`."""
        from campaign.physics.base_motion import base_rate
        from campaign.physics.simulate import simulate

        bench, task = _bench(trial), trial.task
        watch = LimitWatch(bench.limits, task.sample_rate, [info.name for info in CHANNELS])
        recorder.start((COMMANDS[task.mode], *CHANNELS[1:]))
        for time, out in simulate(bench, task, trial.seed, self._options.longest_step):
            gyro, relative, angle, current, pointing, compensation, friction, load_rate = out
            command = task.command.sample(time)
            block = np.stack(
                [
                    command,
                    base_rate(task.base_acceleration, time),
                    gyro,
                    relative,
                    angle,
                    current,
                    _drive_torque(bench, task, command, angle, current),
                    pointing,
                    compensation,
                    friction,
                    load_rate,
                ]
            )
            # By the gyro: the angle sensor, differenced, is too coarse for slow motion.
            reached = _first_beyond(gyro - block[1], task.stop_rate)
            end, ending = _first_violation(watch, time[:reached], block[:, :reached])
            recorder.append(time[:end], block[:, :end])
            if ending is not None:
                late = ending.outcome is Outcome.LIMIT  # its own sample is the last one kept
                recorder.event(Event(float(time[end - 1 if late else end]), ending.reason))
                return ending
            if reached < len(time):
                recorder.event(
                    Event(float(time[reached]), "the rate that ends the trial was reached")
                )
                return Ending(Outcome.COMPLETED)
            if stop():
                return Ending(Outcome.INTERRUPTED, "stopped by the operator")
        return Ending(Outcome.COMPLETED)

    def make_safe(self) -> SafeState:
        """A simulation has nothing that moves."""
        return SafeState.CONFIRMED


def _bench(trial: Trial) -> Bench:
    return Bench.model_validate(trial.bench, context={"si": True})


def _drive_torque(bench: Bench, task: Task, command: Array, angle: Array, current: Array) -> Array:
    """What pulls the load (N m): the motor, or the spring that stands in for it."""
    if task.mode == "spring":
        return task.spring_stiffness * (command - angle)
    return current * bench.torque_per_current


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
    bad = ~np.isfinite(block).all(axis=0)
    first = int(np.argmax(bad)) if bad.any() else len(time)
    violation = watch.look(time[:first], block[:, :first])
    if violation is not None:  # the offending sample is kept: it is the evidence
        return violation.index + 1, Ending(Outcome.LIMIT, violation.text)
    if first < len(time):
        reason = f"the simulation diverged at {time[first]:.4g} s: no finite value"
        return first, Ending(Outcome.DIVERGED, reason)
    return len(time), None


def _open(options: Options) -> SimBackend:
    return SimBackend(SimOptions.model_validate(options.model_dump(), context={"si": True}))


BACKEND = BackendKind(
    name="sim",
    summary="the bench simulated from its description",
    options=SimOptions,
    open=_open,
    source=Source.SIMULATION,
    several=True,
)
