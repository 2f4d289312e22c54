"""A returned recording: its channels on the trial's time base."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from campaign.axis_kind import sides_in
from campaign.backends.handover.excitation import facts_of
from campaign.channels import COMMAND, GYRO_RATE, RELATIVE_RATE, info, missing
from campaign.importing.derived_channels import AT_REST
from campaign.importing.description import RecordingDescription
from campaign.importing.mapped_trials import describe
from campaign.importing.mapping import Layout, RecordingEntry
from campaign.importing.reader import RecordingReader
from campaign.recording import Array, ChannelInfo
from campaign.trial import Trial

CLOCK = 1e-3
"""Largest relative difference of two clocks; beyond it, it is another sample rate."""
DRIFT = 0.25
"""Total drift in sample periods above which a recording is interpolated to the trial's clock."""


@dataclass(frozen=True)
class ReturnedRecording:
    """A returned recording, ready for a recorder.

    Attributes:
        channels: in the order of the rows of `samples`, shape (channels, n).
        time: shape (n,), s; sample k at k / `Task.sample_rate`.
        lost: which samples are missing, shape (n,).
        rate: sample rate (Hz) by its own clock.
        duration: total duration (s); `samples` end with the trial.
        remarks: sentences about modifications.
    """

    channels: tuple[ChannelInfo, ...]
    time: Array
    samples: Array
    lost: np.ndarray
    rate: float
    duration: float
    remarks: tuple[str, ...]

    def __getitem__(self, name: str) -> Array:
        """Samples of a channel. Raises KeyError if it was not recorded."""
        return self.by_name[name]

    @property
    def by_name(self) -> Mapping[str, Array]:
        """Samples by the name of the channel."""
        rows = zip(self.channels, self.samples, strict=True)
        return {channel.name: row for channel, row in rows}

    def cut(self, count: int, remark: str) -> ReturnedRecording:
        """The first `count` samples, with a further remark."""
        return replace(
            self,
            time=self.time[:count],
            samples=self.samples[:, :count],
            lost=self.lost[:count],
            remarks=(*self.remarks, remark),
        )


class OtherRateError(ValueError):
    """The recording has another sample rate than the trial."""


class ColumnsError(ValueError):
    """The channels of the layout are not those that the trial needs."""


def read_returned(
    trial: Trial, files: Sequence[Path], layout: Layout, wanted: Collection[str]
) -> ReturnedRecording:
    """Read the recording from `files`, which have one clock.

    Raises RecordingError for unreadable files, MappingError for files that do not match the layout,
    OtherRateError and ColumnsError.
    """
    names = [path.name for path in files]
    entry = RecordingEntry(file=tuple(names))
    opened, descriptions = describe(entry, layout, files, names, facts_of(trial), wanted)
    with opened:
        ((described, _),) = descriptions
        task, rate = trial.task, described.sample_rate
        ratio = rate / task.sample_rate
        if abs(ratio - 1.0) > CLOCK:
            raise OtherRateError(_other_rate(rate, task.sample_rate))
        channels = tuple(_announced(trial, made.info) for made in described.channels)
        _check_channels(trial, described)
        enough = math.ceil((task.samples - 1) * ratio) + 2
        read = described.model_copy(update={"samples": min(described.samples, enough)})
        blocks = list(RecordingReader(read, opened).blocks())
    samples = np.concatenate([block for _, block, _ in blocks], axis=1)
    lost = np.concatenate([gone for _, _, gone in blocks])
    remarks = list(described.remarks)
    over = described.samples - enough
    if over > 0:
        remarks.append(f"what it has after the trial, {over / rate:.4g} s, is left out")
    samples, lost = _on_the_grid(samples, lost, ratio, task.samples, remarks)
    time = np.arange(samples.shape[1]) / task.sample_rate
    return ReturnedRecording(
        channels, time, samples, lost, rate, described.samples / rate, tuple(remarks)
    )


def _check_channels(trial: Trial, described: RecordingDescription) -> None:
    """Raise ColumnsError for a missing channel, or one derived for a hull at rest that moves."""
    names = [each.name for each in described.channels]
    if lacking := missing(trial.requires, names):
        raise ColumnsError(
            f"{', '.join(lacking)}: {trial.kind} needs it, and no column is one; there are "
            f"{', '.join(names)}"
        )
    at_rest = any(AT_REST in remark for remark in described.remarks)
    if at_rest and trial.task.base_acceleration.shape != "zero":
        raise ColumnsError(
            f"the hull moves in {trial.name}, so {GYRO_RATE} and {RELATIVE_RATE} have both to be "
            "recorded"
        )


def _on_the_grid(
    samples: Array, lost: np.ndarray, ratio: float, count: int, remarks: list[str]
) -> tuple[Array, np.ndarray]:
    """Samples at the times of the trial; `ratio`: recorded rate / trial's rate, `count`: needed."""
    have = samples.shape[1]
    if abs(ratio - 1.0) * min(have, count) <= DRIFT:
        return samples[:, :count], lost[:count]
    at = np.arange(count) * ratio
    at = np.minimum(at[at <= have - 1 + DRIFT], have - 1.0)
    rows = np.arange(have)
    remarks.append(
        f"its clock differs from the trial's by {1e6 * (ratio - 1.0):.4g} ppm; its samples were "
        "put on lines between those that were recorded"
    )
    placed = np.array([np.interp(at, rows, row) for row in samples])
    below = np.floor(at).astype(int)
    gone = lost[below] | lost[np.minimum(below + 1, have - 1)]
    return placed, gone


def _announced(trial: Trial, channel: ChannelInfo) -> ChannelInfo:
    """Channel for announcement; the command gets the label of the mode. Raises ColumnsError."""
    if channel.name != COMMAND:
        return channel
    due = info(COMMAND, trial.task.mode, axis=sides_in(trial.bench).load)
    if due.unit != channel.unit:
        raise ColumnsError(
            f"the command is read in {channel.unit}, and the trial commands {due.unit}"
        )
    return due


def _other_rate(rate: float, wanted: float) -> str:
    return (
        f"it was recorded at {rate:.6g} Hz instead of {wanted:.6g} Hz; record at that rate, or "
        "change the test's sample_rate"
    )
