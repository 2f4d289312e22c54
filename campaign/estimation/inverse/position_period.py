"""Spatial period of force or friction, as of a screw, a motor or a gear."""

from __future__ import annotations

import numpy as np

from campaign.arrays import Array

FEWEST, MOST = 1.0, 400.0
"""Range of the search, as numbers of periods in the travel."""
FINE = 8
"""Tried values per period in the travel: over it, neighbors differ by an eighth of a period."""
FEWEST_ROWS = 10.0
"""Fewest rows per period, at the rate of a row; faster rows do not resolve the period."""
SLOW = 0.1
"""Share of the slowest moving rows that determines the shortest period."""
CERTAIN = 2.0
"""Periods in the travel above which any wave counts. Friction that differs between the ends of the
travel, where the axis reverses, resembles a wave of fewer periods."""
WIDE = 0.5
"""Least share of the sum of squares that a longer wave must explain to count."""
FEWEST_PERIODS = 3.0
"""Least travel of the rows that count, in periods."""


def find_period(position: Array, rate: Array, residuals: Array, interval: float) -> float | None:
    """Strongest spatial period (rad, or m) of residuals, shape (n,); None without a candidate.

    Waves of force and of friction (with the sign of the rate) have the same weight. Each period
    uses only rows slow enough to resolve it. Held-out blocks decide later whether the model
    includes a term for the period.

    Args:
        rate: zero in omitted rows.
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
    """Rise of the log-likelihood, up to a factor, by waves of each period; 0 for too few rows.

    The model without waves has a spring and friction, which are similar to a long wave.
    """
    squares = np.zeros((len(periods), 7, 7))
    rights, (sizes, rows) = np.zeros((len(periods), 7)), np.zeros((2, len(periods)))
    for k, period in enumerate(periods.tolist()):
        own = steps * FEWEST_ROWS <= period
        if float(steps[own].sum()) < FEWEST_PERIODS * period:
            continue
        at, sign, values = position[own], np.sign(rate[own]), residuals[own]
        angle = 2.0 * np.pi * at / period
        columns = np.ones((7, len(at)))
        columns[1], columns[2] = at, sign
        columns[3], columns[4] = np.sin(angle), np.cos(angle)
        columns[5:] = sign * columns[3:5]
        squares[k], rights[k] = columns @ columns.T, columns @ values
        sizes[k], rows[k] = values @ values, len(at)
    before = _unexplained(squares[:, :3, :3], rights[:, :3], sizes)
    after = _unexplained(squares, rights, sizes)
    kept = (before > 0) & ~((periods > travel / CERTAIN) & (after > WIDE * before))
    gains = np.zeros(len(periods))
    gains[kept] = rows[kept] * np.log(before[kept] / np.maximum(after, 1e-12 * before)[kept])
    return gains


def _unexplained(squares: Array, rights: Array, sizes: Array) -> Array:
    """Residual sums of squares of m regressions, shape (m,).

    squares: products of k columns with each other, shape (m, k, k). rights: products with the
    values, (m, k). sizes: sums of squares of the values, (m,).
    """
    least = float(np.finfo(float).eps) * squares.shape[-1]
    inverse = np.linalg.pinv(squares, rcond=least, hermitian=True)
    explained = np.einsum("mi,mij,mj->m", rights, inverse, rights)
    return np.asarray(np.maximum(sizes - explained, 0.0))
