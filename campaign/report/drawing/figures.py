"""Drawing of `result.Figure`: panels on a sheet, and their sizes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from itertools import pairwise
from textwrap import fill
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from campaign.report.drawing.canvas import TITLE, WIDTH, canvas, place_axes, to_svg
from campaign.report.drawing.curves import (
    draw_bar,
    draw_bounds,
    draw_curve,
    draw_interval,
    draw_published,
    interval_of,
    leave_room,
    limit_intervals,
    prepared,
    scale_of,
    series_name,
    spare_rounding_errors,
)
from campaign.report.drawing.decimate import points_of_each
from campaign.report.drawing.legends import add_legend, published_signs
from campaign.report.drawing.mark_labels import PanelMarks, draw_marks, place_labels
from campaign.report.drawing.published_marks import Marks, PublishedMarks
from campaign.report.drawing.ticks import decade_letters, set_ticks, thin_out
from campaign.report.palette import MUTED, Look, looks
from campaign.result import Axis, Figure, Panel
from campaign.text import pretty_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

Array = NDArray[np.float64]

SINGLE = 88.0 / 25.4
"""Width of one column of a journal (inches)."""
TALLEST = 230.0 / 25.4
"""Height of a journal page without a caption (inches); rows of panels share it."""
LOWEST = 1.4
"""Minimum height of a row (inches); with too many rows, more panels are side by side."""
LETTER, BOLD_LETTER, NUMBER = 5.0, 6.3, 28.0
"""Maximum mean width of a letter and of a bold letter, and width of a number (points)."""
LINE, GAP = 14.0, 8.0
"""Height of a number, and gap between numbers (points)."""
SHORTEST, SMALL_TITLE = 12, 7.0
"""Minimum letters per line of a title; size of a title with a word that is too long (points)."""
NAME, AROUND = 0.134, 0.7
"""Height of a named place along y, and of the title and labels above and below (inches)."""
LOW = 2.0
"""Maximum height of a row whose panels have named places along x only (inches)."""
Column = Literal["single", "double"]
_column: ContextVar[Column] = ContextVar("_column", default="double")
BESIDE = 0.05
"""Margin of a panel of named places, as a share of its width: no sign is cut."""
ROOM = 0.14
"""Margin of a panel for the labels of its points, as a share of its height."""


def draw(
    figure: Figure,
    published: Marks | None = None,
    chosen: Mapping[str, Look] | None = None,
) -> str:
    """Draw a figure as a complete SVG document for white paper.

    published: published values beside its curves.
    chosen: looks of all series of the page; default: looks for this figure alone.
    """
    with _drawn(figure, published, chosen) as sheet:
        return to_svg(sheet)


def draw_sheet(
    figure: Figure,
    published: Marks | None = None,
    chosen: Mapping[str, Look] | None = None,
) -> Canvas:
    """Draw a figure as a matplotlib figure with final layout, independent of a later style."""
    with _drawn(figure, published, chosen) as sheet:
        place_axes(sheet)
        sheet.draw_without_rendering()  # creates the ticks in the present style
        return sheet


@contextmanager
def _drawn(
    figure: Figure, published: Marks | None, chosen: Mapping[str, Look] | None
) -> Iterator[Canvas]:
    """Sheet with the figure, in the report's style."""
    import matplotlib as mpl

    published, chosen = published or {}, chosen or looks(series_of(figure))
    with canvas(*_size(figure)) as sheet:
        across = _across(figure)
        down = -(-len(figure.panels) // across)
        axes = sheet.subplots(down, across, squeeze=False).ravel()
        points = points_of_each(figure)
        wide, high = _room(figure)
        letters, mpl.rcParams["axes.titlesize"] = _title_type(figure, wide)
        sets = []
        for place, (panel, ax) in enumerate(zip(figure.panels, axes, strict=False)):
            beside = {k: marks for (at, k), marks in published.items() if at == place}
            sets.append(_draw_panel(ax, panel, chosen, points, beside))
            title = f"({letter(place)}) {panel.title}" if len(figure.panels) > 1 else panel.title
            ax.set_title(fill(title.rstrip(), letters, break_long_words=False))
        for place, panel in enumerate(figure.panels):
            if place % across and panel.y.places and panel.y == figure.panels[place - 1].y:
                axes[place].tick_params(labelleft=False)  # the panel on its left has the names
        if figure.one_scale:
            _share_scales(sets)
        marked = [_finish(each, chosen, (wide, high)) for each in sets]
        for place, panel in enumerate(figure.panels[:-across]):
            if panel.x == figure.panels[place + across].x:
                axes[place].set_xlabel("")  # the panel below has it
        for ax in axes[len(figure.panels) :]:
            ax.set_axis_off()
        own = not _titles_say_it(figure)
        add_legend(sheet, list(axes) if own else [], published_signs(figure, published, chosen))
        place_labels(sheet, marked)
        yield sheet


def series_of(figure: Figure) -> list[str]:
    """Series of all curves and marks of a figure, in their order."""
    curves = [series_name(curve) for panel in figure.panels for curve in panel.curves]
    marks = [mark.series for panel in figure.panels for mark in panel.marks if mark.series]
    return [*curves, *marks]


def _titles_say_it(figure: Figure) -> bool:
    """Whether every panel's title already names all its curves."""
    return all(
        {curve.label for curve in panel.curves} <= {"", panel.title} for panel in figure.panels
    )


def letter(place: int) -> str:
    """Letter of a panel: a, b, ..."""
    return "abcdefghijklmnopqrstuvwxyz"[place % 26]


@contextmanager
def in_column(column: Column) -> Iterator[None]:
    """Draw figures within the block in the width of a journal's column."""
    before = _column.set(column)
    try:
        yield
    finally:
        _column.reset(before)


def _across(figure: Figure) -> int:
    count, usual, most = len(figure.panels), 3, 3
    if _column.get() == "single":
        usual, most = 1, 3 if any(panel.y.places for panel in figure.panels) else 2
    across = max(1, min(figure.across, count, usual))
    while across < most and -(-count // across) * _lowest(figure) > TALLEST:
        across += 1
    return across


def _lowest(figure: Figure) -> float:
    """Minimum height of a row of panels, with its named places (inches)."""
    names = max((len(panel.y.places) for panel in figure.panels), default=0)
    return max(LOWEST, NAME * names + AROUND if names else 0.0)


def _size(figure: Figure) -> tuple[float, float]:
    across = _across(figure)
    down = -(-len(figure.panels) // across) if figure.panels else 1
    width, each = WIDTH, {1: 3.3 if down == 1 else 2.4, 2: 2.7, 3: 2.2}[across]
    if _column.get() == "single":
        width, each = SINGLE, 2.9 if down == 1 else 1.9
    if figure.panels and all(p.x.places and not p.y.places for p in figure.panels):
        each = min(each, LOW)
    wide = 72.0 * width / across - 50.0
    each += LETTER / 72 * max((_longest(p) for p in figure.panels if _turned(p, wide)), default=0)
    each = max(min(each, (TALLEST - 0.35) / max(down, 1)), _lowest(figure))
    return width, 0.35 + each * max(down, 1)


def _turned(panel: Panel, wide: float) -> bool:
    """Whether names along x are vertical for lack of room."""
    long = [max(map(len, name.split("\n"))) + 1 for _, name in panel.x.places]
    return LETTER * max(map(sum, pairwise(long)), default=0) / 2 > wide / max(len(long), 1)


def _title_type(figure: Figure, wide: float) -> tuple[int, float]:
    """Letters per line of the panels' titles, and their size (points)."""
    words = " ".join(panel.title for panel in figure.panels).replace("-", "- ").split()
    word = max(map(len, words), default=0)
    if word * BOLD_LETTER <= wide:
        return max(SHORTEST, int(wide / BOLD_LETTER)), TITLE
    return max(word, int(wide * TITLE / SMALL_TITLE / BOLD_LETTER)), SMALL_TITLE


def _longest(panel: Panel) -> int:
    return max(len(name) for _, name in panel.x.places)


def _room(figure: Figure) -> tuple[float, float]:
    """Width and height of a panel without the labels of its axes (points)."""
    (width, height), across = _size(figure), _across(figure)
    down = -(-len(figure.panels) // across)
    return 72.0 * width / across - 50.0, 72.0 * (height - 0.35) / max(down, 1) - 45.0


@dataclass(frozen=True)
class _Drawn:
    """A panel with its curves, before its ticks and labels.

    Attributes:
        x, y: all values along each axis, in display units; x without the offset `aside`.
    """

    ax: Axes
    panel: Panel
    x: Sequence[Array]
    y: Sequence[Array]


def _draw_panel(
    ax: Axes,
    panel: Panel,
    chosen: Mapping[str, Look],
    points: int,
    published: Mapping[int, Sequence[PublishedMarks]],
) -> _Drawn:
    shown = [prepared(curve, panel) for curve in panel.curves]
    intervals = [
        interval_of(curve, panel, y) for curve, (_, y, _) in zip(panel.curves, shown, strict=True)
    ]
    beside: list[Array] = []
    bounds: list[Array] = []
    for number, curve in enumerate(panel.curves):
        look, (x, y, y_low), ends = chosen[series_name(curve)], shown[number], intervals[number]
        x = x + curve.aside * scale_of(panel.x)
        if ends is not None:
            draw_interval(ax, curve, ends, look, x, y, points)
        if panel.x.places and panel.y.scale == "linear" and (panel.y.limits or (None,))[0] == 0.0:
            draw_bar(ax, look, x, y)
        draw_curve(ax, curve, look, x, y, y_low, points)
        bounds.append(draw_bounds(ax, curve, look, x, y))
        marks = published.get(number, ())
        values = draw_published(ax, marks, look, panel, curve.aside)
        beside += values
        pairs = zip(marks, values, strict=True)
        bounds += [own for each, own in pairs if each.bound == "at least"]
    for set_scale, axis in ((ax.set_xscale, panel.x), (ax.set_yscale, panel.y)):
        if axis.scale == "log" and any(np.isfinite(y).any() for _, y, _ in shown):
            set_scale("log")
    ends_shown = [ends for ends in intervals if ends is not None]
    drawn = [*(y for _, y, _ in shown), *beside]
    limit_intervals(ax, np.concatenate([np.empty(0), *drawn]), ends_shown)
    if panel.y.scale == "linear":
        spare_rounding_errors(ax, [*drawn, *(end for ends in ends_shown for end in ends)])
    _limit_axes(ax, panel)
    if panel.x.places and panel.x.limits is None:
        ax.margins(x=BESIDE)
    if any(mark.point for mark in panel.marks) and panel.y.limits is None:
        ax.margins(y=ROOM)
    leave_room(ax, np.concatenate([np.empty(0), *bounds]))
    return _Drawn(ax, panel, [x for x, _, _ in shown], drawn)


def _share_scales(sets: Sequence[_Drawn]) -> None:
    """Give panels with the same kind of y axis common limits."""
    alike: dict[tuple[str, ...], list[Axes]] = {}
    for each in sets:
        y = each.panel.y
        alike.setdefault((y.label, y.unit, y.display, y.scale), []).append(each.ax)
    for axes in alike.values():
        ends = [ax.get_ylim() for ax in axes]
        for ax in axes:
            ax.set_ylim(min(low for low, _ in ends), max(high for _, high in ends))


def _finish(drawn: _Drawn, chosen: Mapping[str, Look], room: tuple[float, float]) -> PanelMarks:
    """Draw ticks, marks, and the note of an empty panel, after its limits are known."""
    ax, panel = drawn.ax, drawn.panel
    _label_axes(ax, panel, room)
    marked = PanelMarks(ax, panel, chosen)
    draw_marks(marked)  # marks may widen the limits
    number = max(NUMBER, LETTER * decade_letters(ax.get_xlim()) + GAP)
    set_ticks(ax.xaxis, panel.x, drawn.x, int(room[0] / number))
    set_ticks(ax.yaxis, panel.y, drawn.y, int(room[1] / LINE))
    thin_out(ax.xaxis, lambda letters: int(room[0] / (LETTER * letters + GAP)))
    if _turned(panel, room[0]):
        names = [name.replace("-\n", "-").replace("\n", " ") for _, name in panel.x.places]
        ax.set_xticklabels(names, rotation=90)
    if not any(np.isfinite(y).any() for y in drawn.y[: len(panel.curves)]):
        ax.text(0.5, 0.5, "no data", transform=ax.transAxes, ha="center", color=MUTED.light)
    return marked


def _label_axes(ax: Axes, panel: Panel, room: tuple[float, float]) -> None:
    """Label the axes, with line breaks at the length of the axes."""
    for name, axis, long in ((ax.set_xlabel, panel.x, room[0]), (ax.set_ylabel, panel.y, room[1])):
        name(fill(axis_label(axis), max(12, int(long / LETTER)), break_long_words=False))


def _limit_axes(ax: Axes, panel: Panel) -> None:
    for set_limits, axis in ((ax.set_xlim, panel.x), (ax.set_ylim, panel.y)):
        scale = scale_of(axis)
        if axis.limits is not None:
            ends = (end * scale if np.isfinite(end) else None for end in axis.limits)
            set_limits(*ends)


def axis_label(axis: Axis) -> str:
    """`label (unit)` in the display unit; an axis of named places has no unit."""
    unit = "" if axis.places else axis.shown_unit
    if unit and axis.label.endswith(")"):
        return f"{axis.label[:-1]}, {pretty_unit(unit)})"
    return f"{axis.label} ({pretty_unit(unit)})" if unit else axis.label
