"""Thumbnail of the curves of a figure.

Small drawings of a report are illegible. Therefore the thumbnail is drawn from the numbers of
`report.json`. This file is untrusted: entries that are no numbers are ignored.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from campaign.report.drawing.decimate import decimate
from campaign.report.palette import looks
from campaign.result import is_number

WIDTH, HEIGHT, EDGE = 240, 135, 9
CURVES = 12
"""Maximum number of drawn curves of a panel."""
POINTS, DOTS = 220, 90
"""Maximum number of drawn points of a line, and of a curve of single points."""
LARGEST = 1e300
"""Limit of the absolute value of drawn numbers."""

Array = NDArray[np.float64]
Series = tuple[str, bool, Array]
"""Name of a series, whether it has single points, and its points along the axes, (2, n)."""


def sketch(figure: Mapping[str, Any]) -> str:
    """SVG of the first panel with curves to draw; "" without any."""
    panels = figure.get("panels")
    for panel in panels if isinstance(panels, list) else ():
        curves = list(_curves(panel)) if isinstance(panel, dict) else []
        if curves:
            return _drawn(curves)
    return ""


def _curves(panel: Mapping[str, Any]) -> Iterator[Series]:
    curves = panel.get("curves")
    for curve in (curves if isinstance(curves, list) else [])[:CURVES]:
        if isinstance(curve, dict):
            x, y = (_numbers(curve.get(axis), panel.get(axis)) for axis in ("x", "y"))
            count = min(len(x), len(y))
            points = np.stack([x[:count], y[:count]])
            points = points[:, np.all(np.abs(points) < LARGEST, axis=0)]
            if points.size:
                yield str(curve.get("series", "")), curve.get("style") == "points", points


def _numbers(values: object, axis: object) -> Array:
    """Coordinates along an axis; NaN for values without one."""
    items = values if isinstance(values, list) else []
    plain = [item if is_number(item) else None for item in items]
    try:
        places = np.array(plain, dtype=float)
    except OverflowError:  # an integer beyond the range of floats
        return np.empty(0)
    if isinstance(axis, dict) and axis.get("scale") == "log":
        places = np.log10(places, out=np.full(len(places), np.nan), where=places > 0)
    return places


def _drawn(curves: Sequence[Series]) -> str:
    every = np.concatenate([points for _, _, points in curves], axis=1)
    low, span = every.min(axis=1), np.ptp(every, axis=1)
    room = np.array([WIDTH, HEIGHT]) - 2.0 * EDGE
    chosen = looks(series for series, _, _ in curves)
    parts = []
    for series, single, points in curves:
        colour = chosen[series].light
        step = -(-points.shape[1] // DOTS)
        kept = points[:, ::step] if single else np.stack(decimate(points[0], points[1], POINTS))
        share = np.full(kept.shape, 0.5)  # a single value is in the middle
        np.divide(kept.T - low, span, out=share.T, where=span > 0)
        placed = [(EDGE + x, HEIGHT - EDGE - y) for x, y in (share.T * room).tolist()]
        if single:
            dots = "".join(f"M{x:.1f} {y:.1f}h0" for x, y in placed)
            parts.append(f'<path d="{dots}" stroke="{colour}" stroke-width="6"/>')
        else:
            line = "L".join(f"{x:.1f} {y:.1f}" for x, y in placed)
            parts.append(f'<path d="M{line}" stroke="{colour}" stroke-width="2.5"/>')
    style = 'fill="none" stroke-linecap="round" stroke-linejoin="round"'
    box = f'viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {box} {style}>{"".join(parts)}</svg>'
