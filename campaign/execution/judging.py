"""What a trial's samples have to pass: shape, time base, values. Pure; the recorder acts on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import ValidationError

from campaign.axis_kind import sides_in
from campaign.physics.bench import LimitsOptions
from campaign.physics.limit_watch import WATCHED, LimitWatch
from campaign.recording import Array, Ending, Fault, Outcome
from campaign.trial import Task, Trial

STEP = 0.5
"""Of a sample: further from its place, it could be another one."""


@dataclass(frozen=True)
class Verdict:
    """Why a trial is ended, or in a recording what is said of it.

    Attributes:
        kind: `limit`, `undefined`, `time`, `channels`, `shape`, `length`, `lost` or `silence`.
        time: of the sample at which it was found (s).
    """

    kind: str
    outcome: Outcome
    reason: str
    time: float
    fault: Fault | None = None


def make_watch(trial: Trial, names: Sequence[str]) -> tuple[LimitWatch | None, tuple[str, ...]]:
    """What watches the limits of the trial's bench, and those that no channel of `names` tells of.

    None for a bench that states no limits, or limits of a program that this one does not know.
    """
    tree = trial.bench.get("limits")
    if tree is None:
        return None, ()
    try:
        limits = LimitsOptions.model_validate(tree, context={"si": True})
    except ValidationError:
        return None, tuple(each.limit for each in WATCHED)
    watch = LimitWatch(limits, trial.task.sample_rate, names, sides_in(trial.bench))
    return watch, watch.unwatched


def shaped(time: Array, block: Array | None, channels: int) -> tuple[Array, Array]:
    """As float64, time (n,) and block (channels, n); without a block all of it is NaN.

    Raises ValueError saying what else they are.
    """
    try:
        time = np.asarray(time, dtype=np.float64)
        if block is None:
            block = np.full((channels, len(time)), np.nan)
        block = np.asarray(block, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"a block is no array of numbers: {error}") from None
    if time.ndim != 1 or block.shape != (channels, len(time)):
        raise ValueError(
            f"a block has the shape {block.shape} and its time {time.shape}; {channels} channels "
            f"of n samples each were announced: ({channels}, n) and (n,)"
        )
    return time, block


def wrong_time(task: Task, first: int, time: Array) -> tuple[int, Verdict] | None:
    """The first sample that is not where its number puts it, or comes after the last one.

    `first` is the number of the block's first sample in the trial.
    """
    numbers = first + np.arange(len(time))
    wrong = ~(np.abs(time * task.sample_rate - numbers) < STEP)  # NaN is wrong, too
    beyond = numbers > task.duration * task.sample_rate + 1
    if not (wrong.any() or beyond.any()):
        return None
    index = int(np.argmax(wrong | beyond))
    number, due = int(numbers[index]), float(numbers[index] / task.sample_rate)
    if wrong[index]:
        reason = f"sample {number} is at {time[index]:.6g} s instead of {due:.6g} s"
        if number and index == 0:
            reason += ", where the block before it ended"
    else:
        reason = f"the recording goes on after the {task.duration:g} s of the trial"
    return index, Verdict("time", Outcome.FAULT, reason, due, Fault.RECORDING)


def undefined(names: Sequence[str], time: Array, block: Array) -> tuple[int, Verdict] | None:
    """The first sample that is infinite or no number in any channel."""
    bad = ~np.isfinite(block).all(axis=0)
    if not bad.any():
        return None
    index = int(np.argmax(bad))
    row = int(np.argmax(~np.isfinite(block[:, index])))
    reason = f"{names[row]} is {block[row, index]} at {time[index]:.4g} s"
    return index, Verdict("undefined", Outcome.DIVERGED, reason, float(time[index]))


def tells_of_gaps(ending: Ending, told: Sequence[str]) -> bool:
    """Whether a recording says itself that samples of it are undefined."""
    if ending.outcome is Outcome.DIVERGED or ending.fault is Fault.LOST_SAMPLES:
        return True
    return any("were lost and are NaN" in text for text in told)
