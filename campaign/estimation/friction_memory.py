"""Memory angle of friction after a reversal."""

from __future__ import annotations

import math

import numpy as np

from campaign.arrays import Array

LEVELS = (0.5, 0.9)
"""Shares of the settled torque between which the displacement is measured."""
BINS = 500
"""Number of bins of a reversal, so that noise does not cross a level before friction."""


def memory_angle(time: Array, rate: Array, torque: Array, settled: float) -> float:
    """Ts / sigma0 (rad): the displacement over which friction approaches its settled value.

    A slow load displaces its bristles before it slides. Then friction is F = Fs (1 - c exp(-x / m))
    with the displacement x of the load (Dahl's model; LuGre's and others at low rates), for any
    initial state. So m is the displacement between two levels of F / Fs, over
    ln((1 - 0.5) / (1 - 0.9)). It does not depend on the drive's rise time and gains.

    Args:
        time, rate, torque: of the reversal, beginning before the load moves (s, rad/s, N m), evenly
            spaced, shape (n,).
        settled: friction torque (N m) of the following steady sliding, signed.

    NaN where the torque begins above the lower level, or does not pass both levels.
    """
    used = len(time) // BINS * BINS if len(time) > BINS else len(time)
    step = float(np.mean(np.diff(time)))
    moved = np.abs(np.cumsum(rate[:used]) * step)
    share = torque[:used] / settled
    moved, share = (values.reshape(min(BINS, used), -1).mean(axis=1) for values in (moved, share))
    above = [share >= level for level in LEVELS]
    if above[0][0] or not above[1].any():
        return math.nan
    low, high = (
        float(np.interp(level, share[k - 1 : k + 1], moved[k - 1 : k + 1]))
        for level, k in zip(LEVELS, map(np.argmax, above), strict=True)
    )
    return max(high - low, 0.0) / math.log((1.0 - LEVELS[0]) / (1.0 - LEVELS[1]))
