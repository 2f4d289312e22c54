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
"""Sample periods; a larger time error could indicate another sample."""


@dataclass(frozen=True)
class Verdict:
    """Reason to end a trial; for an existing recording, a reported violation.

    Attributes:
        kind: `limit`, `undefined`, `time`, `channels`, `shape`, `length`, `lost` or `silence`.
        time: time of the sample with the violation (s).
    """

    kind: str
    outcome: Outcome
    reason: str
    time: float
    fault: Fault | None = None


@dataclass(frozen=True)
class ArchivedChannels:
    """Channels of a trial in archived units.

    Attributes:
        factors: (channels, 1), unit conversion factors of the samples.
        converted: a text for each channel with a converted unit.
    """

    channels: tuple[ChannelInfo, ...] = ()
    factors: Array = field(default_factory=lambda: np.ones((0, 1)))
    converted: tuple[str, ...] = ()


def announced(trial: Trial, channels: Sequence[ChannelInfo]) -> ArchivedChannels:
    """`channels` with storable texts; channels of the vocabulary are converted to its units.

    Raises ValueError that names a channel which cannot be archived.
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
    converted = [in_known_unit(channel, mode, sides) for channel in given]
    return ArchivedChannels(
        tuple(channel for channel, _ in converted),
        np.array([[times] for _, times in converted]),
        tuple(
            f"{kept.name} was announced in {channel.unit} and is archived in {kept.unit}"
            for channel, (kept, times) in zip(given, converted, strict=True)
            if times != 1.0
        ),
    )


def make_watch(trial: Trial, names: Sequence[str]) -> tuple[LimitWatch | None, tuple[str, ...]]:
    """The watch of the bench's limits, and the limits that no channel of `names` shows.

    None for a bench without limits, or with limits that this version cannot read.
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
    """Time (n,) and block (channels, n) as float64; NaN for a block of None.

    Raises ValueError that states the given shapes or types.
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
    """Array as float64. Raises ValueError for complex, masked or text data."""
    try:
        given = np.asanyarray(values)
    except Exception as error:  # noqa: BLE001 - an object may raise any exception
        raise ValueError(f"a block is no array of numbers: {type(error).__name__}") from None
    if given.dtype.kind not in "iuf" or isinstance(given, np.ma.MaskedArray):
        masked = "masked " if isinstance(given, np.ma.MaskedArray) else ""
        raise ValueError(f"a block holds {masked}{given.dtype} and no real numbers")
    return np.asarray(given, dtype=np.float64)


def wrong_time(task: Task, first: int, time: Array) -> tuple[int, Verdict] | None:
    """Index and verdict of the first sample with a wrong time or after the trial's end, or None.

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
    """Index and verdict of the first sample with an infinite value or NaN, or None."""
    finite = np.isfinite(block)
    if finite.all():
        return None
    index = int(np.argmin(finite.all(axis=0)))
    row = int(np.argmax(~np.isfinite(block[:, index])))
    reason = f"{names[row]} is {block[row, index]} at {time[index]:.4g} s"
    return index, Verdict("undefined", Outcome.DIVERGED, reason, float(time[index]))


def mentions_gaps(ending: Ending, texts: Sequence[str]) -> bool:
    """Whether a recording itself reports undefined samples."""
    if ending.outcome is Outcome.DIVERGED or ending.fault is Fault.LOST_SAMPLES:
        return True
    return any("were lost and are NaN" in text for text in texts)
