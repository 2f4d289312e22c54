"""Fewer points for a long line, without losing a peak, an end or a gap."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

POINTS = 3000
"""Most points of a drawn line: about four per pixel column of a page."""


def decimate(x: Array, y: Array, points: int = POINTS) -> tuple[Array, Array]:
    """At most `points` of the line's own points, both shape (n,), in their order.

    Each of `points / 4` equal stretches keeps its extremes in x and in y (for a time series: its
    first, last, lowest and highest sample), so the picture is the same; a stretch without any
    finite point stays a gap.
    """
    count = len(x)
    if count <= points:
        return x, y
    edges = np.linspace(0, count, max(points // 4, 1) + 1).astype(int)
    keep = np.unique(np.concatenate([_extremes(x, y, int(a), int(b)) for a, b in pairwise(edges)]))
    return x[keep], y[keep]


def _extremes(x: Array, y: Array, start: int, stop: int) -> NDArray[np.intp]:
    finite = start + np.flatnonzero(np.isfinite(x[start:stop]) & np.isfinite(y[start:stop]))
    if not len(finite):
        return np.array([start])
    within_x, within_y = x[finite], y[finite]
    picks = (within_x.argmin(), within_x.argmax(), within_y.argmin(), within_y.argmax())
    return finite[list(picks)]
