"""The time grid of a simulation: integration step, recording, controller."""

from __future__ import annotations

import math
from dataclasses import dataclass

from campaign.physics import step_choice
from campaign.physics.complete import CompleteBench
from campaign.physics.step_choice import StepChoice
from campaign.signals import MultiSine, Sine
from campaign.trial import Task

FINEST_DELAY = 4
"""Maximum factor by which the steps become finer to match the controller's delay."""
STEPS_PER_CYCLE = 80
"""Of the fastest sine; at 80 a straight-line input loses 5e-4 of its amplitude."""


@dataclass(frozen=True)
class Grid:
    """The time grid of a simulation.

    Attributes:
        step: integration step (s).
        every: steps per recorded sample.
        per_control: steps per controller sample; 0 for a continuous controller.
        samples: total number of recorded samples.
        because: reason for a step below the longest; else empty.
    """

    step: float
    every: int
    per_control: int
    samples: int
    because: str = ""


def make_grid(bench: CompleteBench, task: Task, longest_step: float | None = None) -> Grid:
    """Steps that divide both the recording's and the controller's sample time.

    `longest_step` (s): None for the step that the trial needs (`step_choice`). Raises ValueError if
    the controller's rate is no multiple of the recording's, and if the trial needs a step below the
    finest.
    """
    control_rate = bench.controller.sample_rate
    continuous = control_rate is None or task.mode in ("prescribed", "spring")
    because = "asked for" if longest_step is not None else ""
    if longest_step is None:
        choice = _choice(bench, task)
        longest_step = choice.step
        because = choice.because if choice.step < step_choice.LONGEST else ""
    # A sampled controller holds its command between samples: the steps need not resolve it.
    smooth = (task.base_acceleration, task.disturbance)
    for signal in (*smooth, task.command) if continuous else smooth:
        if isinstance(signal, Sine | MultiSine):
            fastest = signal.frequency if isinstance(signal, Sine) else max(signal.frequencies)
            if 1.0 / (STEPS_PER_CYCLE * fastest) < longest_step:
                longest_step, because = 1.0 / (STEPS_PER_CYCLE * fastest), f"{fastest:g} Hz"
    samples = task.samples
    if control_rate is None or continuous:
        every = max(1, math.ceil(1.0 / (task.sample_rate * longest_step) - 1e-9))
        if every == 1 and task.sample_rate * step_choice.LONGEST > 1.0:
            because = f"recorded at {task.sample_rate:g} Hz"
        return Grid(1.0 / (task.sample_rate * every), every, 0, samples, because)
    per_record = control_rate / task.sample_rate
    if abs(per_record - round(per_record)) > 1e-6 or round(per_record) < 1:
        raise ValueError(
            f"the controller's sample rate ({control_rate:g} Hz) must be a whole multiple of the "
            f"recording's ({task.sample_rate:g} Hz)"
        )
    per_control = max(1, math.ceil(1.0 / (control_rate * longest_step) - 1e-9))
    per_control = _with_delay(per_control, bench.controller.delay * control_rate)
    step = 1.0 / (control_rate * per_control)
    if per_control == 1 and control_rate * step_choice.LONGEST > 1.0:
        because = f"controlled at {control_rate:g} Hz"
    return Grid(step, per_control * round(per_record), per_control, samples, because)


def _choice(bench: CompleteBench, task: Task) -> StepChoice:
    choice = step_choice.longest_step(bench, task)
    if choice.refused is not None:
        raise ValueError(
            f"{choice.refused}; [backend] longest_step simulates it all the same, with an "
            "unknown error"
        )
    return choice


def _with_delay(per_control: int, delay: float) -> int:
    """Multiply the steps per sample until a `delay` (samples) is a whole number of steps."""
    for times in range(1, FINEST_DELAY + 1):
        steps = delay * per_control * times
        if abs(steps - round(steps)) < 1e-6:
            return per_control * times
    return per_control * FINEST_DELAY
