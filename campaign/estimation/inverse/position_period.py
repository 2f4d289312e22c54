"""Spatial period of force or friction: of a screw, a motor, a gear."""

from __future__ import annotations

import numpy as np

from campaign.arrays import Array

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
    gains = _gains(travel / counts, travel, *rows)
    if not np.any(gains):
        return None
    return float(travel / counts[int(np.argmax(gains))])


def _gains(
    periods: Array, travel: float, position: Array, rate: Array, residuals: Array, steps: Array
) -> Array:
    """Rise of the log-likelihood, but for a factor, by waves of each period; 0 for too few rows.

    Beyond a spring and friction: a long wave looks like these.
    """
    squares = np.zeros((len(periods), 7, 7))
    rights, (sizes, rows) = np.zeros((len(periods), 7)), np.zeros((2, len(periods)))
    for k, period in enumerate(periods.tolist()):
        own = steps * FEWEST_ROWS <= period
        if float(steps[own].sum()) < FEWEST_PERIODS * period:
            continue
        at, way, values = position[own], np.sign(rate[own]), residuals[own]
        angle = 2.0 * np.pi * at / period
        columns = np.ones((7, len(at)))
        columns[1], columns[2] = at, way
        columns[3], columns[4] = np.sin(angle), np.cos(angle)
        columns[5:] = way * columns[3:5]
        squares[k], rights[k] = columns @ columns.T, columns @ values
        sizes[k], rows[k] = values @ values, len(at)
    before = _unexplained(squares[:, :3, :3], rights[:, :3], sizes)
    after = _unexplained(squares, rights, sizes)
    told = (before > 0) & ~((periods > travel / CERTAIN) & (after > WIDE * before))
    gains = np.zeros(len(periods))
    gains[told] = rows[told] * np.log(before[told] / np.maximum(after, 1e-12 * before)[told])
    return gains


def _unexplained(squares: Array, rights: Array, sizes: Array) -> Array:
    """Sums of squares that columns leave of values, shape (m,): of the products of k columns with
    each other, shape (m, k, k), and with the values, (m, k), and of the values with themselves.
    """
    least = float(np.finfo(float).eps) * squares.shape[-1]
    inverse = np.linalg.pinv(squares, rcond=least, hermitian=True)
    told = np.einsum("mi,mij,mj->m", rights, inverse, rights)
    return np.asarray(np.maximum(sizes - told, 0.0))
