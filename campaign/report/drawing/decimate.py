"""Decimation of long lines that keeps peaks, ends and gaps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from campaign.result import Figure

Array = NDArray[np.float64]

POINTS = 3000
"""Maximum number of points of a drawn line: about four per pixel column of a page."""
FIGURE_POINTS = 40_000
"""Maximum number of points of all lines of a figure."""


def points_of_each(figure: Figure) -> int:
    """Maximum number of points of each line of a figure; its lines share `FIGURE_POINTS`."""
    total = sum(len(panel.curves) for panel in figure.panels)
    return max(64, min(POINTS, FIGURE_POINTS // max(total, 1)))


def decimate(x: Array, y: Array, points: int = POINTS) -> tuple[Array, Array]:
    """Reduce a line to at most `points` of its own points, both shape (n,), in their order.

    Each of `points / 4` equal segments keeps its extremes in x and in y (for a time series: its
    first, last, lowest and highest sample), so that the picture is the same. A segment without a
    finite point remains a gap.
    """
    keep = kept(x, y, points)
    return x[keep], y[keep]


def kept(x: Array, y: Array, points: int) -> NDArray[np.intp]:
    """Indices of the points that `decimate` keeps; all for at most `points`."""
    if len(x) <= points:
        return np.arange(len(x))
    edges = np.linspace(0, len(x), max(points // 4, 1) + 1).astype(int)
    starts, lengths = edges[:-1], np.diff(edges)
    finite = np.isfinite(x) & np.isfinite(y)
    picks = []
    for values in (x, y):
        for extreme, blank in ((np.minimum, np.inf), (np.maximum, -np.inf)):
            known = np.where(finite, values, blank)
            picks.append(_first(known, extreme.reduceat(known, starts), starts, lengths))
    return np.unique(np.concatenate(picks))


def _first(
    values: Array, wanted: Array, starts: NDArray[np.intp], lengths: NDArray[np.intp]
) -> NDArray[np.intp]:
    """First index of the wanted value in each segment; the start if no value is finite."""
    matches = np.flatnonzero(values == np.repeat(wanted, lengths))
    return matches[np.searchsorted(matches, starts)]
