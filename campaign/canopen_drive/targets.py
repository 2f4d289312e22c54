"""Targets of a trial, one for each SYNC, and the ramp between them that the drive makes itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from campaign.signals import Polyline
from campaign.trial import Task

SAME = 1e-6
"""Relative: slopes of one profile."""
FASTER = 1.05
"""times the steepest step from sample to sample: the drive is there at the next SYNC."""


@dataclass(frozen=True)
class Targets:
    """What the drive is to reach, and how fast.

    Attributes:
        values: shape (n,), rad/s or N m, of each SYNC.
        slope: rad/s^2 or N m/s, of 6083h and 6084h, or of 6087h.
    """

    values: np.ndarray
    slope: float


def targets_of(task: Task) -> Targets:
    """Of a command with one slope the ends of its ramps: the drive makes them. Else each sample."""
    count = max(1, round(task.duration * task.sample_rate))
    time = np.arange(count + 1) / task.sample_rate
    command = task.command
    if isinstance(command, Polyline) and (slope := _one_slope(command.times, command.values)):
        last = len(command.times) - 1
        part = np.searchsorted(command.times, time[:-1] + 1e-9 / task.sample_rate, "right")
        return Targets(np.asarray(command.values)[np.minimum(part, last)], slope)
    values = command.sample(time)
    steepest = float(np.max(np.abs(np.diff(values)))) * task.sample_rate
    return Targets(values[1:], FASTER * steepest)


def _one_slope(times: Sequence[float], values: Sequence[float]) -> float:
    """The magnitude of all ramps; 0 where they differ, or one is a jump."""
    step, change = np.diff(times), np.abs(np.diff(values))
    ramps = change > 0
    if not ramps.any() or not step[ramps].all():
        return 0.0
    slopes = change[ramps] / step[ramps]
    same = bool(np.ptp(slopes) <= SAME * slopes.max())
    return float(slopes.mean()) if same else 0.0
