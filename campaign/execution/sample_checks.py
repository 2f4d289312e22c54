"""Checks of a trial's samples: shape, time base, values."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from pydantic import ValidationError

from campaign.axis_kind import sides_in
from campaign.channels import in_known_unit, wrong_names
from campaign.physics.bench import LimitsOptions
from campaign.physics.limit_watch import WATCHED, LimitWatch
from campaign.plain_text import storable, storable_tree
from campaign.recording import Array, ChannelInfo, Ending, Fault, Outcome
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


@dataclass(frozen=True)
class ArchivedChannels:
    """The channels of a trial as they are archived.

    Attributes:
        factors: (channels, 1), what the samples of each are multiplied by.
        converted: what is said of each channel whose unit was another one.
    """

    channels: tuple[ChannelInfo, ...] = ()
    factors: Array = field(default_factory=lambda: np.ones((0, 1)))
    converted: tuple[str, ...] = ()


def announced(trial: Trial, channels: Sequence[ChannelInfo]) -> ArchivedChannels:
    """`channels` with storable texts, and those of the vocabulary in its units.

    Raises ValueError saying which channel cannot be archived.
    """
    if strange := next((each for each in channels if not isinstance(each, ChannelInfo)), None):
        raise ValueError(f"a channel was announced as {type(strange).__name__!r}, no ChannelInfo")
    if wrong := wrong_names([channel.name for channel in channels]):
        raise ValueError(wrong)
    given = [
        replace(
            channel,
            unit=storable(channel.unit),
            label=storable(channel.label),
            display_unit=storable(channel.display_unit),
            measured=bool(channel.measured),
        )
        for channel in channels
    ]
    for channel in given:
        rate = channel.own_rate
        if rate is not None and not (isinstance(rate, int | float) and 0.0 < rate < math.inf):
            raise ValueError(f"{channel.name}: its own rate is {storable_tree(rate)!r} Hz")
    sides, mode = sides_in(trial.bench), trial.task.mode
    found = [in_known_unit(channel, mode, sides) for channel in given]
    return ArchivedChannels(
        tuple(channel for channel, _ in found),
        np.array([[times] for _, times in found]),
        tuple(
            f"{kept.name} was announced in {channel.unit} and is archived in {kept.unit}"
            for channel, (kept, times) in zip(given, found, strict=True)
            if times != 1.0
        ),
    )


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
    time = _numbers(time)
    block = np.full((channels, time.size), np.nan) if block is None else _numbers(block)
    if time.ndim != 1 or block.shape != (channels, len(time)):
        raise ValueError(
            f"a block has the shape {block.shape} and its time {time.shape}; {channels} channels "
            f"of n samples each were announced: ({channels}, n) and (n,)"
        )
    return time, block


def _numbers(values: Array) -> Array:
    """As float64. Raises ValueError for what a conversion would change: complex, masked, text."""
    try:
        given = np.asanyarray(values)
    except Exception as error:  # noqa: BLE001 - an object may say anything to numpy
        raise ValueError(f"a block is no array of numbers: {type(error).__name__}") from None
    if given.dtype.kind not in "iuf" or isinstance(given, np.ma.MaskedArray):
        masked = "masked " if isinstance(given, np.ma.MaskedArray) else ""
        raise ValueError(f"a block holds {masked}{given.dtype} and no real numbers")
    return np.asarray(given, dtype=np.float64)


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
    finite = np.isfinite(block)
    if finite.all():
        return None
    index = int(np.argmin(finite.all(axis=0)))
    row = int(np.argmax(~np.isfinite(block[:, index])))
    reason = f"{names[row]} is {block[row, index]} at {time[index]:.4g} s"
    return index, Verdict("undefined", Outcome.DIVERGED, reason, float(time[index]))


def tells_of_gaps(ending: Ending, told: Sequence[str]) -> bool:
    """Whether a recording says itself that samples of it are undefined."""
    if ending.outcome is Outcome.DIVERGED or ending.fault is Fault.LOST_SAMPLES:
        return True
    return any("were lost and are NaN" in text for text in told)
