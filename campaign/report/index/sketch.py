"""A figure as a thumbnail of its curves.

Drawings of a report shrink to something that nobody can read. What is drawn here is from the
numbers of `report.json`, which is read as anybody's: what is no number is left out.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from campaign.report.palette import looks

WIDTH, HEIGHT, EDGE = 240, 135, 9
CURVES = 12
"""Most curves of a panel that are drawn."""
PIECES = 110
"""Stretches of a long line; of each the lowest and the highest point are drawn."""
DOTS = 90
"""Most points that are drawn of a curve of single points."""

Point = tuple[float, float]


def sketch(figure: Mapping[str, Any]) -> str:
    """SVG of the first panel that has something to draw; the empty text for none."""
    panels = figure.get("panels")
    for panel in panels if isinstance(panels, list) else ():
        curves = list(_curves(panel)) if isinstance(panel, dict) else []
        if curves:
            return _drawn(curves)
    return ""


def _curves(panel: Mapping[str, Any]) -> Iterator[tuple[str, bool, list[Point]]]:
    """Series, whether it is of single points, and its points along the panel's axes."""
    logs = [_scale(panel.get(axis)) == "log" for axis in ("x", "y")]
    curves = panel.get("curves")
    for curve in (curves if isinstance(curves, list) else [])[:CURVES]:
        if isinstance(curve, dict) and isinstance(curve.get("x"), list):
            y = curve.get("y")
            pairs = zip(curve["x"], y if isinstance(y, list) else (), strict=False)
            points = [(a, b) for a, b in (_along(pair, logs) for pair in pairs) if _finite(a, b)]
            if points:
                yield str(curve.get("series", "")), curve.get("style") == "points", points


def _scale(axis: object) -> object:
    return axis.get("scale") if isinstance(axis, dict) else None


def _along(pair: tuple[object, object], logs: Sequence[bool]) -> Point:
    a, b = (_number(value, log=log) for value, log in zip(pair, logs, strict=True))
    return a, b


def _number(value: object, *, log: bool) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return math.nan
    try:
        number = float(value)
    except OverflowError:
        return math.nan
    if not log:
        return number
    return math.log10(number) if number > 0 else math.nan


def _finite(*values: float) -> bool:
    return all(abs(value) < 1e300 for value in values)


def _drawn(curves: Sequence[tuple[str, bool, list[Point]]]) -> str:
    every = [point for _, _, points in curves for point in points]
    across = _placing([x for x, _ in every], WIDTH)
    up = _placing([y for _, y in every], HEIGHT)
    chosen = looks(series for series, _, _ in curves)
    parts = []
    for series, single, points in curves:
        colour = chosen[series].light
        kept = points[:: -(-len(points) // DOTS)] if single else _extremes(points)
        placed = [(EDGE + across(x), HEIGHT - EDGE - up(y)) for x, y in kept]
        if single:
            dots = "".join(f"M{x:.1f} {y:.1f}h0" for x, y in placed)
            parts.append(f'<path d="{dots}" stroke="{colour}" stroke-width="6"/>')
        else:
            line = "L".join(f"{x:.1f} {y:.1f}" for x, y in placed)
            parts.append(f'<path d="M{line}" stroke="{colour}" stroke-width="2.5"/>')
    style = 'fill="none" stroke-linecap="round" stroke-linejoin="round"'
    box = f'viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {box} {style}>{"".join(parts)}</svg>'


def _placing(values: Sequence[float], size: int) -> Any:
    """A function from a value to its distance from the edge; a lone value is in the middle."""
    low, high = min(values), max(values)
    room = size - 2 * EDGE
    if not high > low:
        return lambda value: room / 2
    return lambda value: room * (value - low) / (high - low)


def _extremes(points: Sequence[Point]) -> list[Point]:
    """The line, or of a long one the lowest and the highest point of each stretch, in order."""
    if len(points) <= 2 * PIECES:
        return list(points)
    size = -(-len(points) // PIECES)
    kept = []
    for first in range(0, len(points), size):
        places = range(first, min(first + size, len(points)))
        ends = {min(places, key=lambda n: points[n][1]), max(places, key=lambda n: points[n][1])}
        kept += [points[n] for n in sorted(ends)]
    return kept
