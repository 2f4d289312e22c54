"""Interactive figures: zoom and values at the cursor.

The page contains the points of its drawings, and one script. Without the script, or before the
reader enables it, the page is static. The script draws with uPlot (`vendor/`, MIT).
"""

from __future__ import annotations

import base64
import html
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from campaign.report.drawing.curves import drawn_interval, drawn_points, scale_of
from campaign.report.drawing.decimate import points_of_each
from campaign.report.drawing.figures import axis_label, series_of
from campaign.report.page.folder import ShownFigure
from campaign.report.palette import Look, looks
from campaign.result import Axis, Curve, Figure, Mark, Panel

if TYPE_CHECKING:
    from markupsafe import Markup

Array = NDArray[np.float64]

HERE = Path(__file__).parent
FEWEST = 8
"""Minimum number of points of a line for a useful zoom."""
MOST = 5_000
"""Maximum number of points of a scatter on the page."""
LINES = ("line", "line+points", "thin")


@dataclass(frozen=True)
class Interactive:
    """Additions to the static page.

    Attributes:
        style: CSS.
        data: JSON by the anchor of each figure with zoom, escaped for the text of an element.
            Quotes are not escaped, which would make a page 2 % larger.
        script: script that the page's policy allows by its hash.
    """

    style: Markup
    data: Markup
    script: Markup


def interactive(figures: Iterable[ShownFigure]) -> Interactive:
    """Style, data and script for the figures with zoom (`zooms`)."""
    from markupsafe import Markup

    zoomed = {
        each.anchor: _figure(each.data, each.looks)
        for each in figures
        if each.data and zooms(each.data)
    }
    data = json.dumps(zoomed, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    script = f"{_text('vendor/uPlot.iife.min.js')}\n{_text('interactive.js')}"
    style = f"{_text('vendor/uPlot.min.css')}\n{_text('interactive.css')}"
    text = Markup(html.escape(data, quote=False))  # noqa: S704 (escaped)
    return Interactive(Markup(style), text, Markup(script))  # noqa: S704 (packaged files)


def _text(name: str) -> str:
    return (HERE / name).read_text(encoding="utf-8").strip()


def zooms(figure: Figure) -> bool:
    """Whether every panel has a line with enough points, and all lines go from left to right."""
    return bool(figure.panels) and all(_panel_zooms(figure, panel) for panel in figure.panels)


def _panel_zooms(figure: Figure, panel: Panel) -> bool:
    lines = [curve for curve in panel.curves if curve.style in LINES]
    bands = [curve for curve in panel.curves if curve.style == "band"]
    points = [curve for curve in panel.curves if curve.style == "points"]
    drawn = [drawn_points(curve, panel, points_of_each(figure))[0] for curve in (*lines, *bands)]
    known = [x[np.isfinite(x)] for x in drawn]
    return (
        len(lines) + len(bands) + len(points) == len(panel.curves)
        and any(len(x) >= FEWEST for x in known[: len(lines)])
        and all(bool(np.all(np.diff(x) >= 0)) for x in known)
        and all(len(curve.x) <= MOST for curve in points)
    )


class _Arrays:
    """Unique arrays as base64 of little-endian float32."""

    def __init__(self) -> None:
        self._places: dict[str, int] = {}

    def place(self, values: Array | NDArray[np.float32]) -> int:
        """Index of the array, which is added if it is new."""
        raw = np.asarray(values, dtype="<f4").tobytes()
        return self._places.setdefault(base64.b64encode(raw).decode(), len(self._places))

    def all(self) -> list[str]:
        return list(self._places)


def _figure(figure: Figure, chosen: Mapping[str, Look] | None) -> dict[str, Any]:
    arrays = _Arrays()
    chosen = chosen or looks(series_of(figure))
    panels = [
        {
            "title": panel.title,
            "x": _axis(panel.x),
            "y": _axis(panel.y),
            "curves": [
                _curve(figure, panel, curve, chosen[curve.series or curve.label], arrays)
                for curve in panel.curves
            ],
            "marks": [_mark(mark, panel) for mark in panel.marks if not mark.point],
        }
        for panel in figure.panels
    ]
    return {"across": figure.across, "panels": panels, "arrays": arrays.all()}


def _axis(axis: Axis) -> dict[str, Any]:
    limits = axis.limits if axis.limits and all(map(np.isfinite, axis.limits)) else None
    return {
        "label": axis_label(axis),
        "log": axis.scale == "log",
        "limits": limits and [end * scale_of(axis) for end in limits],
    }


def _mark(mark: Mark, panel: Panel) -> dict[str, Any]:
    """A labelled line, or the beginning and the end of an interval."""
    across = panel.x if mark.x is not None else panel.y
    ends = {"x": (mark.x, panel.x), "y": (mark.y, panel.y), "until": (mark.until, across)}
    shown = {
        name: value * scale_of(axis)
        for name, (value, axis) in ends.items()
        if value is not None and np.isfinite(value)
    }
    return {"label": mark.label, **shown}


def _curve(
    figure: Figure, panel: Panel, curve: Curve, look: Look, arrays: _Arrays
) -> dict[str, Any]:
    """One curve: its look, and the indices of its coordinates in the arrays."""
    x, y, y_low = drawn_points(curve, panel, points_of_each(figure))
    columns = {"y": y} | ({} if y_low is None else {"low": y_low, "high": y})
    ends = drawn_interval(curve, panel)
    if ends is not None:
        columns |= {"low": _at(x, ends[0], ends[1]), "high": _at(x, ends[0], ends[2])}
    keep = np.isfinite(x)
    if curve.style == "points":
        keep &= np.isfinite(y)
    order = np.flatnonzero(keep)[np.argsort(x[keep], kind="stable")]
    return {
        "label": curve.label,
        "style": curve.style,
        "colour": look.name,
        "dash": list(look.dash),
        "x": arrays.place(growing(x[order])),
        **{name: arrays.place(values[order]) for name, values in columns.items()},
    }


def _at(x: Array, whole_x: Array, whole: Array) -> Array:
    """An end of an interval, interpolated at the drawn points of the curve."""
    if len(x) == len(whole_x):
        return whole
    known = np.isfinite(whole_x)
    return np.interp(x, whole_x[known], whole[known])


def growing(x: Array) -> NDArray[np.float32]:
    """Convert sorted x, (n,), to strictly increasing float32.

    Values that are equal in float32 increase by one unit in the last place: a joined axis allows
    only one sample of a curve at each place.
    """
    narrow = x.astype(np.float32)
    while (stuck := np.flatnonzero(narrow[1:] <= narrow[:-1])).size:
        narrow[stuck + 1] = np.nextafter(narrow[stuck], np.float32(np.inf))
    return narrow
