"""The period over position with which force or friction repeats: of a screw, a motor, a gear."""

from __future__ import annotations

import numpy as np

from campaign.identification.inverse.motion import Array

FEWEST, MOST = 1.0, 400.0
"""Periods in the travel between which one is looked for."""
FINE = 8
"""Tried periods per period in the travel: two neighbours shift by an eighth over all of it."""
FEWEST_ROWS = 10.0
"""Rows in a period, at least, at the rate of a row that counts: a faster one does not show it."""
SLOW = 0.1
"""Share of the moving rows, the slowest, that set the shortest period."""
CERTAIN = 2.0
"""Periods in the travel from which on any wave counts: friction that differs at both ends of the
travel, where the axis turns round, looks like less than that ..."""
WIDE = 0.5
"""... so that a longer wave counts where it explains this share of what it was looked for in."""
FEWEST_PERIODS = 3.0
"""of rows that count, at least."""


def find_period(position: Array, rate: Array, residuals: Array, interval: float) -> float | None:
    """The period (rad, or m) at which residuals, of shape (n,), repeat most; None for no travel.

    Force over position and friction over position (with the sign of the rate) count alike. Of each
    period those rows count that are slow enough to show it, whatever the others do. Whether it is
    worth a term is for blocks that were left out to say.

    Args:
        rate: zero in rows that were left out, whose position says nothing.
        interval: of the rows (s).
    """
    steps = np.abs(rate) * interval
    moving = steps > 1e-3 * float(steps.max(initial=0.0))
    if not np.any(moving):
        return None
    travel = float(np.ptp(position[moving]))
    if travel == 0.0:
        return None
    most = min(MOST, travel / (FEWEST_ROWS * float(np.quantile(steps[moving], SLOW))))
    counts = np.arange(FEWEST, most, 1.0 / FINE)
    rows = position[moving], rate[moving], residuals[moving], steps[moving]
    gains = [_gain(travel / count, travel, *rows) for count in counts]
    if not any(gains):
        return None
    return float(travel / counts[int(np.argmax(gains))])


def _gain(
    period: float, travel: float, position: Array, rate: Array, residuals: Array, steps: Array
) -> float:
    """Rise of the log-likelihood, but for a factor, by waves of this period; 0 for too few rows.

    Beyond a spring and friction: a long wave looks like these.
    """
    own = steps * FEWEST_ROWS <= period
    if float(steps[own].sum()) < FEWEST_PERIODS * period:
        return 0.0
    angle, way = 2.0 * np.pi * position[own] / period, np.sign(rate[own])
    line = np.column_stack([np.ones(len(angle)), position[own], way])
    waves = np.column_stack(
        [np.sin(angle), np.cos(angle), way * np.sin(angle), way * np.cos(angle)]
    )
    before, after = (
        _unexplained(each, residuals[own]) for each in (line, np.column_stack([line, waves]))
    )
    if period > travel / CERTAIN and after > WIDE * before:
        return 0.0
    return len(angle) * float(np.log(before / max(after, 1e-12 * before))) if before > 0 else 0.0


def _unexplained(columns: Array, values: Array) -> float:
    """Sum of squares (of `values`, shape (n,)) that columns of shape (n, k) leave."""
    right = columns.T @ values
    found = np.linalg.lstsq(columns.T @ columns, right, rcond=None)[0]
    return max(float(values @ values - right @ found), 0.0)
