"""A torque ramp from rest in short bins, for the presliding fit."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from campaign.arrays import Array, Flags

BINS = 250
"""Number of bins of a ramp: a small part of the curve each, with almost independent noise."""
LONGEST_BIN = 0.1
"""Longest bin (s): a slow ramp has more than `BINS`."""
FEWEST_BINS = 20
"""Fewest bins of a ramp for a curve and its errors."""


@dataclass(frozen=True)
class Ramp:
    """A positive torque ramp in bins.

    Attributes:
        edges: of the bins (s), shape (n + 1,).
        torque: drive torque at the edges (N m): 0 before the ramp, then linear; shape (n + 1,).
        rate: mean gyro rate of each bin (rad/s), shape (n,).
        resting: number of bins before the ramp.
        slope: of the torque (N m/s).
    """

    edges: Array
    torque: Array
    rate: Array
    resting: int
    slope: float

    @property
    def typical_rate(self) -> float:
        """Median rate of the later half of the ramp less that at rest (rad/s), to start a fit."""
        bias = float(np.mean(self.rate[: self.resting])) if self.resting else 0.0
        moving = self.rate[self.resting :]
        least = 1e-3 * float(np.std(self.rate)) + float(np.finfo(float).tiny)
        return max(float(np.median(moving[len(moving) // 2 :])) - bias, least)

    def until(self, torque: float) -> Ramp:
        """Part of the ramp up to a torque (N m)."""
        count = int(np.searchsorted(self.torque, torque, side="right")) - 1
        return replace(
            self,
            edges=self.edges[: count + 1],
            torque=self.torque[: count + 1],
            rate=self.rate[:count],
        )

    def used(self, first: float) -> Flags:
        """Mask of the fitted bins, shape (n,): those at rest, and those from `first` (N m) on."""
        used: Flags = self.torque[:-1] >= first
        used[: self.resting] = True
        return used


def ramp_of(time: Array, rate: Array, torque: Array, start: float, top: float) -> Ramp:
    """Bins of a recorded ramp that begins at `start` (s), up to a torque of `top` (N m).

    time (s), rate (rad/s) and torque (N m) have shape (n,), are evenly sampled, and positive.
    Raises ValueError for too few samples, and for a torque that does not rise.
    """
    interval = float(np.ptp(time)) / max(len(time) - 1, 1)
    begin = int(np.searchsorted(time, start - 0.5 * interval))
    length = np.arange(1, len(time) - begin + 1)
    # The mean of a ramp is half of its last value: this determines the end despite noise.
    end = begin + int(np.searchsorted(np.cumsum(torque[begin:]) / length, 0.5 * top))
    end = min(end, len(time))
    if end - begin < FEWEST_BINS:
        raise ValueError(f"only {end - begin} samples lie below the end of the ramp")
    slope, level = np.polyfit(time[begin:end], torque[begin:end], 1)
    if slope <= 0:
        raise ValueError("the drive torque does not rise: it is no ramp")
    each = max(1, round(min(LONGEST_BIN, (end - begin) * interval / BINS) / interval))
    resting, moving = begin // each, (end - begin) // each
    first = begin - resting * each
    count = resting + moving
    edges: Array = np.asarray(time[first] + interval * (each * np.arange(count + 1) - 0.5))
    rates = rate[first : first + count * each].reshape(count, each).mean(axis=1)
    line = np.maximum(slope * edges + level, 0.0)
    line[:resting] = 0.0
    return Ramp(edges, line, rates, resting, float(slope))
