"""The period over position with which force or friction repeats: of a screw, a motor, a gear."""

from __future__ import annotations

import numpy as np

from campaign.identification.inverse.motion import Array

FEWEST, MOST = 2.0, 200.0
"""Periods in the travel between which one is looked for."""
FINE = 8
"""Tried periods per period in the travel: two neighbours shift by an eighth over all of it."""
FEWEST_ROWS = 10.0
"""Rows per period, on average, where the axis moves: below that nothing is seen of it."""


def find_period(position: Array, rate: Array, residuals: Array) -> float | None:
    """The period (rad, or m) at which residuals, of shape (n,), repeat most; None for no travel.

    Force over position and friction over position (with the sign of the rate) count alike. Whether
    it is worth a term is for blocks that were left out to say.
    """
    travel = float(np.ptp(position))
    steps = np.abs(np.diff(position))
    moving = steps[steps > 1e-3 * float(steps.max(initial=0.0))]
    if travel == 0.0 or len(moving) == 0:
        return None
    most = min(MOST, travel / (FEWEST_ROWS * float(np.median(moving))))
    if most <= FEWEST:
        return None
    counts = np.arange(FEWEST, most, 1.0 / FINE)
    direction = np.sign(rate)
    gains = []
    for count in counts:
        angle = 2.0 * np.pi * count * position / travel
        wave = np.column_stack([np.sin(angle), np.cos(angle)])
        both = np.column_stack([wave, direction[:, None] * wave])
        values = np.linalg.lstsq(both.T @ both, both.T @ residuals, rcond=None)[0]
        gains.append(float(values @ (both.T @ residuals)))
    return float(travel / counts[int(np.argmax(gains))])
