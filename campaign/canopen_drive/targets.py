"""Targets of a trial, one per SYNC, and the ramp that the drive generates between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from campaign.signals import Polyline
from campaign.trial import Task

SAME = 1e-6
"""Relative tolerance for equal slopes of a profile."""
FASTER = 1.05
"""Slope as a multiple of the steepest step: the drive reaches each target by the next SYNC."""


@dataclass(frozen=True)
class Targets:
    """Targets and slope of a trial.

    Attributes:
        values: shape (n,), rad/s or N m, at each SYNC.
        slope: rad/s^2 or N m/s, for 6083h and 6084h, or for 6087h.
    """

    values: np.ndarray
    slope: float


def targets_of(task: Task) -> Targets:
    """Ends of the ramps if all have one slope (the drive generates them); else each sample."""
    count = task.samples
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
    """Common magnitude of all slopes; 0 if they differ, or for a step."""
    step, change = np.diff(times), np.abs(np.diff(values))
    ramps = change > 0
    if not ramps.any() or not step[ramps].all():
        return 0.0
    slopes = change[ramps] / step[ramps]
    same = bool(np.ptp(slopes) <= SAME * slopes.max())
    return float(slopes.mean()) if same else 0.0
