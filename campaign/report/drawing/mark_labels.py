"""Marks of a panel, and their labels placed off the data.

Labels of lines and stretches are outside of the axes, away from the curves. The label of a point is
beside it if there is room, else outside.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from campaign.report.drawing.canvas import TITLE_PAD
from campaign.report.drawing.curves import scale_of
from campaign.report.palette import MUTED, Look
from campaign.result import Mark, Panel

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas
    from matplotlib.text import Annotation
    from matplotlib.transforms import Bbox

SIZE = 8.0
"""Size of the smallest text of a figure (points)."""
ROW = 10.5
"""Pitch of rows of labels (points)."""
GAP = 2.0
"""Distance between the axes and a label (points)."""
WRAP = 16
"""Characters per line of a label in the margin, which reduces the width of the axes."""
SPARE = 1.15
"""Ratio by which the font of a page may be wider than the measured font."""
DISTANCES = (5.0, 10.0, 18.0, 28.0, 42.0, 60.0)
"""Distances from a dot to the nearest corner or side of its label (points)."""
LEADER = 16.0
"""Minimum distance for a thin line from the dot to its label (points)."""
WAYS = tuple(math.radians(angle) for angle in (45, 0, 135, 180, -45, -135, 90, -90))


@dataclass
class PanelMarks:
    """Drawing state of the marks of one panel.

    Attributes:
        above, beside, inside: labels above the axes, in their right margin, and next to dots.
        points: dots whose labels are not placed in the margin: x, y (display units), label, colour.
    """

    ax: Axes
    panel: Panel
    chosen: Mapping[str, Look]
    above: list[Annotation] = field(default_factory=list)
    beside: list[Annotation] = field(default_factory=list)
    inside: list[Annotation] = field(default_factory=list)
    points: list[tuple[float, float, str, str]] = field(default_factory=list)

    def colour(self, mark: Mark) -> str:
        return self.chosen[mark.series].light if mark.series in self.chosen else MUTED.light


def draw_marks(marked: PanelMarks) -> None:
    """Draw lines, stretches and dots, and collect labels for `place_labels`."""
    ax = marked.ax
    for mark in marked.panel.marks:
        x = None if mark.x is None else mark.x * scale_of(marked.panel.x)
        y = None if mark.y is None else mark.y * scale_of(marked.panel.y)
        if not all(math.isfinite(each) for each in (x, y) if each is not None):
            continue
        colour = marked.colour(mark)
        if mark.point and x is not None and y is not None:
            ax.plot([x], [y], "o", color=colour, markersize=4.5, zorder=3.5)
            marked.points.append((x, y, mark.label, colour))
        elif mark.until is not None and math.isfinite(mark.until):
            _stretch(marked, mark.until, mark.label, x, y, colour)
        else:
            line: dict[str, Any] = {"color": colour, "linewidth": 0.8, "dashes": (3, 2)}
            if x is not None:
                ax.axvline(x, zorder=1.5, **line)
                _above(marked, x, mark.label, colour)
            if y is not None:
                ax.axhline(y, zorder=1.5, **line)
                if x is None:
                    _beside(marked, y, mark.label, colour)


def _stretch(
    marked: PanelMarks, until: float, label: str, x: float | None, y: float | None, colour: str
) -> None:
    """Shade from `x` or `y` (display units) to `until` (unit of the axis), with a label."""
    shade: dict[str, Any] = {"color": colour, "alpha": 0.13, "linewidth": 0, "zorder": 0.5}
    if x is not None:
        until *= scale_of(marked.panel.x)
        marked.ax.axvspan(x, until, **shade)
        _above(marked, _middle(x, until, marked.ax.get_xscale()), label, colour)
    elif y is not None:
        until *= scale_of(marked.panel.y)
        marked.ax.axhspan(y, until, **shade)
        _beside(marked, _middle(y, until, marked.ax.get_yscale()), label, colour)


def _middle(one: float, other: float, scale: str) -> float:
    if scale == "log" and one > 0 and other > 0:
        return math.sqrt(one * other)
    return 0.5 * (one + other)


def _in_view(ends: tuple[float, float], value: float) -> bool:
    return min(ends) <= value <= max(ends)


def _above(marked: PanelMarks, x: float, label: str, colour: str) -> None:
    ax = marked.ax
    if label and _in_view(ax.get_xlim(), x):
        at = ax.get_xaxis_transform()
        marked.above.append(_text(ax, label, (x, 1.0), at, (0, GAP), "center", "bottom", colour))


def _beside(marked: PanelMarks, y: float, label: str, colour: str) -> None:
    ax = marked.ax
    if label and _in_view(ax.get_ylim(), y):
        at, text = ax.get_yaxis_transform(), textwrap.fill(label, WRAP)
        marked.beside.append(_text(ax, text, (1.0, y), at, (GAP + 1, 0), "left", "center", colour))


def _text(
    ax: Axes,
    label: str,
    at: tuple[float, float],
    coordinates: Any,
    offset: tuple[float, float],
    horizontal: str,
    vertical: str,
    colour: str,
) -> Annotation:
    return ax.annotate(
        label,
        at,
        xycoords=coordinates,
        xytext=offset,
        textcoords="offset points",
        ha=horizontal,
        va=vertical,
        fontsize=SIZE,
        color=colour,
        annotation_clip=False,
        zorder=4,
    )


def place_labels(sheet: Canvas, panels: Sequence[PanelMarks]) -> None:
    """Place every label, and make room for labels outside of their axes."""
    margins = sheet.get_layout_engine()
    if not any(each.above or each.beside or each.points for each in panels) or margins is None:
        return
    margins.execute(sheet)
    for each in panels:
        _stack_above(sheet, each)
    margins.execute(sheet)
    outside = [each for each in panels if _place_points(sheet, each)]
    if outside:
        margins.execute(sheet)  # labels in the margin make the axes smaller
        for each in panels:
            _place_points(sheet, each)
    for each in panels:
        _spread_beside(sheet, each)
    sheet.set_layout_engine("none")  # keeps all placed labels


def _extent(text: Annotation) -> Bbox:
    """Box of a label (pixels), widened by `SPARE`."""
    box = text.get_window_extent()
    return box.expanded(SPARE, 1.0)


def _stack_above(sheet: Canvas, marked: PanelMarks) -> None:
    """Place labels above the axes, within their width, in rows without overlap."""
    ends: list[float] = []
    axes = marked.ax.get_window_extent()
    per_point = sheet.dpi / 72
    for text in sorted(marked.above, key=lambda each: each.xy[0]):
        box = _extent(text)
        shift = max(axes.x0 - box.x0, 0.0) + min(axes.x1 - box.x1, 0.0)
        left, right = box.x0 + shift, box.x1 + shift
        row = next((k for k, end in enumerate(ends) if end + 3 * per_point < left), len(ends))
        ends[row : row + 1] = [right]
        text.set_position((shift / per_point, GAP + row * ROW))
    if ends and marked.ax.get_title(loc="left"):
        pad = TITLE_PAD + len(ends) * ROW
        marked.ax.set_title(marked.ax.get_title(loc="left"), pad=pad)


def _spread_beside(sheet: Canvas, marked: PanelMarks) -> None:
    """Place labels right of the axes at their level, moved up to avoid the label below."""
    per_point = sheet.dpi / 72
    lowest = -math.inf
    at = marked.ax.get_yaxis_transform()
    for text in sorted(marked.beside, key=lambda each: float(at.transform(each.xy)[1])):
        middle = float(at.transform(text.xy)[1])
        height = _extent(text).height
        bottom = max(middle - 0.5 * height, lowest)
        text.set_position((GAP + 1, (bottom + 0.5 * height - middle) / per_point))
        lowest = bottom + height + per_point


def _place_points(sheet: Canvas, marked: PanelMarks) -> bool:
    """Place labels of dots; return whether one moved to the margin for lack of room."""
    ax, outside = marked.ax, []
    for text in marked.inside:
        text.remove()
    marked.inside = []
    taken: list[Bbox] = []
    for point in marked.points:
        x, y, label, colour = point
        if not (label and _in_view(ax.get_xlim(), x) and _in_view(ax.get_ylim(), y)):
            continue
        box = _beside_dot(sheet, marked, (x, y), label, colour, taken)
        if box is None:
            _beside(marked, y, label, colour)
            outside.append(point)
        else:
            taken.append(box)
    marked.points = [point for point in marked.points if point not in outside]
    return bool(outside)


def _beside_dot(
    sheet: Canvas,
    marked: PanelMarks,
    dot: tuple[float, float],
    label: str,
    colour: str,
    taken: list[Bbox],
) -> Bbox | None:
    """Put the label of a dot into the nearest free place; return its box, or None without any.

    taken: boxes of placed labels and of lines to them; the box of a new line is added.
    """
    ax = marked.ax
    frame = ax.get_window_extent()
    text = _text(ax, label, dot, "data", (0, 0), "center", "center", colour)
    size = _extent(text)
    per_point = sheet.dpi / 72
    half_width, half_height = 0.5 * size.width / per_point, 0.5 * size.height / per_point
    for distance in DISTANCES:
        for direction in WAYS:
            east, north = math.cos(direction), math.sin(direction)
            offset = (
                east * distance + half_width * float(np.sign(round(east, 6))),
                north * distance + half_height * float(np.sign(round(north, 6))),
            )
            text.set_position(offset)
            box = _extent(text)
            within = frame.x0 <= box.x0 and box.x1 <= frame.x1
            within = within and frame.y0 <= box.y0 and box.y1 <= frame.y1
            if within and not covers_data(ax, box) and not any(box.overlaps(b) for b in taken):
                marked.inside.append(text)
                if distance >= LEADER:
                    end = (0.9 * east * distance, 0.9 * north * distance)
                    marked.inside.append(_lead(ax, dot, end, colour))
                    at = ax.transData.transform(dot)
                    taken.append(_between(at, at + per_point * np.array(end)))
                return box
    text.remove()
    return None


def _lead(ax: Axes, dot: tuple[float, float], end: tuple[float, float], colour: str) -> Annotation:
    """Draw a thin line from a dot to its label at `end` (points from the dot)."""
    return ax.annotate(
        "",
        dot,
        xytext=end,
        textcoords="offset points",
        arrowprops={"arrowstyle": "-", "color": colour, "linewidth": 0.6},
    )


def _between(one: Any, other: Any) -> Bbox:
    from matplotlib.transforms import Bbox

    return Bbox([np.minimum(one, other) - 1.0, np.maximum(one, other) + 1.0])


def covers_data(ax: Axes, box: Bbox) -> bool:
    """Whether a curve, or a bar of an interval, intersects `box` (pixels)."""
    for line in ax.lines:
        path = line.get_path().transformed(line.get_transform())
        if line.get_linestyle() != "None" and path.intersects_bbox(box, filled=False):
            return True
        spare = line.get_markersize()  # more than half a marker, at any resolution
        if line.get_marker() not in ("None", None, "") and _holds(box.padded(spare), path.vertices):
            return True
    return False


def _holds(box: Bbox, places: Any) -> bool:
    x, y = np.asarray(places, dtype=float).T
    return bool(np.any((box.x0 <= x) & (x <= box.x1) & (box.y0 <= y) & (y <= box.y1)))
