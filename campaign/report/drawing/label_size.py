"""Minimum width of a drawing for legible labels."""

from __future__ import annotations

import re

LEGIBLE = 9.0
"""CSS pixels that the smallest label of a figure has at least."""


def legible_width(svg: str) -> float:
    """CSS pixels that a drawing must be wide for its smallest label to be `LEGIBLE`."""
    fonts = [float(size) for size in re.findall(r"font-size:\s*([\d.]+)px", svg)]
    box = view_box(svg)
    return LEGIBLE / min(fonts) * box[0] if fonts and box else 0.0


def view_box(svg: str) -> tuple[float, float] | None:
    """Width and height of a drawing in its own units."""
    found = re.search(r'viewBox="\S+ \S+ ([\d.]+) ([\d.]+)"', svg)
    return (float(found[1]), float(found[2])) if found else None
