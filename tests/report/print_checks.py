"""What a figure for print must fulfil, of any figure: `problems` lists what it does not."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence, Set
from itertools import combinations, pairwise
from typing import Any

import numpy as np
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from campaign.report.drawing.figures import TALLEST, Column, draw_sheet, in_column, series_of
from campaign.report.drawing.mark_labels import covers_data
from campaign.report.drawing.published_marks import Marks
from campaign.report.palette import Look, looks
from campaign.result import Curve, Figure, Finding, Panel

WIDTHS = {"single": 88.0, "double": 180.0}
"""mm."""
TOUCH = 1.0
"""Points by which boxes of texts may overlap: their letters do not fill them."""
BETWEEN = 1.0
"""Points between a number at an axis and the next."""
SEEN = 0.05
"""Share of the height of a panel that what it shows spans at least."""
LIGHTER = 15.0
"""Difference of CIE lightness (of 100) by which two looks differ in greyscale."""
APART = 12.0
"""CIELAB difference by which two colours differ: several times what is just noticed (2.3)."""

# Machado, Oliveira and Fernandes (2009), A physiologically-based model for simulation of color
# vision deficiency, IEEE Trans. Vis. Comput. Graph. 15, Table 1: severity 1, on linear RGB.
DEFICIENCIES = {
    "normal": np.eye(3),
    "protanopia": np.array(
        [[0.152, 1.053, -0.205], [0.115, 0.786, 0.099], [-0.004, -0.048, 1.052]]
    ),
    "deuteranopia": np.array(
        [[0.367, 0.861, -0.228], [0.280, 0.673, 0.047], [-0.012, 0.043, 0.969]]
    ),
    "tritanopia": np.array(
        [[1.256, -0.077, -0.179], [-0.078, 0.931, 0.148], [0.005, 0.691, 0.304]]
    ),
}


def linear(colour: str) -> np.ndarray:
    """Linear red, green and blue of `#rrggbb`, 0 to 1."""
    rgb = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    return np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)


def contrast(first: str, second: str) -> float:
    """WCAG 2.1 contrast ratio of two `#rrggbb` colours, 1 to 21."""
    low, high = sorted(linear(colour) @ [0.2126, 0.7152, 0.0722] for colour in (first, second))
    return float((high + 0.05) / (low + 0.05))


def lab(colour: str, matrix: Any) -> np.ndarray:
    """CIELAB (D65) of `#rrggbb` as an eye with the deficiency `matrix` sees it."""
    seen = np.clip(np.array(matrix) @ linear(colour), 0, 1)
    xyz = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]] @ seen
    x, y, z = np.cbrt(xyz / [0.9505, 1.0, 1.089])
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def told_apart(one: Curve, other: Curve, chosen: Mapping[str, Look]) -> bool:
    """Whether two curves of a panel are, in grey and by every eye: by form, else by colour."""
    a, b = (chosen[each.series or each.label] for each in (one, other))
    forms = [_form(curve, look) for curve, look in ((one, a), (other, b))]
    if forms[0] != forms[1]:
        return True
    eyes = [(lab(a.light, m), lab(b.light, m)) for m in DEFICIENCIES.values()]
    grey = abs(eyes[0][0][0] - eyes[0][1][0])
    return bool(grey >= LIGHTER and min(np.linalg.norm(p - q) for p, q in eyes) >= APART)


def _form(curve: Curve, look: Look) -> tuple[object, ...]:
    if curve.style in ("points", "band"):
        return curve.style, look.marker if curve.style == "points" else ""
    return "line", look.dash, curve.style, look.marker if curve.style == "line+points" else ""


def problems(
    figure: Figure,
    column: Column,
    marks: Marks | None = None,
    chosen: Mapping[str, Look] | None = None,
    findings: Sequence[Finding] = (),
) -> list[str]:
    """What is wrong with a figure in a column of a journal."""
    chosen = chosen or looks(series_of(figure))
    of_name = {c.series for panel in figure.panels for c in panel.curves if c.label}
    with in_column(column):
        sheet = draw_sheet(figure, marks, chosen)
        return [
            *_sizes(sheet, column),
            *_overlaps(sheet),
            *(f"{_name(k)}: {said}" for k, panel in enumerate(figure.panels)
              for said in _of_panel(panel, sheet.axes[k], sheet, chosen, of_name)),
            *_repeats(figure),
            *_without_interval(figure, findings),
        ]  # fmt: skip


def _name(place: int) -> str:
    return f"({'abcdefghijklmnopqrstuvwxyz'[place % 26]})"


def texts(sheet: Any) -> Iterator[tuple[str, Text, Bbox]]:
    """Every text that is seen, and where (points)."""
    for text in sheet.findobj(Text):
        if text.get_visible() and text.get_text().strip():
            yield text.get_text(), text, text.get_window_extent()


def _seen(sheet: Any) -> list[tuple[str, Text, Bbox]]:
    hidden = set()
    for ax in sheet.axes:
        for axis, ends in ((ax.xaxis, ax.get_xlim()), (ax.yaxis, ax.get_ylim())):
            shown = axis.get_visible() and ax.axison
            for tick in (*axis.majorTicks, *axis.minorTicks):
                span = 1e-9 * abs(ends[1] - ends[0])
                within = min(ends) - span <= tick.get_loc() <= max(ends) + span
                hidden |= {tick.label2} | (set() if shown and within else {tick.label1})
            if not shown:
                hidden |= {axis.label, axis.get_offset_text()}
    return [each for each in texts(sheet) if each[1] not in hidden]


def _sizes(sheet: Any, column: Column) -> Iterator[str]:
    width, height = 25.4 * sheet.get_size_inches()
    if abs(width - WIDTHS[column]) > 0.1:
        yield f"{width:.1f} mm wide"
    if height > 25.4 * TALLEST + 0.1:
        yield f"{height:.0f} mm high"
    for said, text, _ in _seen(sheet):
        if not 7.0 <= text.get_fontsize() <= 9.0:
            yield f"{said!r} has {text.get_fontsize()} pt"


def _overlaps(sheet: Any) -> Iterator[str]:
    width, height = 72.0 * sheet.get_size_inches()
    seen = _seen(sheet)
    for said, _, box in seen:
        if box.x0 < -TOUCH or box.y0 < -TOUCH or box.x1 > width + TOUCH or box.y1 > height + TOUCH:
            yield f"{said!r} leaves the sheet"
    for (one, _, a), (other, _, b) in combinations(seen, 2):
        if a.padded(-TOUCH).overlaps(b.padded(-TOUCH)):
            yield f"{one!r} overlaps {other!r}"
    for ax in sheet.axes:
        frame = ax.get_window_extent().padded(-TOUCH)
        inside = [text for text in ax.texts if text.get_text()]
        for said, text, box in seen if ax.axison else ():
            if text not in inside and frame.overlaps(box.padded(-TOUCH)):
                yield f"{said!r} lies on a panel"
            elif text in inside and frame.overlaps(box) and covers_data(ax, box.padded(-TOUCH)):
                yield f"{said!r} lies on a curve"


def _run_together(ax: Any) -> Iterator[str]:
    """Numbers along x that are no letter's width apart."""
    low, high = sorted(ax.get_xlim())
    shown = [
        t.label1
        for t in ax.xaxis.get_major_ticks()
        if low <= t.get_loc() <= high and t.label1.get_text()
    ]
    boxes = sorted(
        ((each.get_window_extent(), each) for each in shown if not each.get_rotation()),
        key=lambda pair: pair[0].x0,
    )
    for (one, text), (other, following) in pairwise(boxes):
        if other.x0 - one.x1 < BETWEEN:
            yield f"{text.get_text()!r} runs into {following.get_text()!r}"


def _of_panel(
    panel: Panel, ax: Any, sheet: Any, chosen: Mapping[str, Look], named_series: Set[str]
) -> Iterator[str]:
    if any(text.get_text() == "no data" for text in ax.texts):
        yield "empty"
        return
    named = {text.get_text() for legend in sheet.legends for text in legend.get_texts()}
    labels = [curve.label for curve in panel.curves]
    for label in labels:
        if label and label not in named and label != panel.title:
            yield f"{label!r} is in no legend"
    bare = {curve.series for curve in panel.curves if not curve.label} - named_series
    if not panel.x.places and len(bare) > 1:
        yield f"{len(bare)} series without a name"
    for mark in panel.marks:
        of = {each.label for each in panel.marks if each.series == mark.series}
        on_a_curve = mark.point and mark.series in named_series
        if not any(of) and not on_a_curve and (mark.x, mark.y) not in ((0.0, None), (None, 0.0)):
            yield "a mark without a name"
    for one, other in combinations(panel.curves, 2):
        same = (one.label, one.series) == (other.label, other.series)
        attached = "" in (one.label, other.label) and one.series == other.series
        if not (same or attached or panel.x.places or told_apart(one, other, chosen)):
            yield f"{one.label!r} and {other.label!r} look alike"
    yield from _scale(ax)
    yield from _run_together(ax)


def _scale(ax: Any) -> Iterator[str]:
    low, high = sorted(ax.get_ylim())
    left, right = sorted(ax.get_xlim())
    spans = []
    for line in ax.lines:
        if line.get_transform() != ax.transData:  # a mark across the panel
            continue
        x, y = (np.asarray(each, dtype=float) for each in line.get_data())
        y = y[np.isfinite(y) & (left <= x) & (x <= right)]
        y = y[(low <= y) & (y <= high)]
        if y.size:
            spans.append((y.min(), y.max()))
    boxes = [ax.dataLim] if ax.collections or ax.patches else []
    if not spans and not boxes:
        yield "nothing of it is in view"
    elif spans and not boxes:
        ends = np.array([min(a for a, _ in spans), max(b for _, b in spans)])
        at = ax.transData.transform(np.column_stack([[left, right], ends]))[:, 1]
        share = np.ptp(at) / ax.get_window_extent().height
        constant = np.ptp(ends) <= 1e-3 * np.abs(ends).max()
        if share < SEEN and not constant and len(spans[0]) > 1 and ends[0] != ends[1]:
            yield f"what it shows spans {100 * share:.1f} % of its height"


def _repeats(figure: Figure) -> Iterator[str]:
    def shown(panel: Panel) -> tuple[object, ...]:
        curves = frozenset((c.x.tobytes(), c.y.tobytes()) for c in panel.curves)
        limits = panel.x.limits, panel.y.limits, panel.x.scale, panel.y.scale
        return curves, panel.title, *limits  # another title is another condition

    for (one, a), (other, b) in combinations(enumerate(figure.panels), 2):
        if a.curves and shown(a) == shown(b):
            yield f"{_name(other)} repeats {_name(one)}"


def _without_interval(figure: Figure, findings: Sequence[Finding]) -> Iterator[str]:
    """Points of a quantity whose finding has an interval, which the figure does not show."""
    for curve in (curve for panel in figure.panels for curve in panel.curves if curve.quantity):
        known = [f.value for f in findings if f.quantity == curve.quantity and f.known.has_interval]
        for k, value in enumerate(curve.y):
            bare = curve.low is None or not np.isfinite(curve.low[k])
            if bare and np.isclose(value, known, rtol=1e-9).any():
                yield f"{curve.quantity} {value:.4g} has its interval in the table alone"
                break
