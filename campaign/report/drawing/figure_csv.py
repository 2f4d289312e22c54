"""Numbers of a figure as CSV, in the units of its axes."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator
from itertools import repeat

import numpy as np
from numpy.typing import NDArray

from campaign.report.drawing.decimate import decimate, points_of_each
from campaign.result import Axis, Curve, Figure, Panel
from campaign.units import convert

COLUMNS = ("panel", "curve", "x", "y", "low", "high", "x_unit", "y_unit")
DIGITS = 9
"""Digits of a number: more than a drawing shows, in less than half the bytes of all digits."""

Array = NDArray[np.float64]


def figure_csv(figure: Figure) -> str:
    """CSV text with a row for each point of each curve: `COLUMNS`.

    `panel` and `curve` are titles, or numbers if these are not unique. `low` and `high` are the
    interval of `y`, or the edges of a band, which has no `y`. A line is decimated as in its
    drawing, to a subset of its points with all extremes.
    """
    text = io.StringIO()
    text.write(f"{','.join(COLUMNS)}\n")
    points = points_of_each(figure)
    titles = _names([panel.title for panel in figure.panels])
    for panel, title in zip(figure.panels, titles, strict=True):
        units = panel.x.shown_unit, panel.y.shown_unit
        names = _names([curve.label or curve.series for curve in panel.curves])
        for curve, name in zip(panel.curves, names, strict=True):
            before, behind = _quoted(title, name), _quoted(*units)
            text.writelines(f"{before},{row},{behind}\n" for row in _rows(curve, panel, points))
    return text.getvalue()


def _quoted(*cells: str) -> str:
    """Cells of a row, quoted if necessary."""
    text = io.StringIO()
    csv.writer(text, lineterminator="").writerow(cells)
    return text.getvalue()


def _rows(curve: Curve, panel: Panel, points: int) -> Iterator[str]:
    """`x,y,low,high` of each written point."""
    x, y = _displayed(curve.x, panel.x), _displayed(curve.y, panel.y)
    count = min(len(x), len(y))
    x, y, low, high = x[:count], y[:count], curve.low, curve.high
    if curve.style == "band":
        edge = np.zeros(count) if curve.y_low is None else curve.y_low
        low, high, y = edge, curve.y, np.full(count, np.nan)
    if low is not None and high is not None:
        ends = [_displayed(end, panel.y) for end in (low, high)]
        columns = [_texts(each) for each in (x, y, *ends)]
    else:
        thinned = "points" not in curve.style
        x, y = decimate(x, y, points) if thinned else (x, y)
        columns = [_texts(x), _texts(y), repeat(""), repeat("")]
    return map(",".join, zip(*columns, strict=False))


def _names(titles: list[str]) -> list[str]:
    """Each title, with its number if it is empty or not unique."""
    return [
        title if title and titles.count(title) == 1 else f"{title} {place}".strip()
        for place, title in enumerate(titles, start=1)
    ]


def _displayed(values: Array, axis: Axis) -> Array:
    shown = np.asarray(values, dtype=float).ravel()
    return np.asarray(convert(shown, axis.unit, axis.shown_unit), dtype=float)


def _texts(values: Array) -> Iterable[str]:
    """Each number in `DIGITS`; empty for one that is not finite."""
    texts = map(f"%.{DIGITS}g".__mod__, values.tolist())
    if np.isfinite(values).all():
        return texts
    return (text if text[-1].isdigit() else "" for text in texts)
