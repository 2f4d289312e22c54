"""The scoreboard as a figure: deviation of each published cell.

With few cells, each has a row. Many cells share one row per table, with the name of the cell of the
largest deviation. The picture always fits a screen. Each sign has a tooltip with its cell, and the
class of its status, so that a page can hide some.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import escape

from campaign.published.scoreboard import Line, Scoreboard
from campaign.published.status import Status
from campaign.report.content.lines import cell_name, shown_line
from campaign.report.drawing.canvas import WIDTH, canvas, to_svg
from campaign.report.drawing.rows import LEFT, RIGHT, set_rows, signed_decades, word, zero_line
from campaign.report.palette import HAIRLINE, INK, MUTED, STATUS, Look
from campaign.text import capitalized, percent

if TYPE_CHECKING:
    from matplotlib.axes import Axes

HIGHEST = 8.0
"""Maximum height (inches) at 6.9 inches of width: 890 pixels on a page of 768 pixels of width."""
PITCH = (0.125, 0.17)
"""Minimum (for legible words) and maximum pitch of rows of cells (inches)."""
HEADING = 0.24
"""Height of the name of a table above its cells (inches)."""
TABLE_PITCH = (0.13, 0.42)
"""Minimum (for legible words) and maximum pitch of rows of tables (inches)."""
AROUND = 0.6
"""Height of the axis ..."""
LEGEND = 0.19
"""... and of each row of the legend (inches)."""
LINEAR = 1.0
"""Limit (percent) of the linear part of the deviation axis, which is logarithmic beyond."""
SMALL = 6.3
"""Size of the smallest words (points): 9.7 pixels on a page of 768 pixels of width."""
WORD = 0.06
"""Distance from the axes to the middle of a word above them (inches)."""
SHORT = 30
"""Maximum number of characters of the name of the farthest cell."""
SIGN = 4.2
"""Size of a sign in a row of a table (points)."""
ACROSS = 4
"""Number of statuses side by side in the legend."""


@dataclass(frozen=True)
class Row:
    """One row of the picture: a table, or all tables without a row of their own."""

    name: str
    lines: tuple[Line, ...]

    @property
    def farthest(self) -> Line:
        return max(self.lines, key=lambda line: abs(line.deviation or 0.0))


def draw_overview(scoreboard: Scoreboard) -> str | None:
    """Draw the picture as an SVG document; None if no cell has a deviation."""
    lines = [line for line in scoreboard.lines if line.deviation is not None]
    if not lines:
        return None
    rows = [_row(name, tuple(group)) for name, group in groupby(lines, lambda a: a.cell.table)]
    around = AROUND + LEGEND * -(-len({line.status for line in lines}) // ACROSS)
    room = HIGHEST - around
    pitch = min(PITCH[1], (room - HEADING * len(rows)) / len(lines))
    by_cell = pitch >= PITCH[0]
    if by_cell:
        needed = pitch * len(lines) + HEADING * len(rows)
    else:
        rows = _few(rows, int(room / TABLE_PITCH[0]))
        needed = min(room, TABLE_PITCH[1] * len(rows))
    with canvas(WIDTH, around + needed) as sheet:
        ax = sheet.subplots()
        _draw_axis(ax, lines)
        if by_cell:
            _draw_cells(ax, rows, pitch)
        else:
            _draw_tables(ax, rows, needed / len(rows))
        _draw_legend(ax, lines)
        return _with_tooltips(to_svg(sheet), lines)


def _row(name: str, lines: tuple[Line, ...]) -> Row:
    heading = name if " " in name else f"Table {name}"
    return Row(capitalized(heading), lines)


def _few(rows: list[Row], most: int) -> list[Row]:
    """Limit the rows to `most`; the last one then contains all further tables."""
    if len(rows) <= most:
        return rows
    rest = rows[most - 1 :]
    lines = tuple(line for row in rest for line in row.lines)
    return [*rows[: most - 1], Row(f"{len(rest)} further tables", lines)]


def _draw_cells(ax: Axes, rows: Sequence[Row], pitch: float) -> None:
    """Draw a row for each cell below the name of its table; `pitch` in inches."""
    gap = HEADING / pitch
    size = min(7.5, 54.0 * pitch)
    y = 0.0
    for row in rows:
        word(ax, LEFT, y + 0.4 * gap, row.name, INK, 8.0, weight="bold")
        ax.axhline(y, color=HAIRLINE.light, linewidth=0.6, zorder=0)
        y += gap
        for line in row.lines:
            look = _look(line)
            ends = [0.0, line.deviation or 0.0]
            ax.plot(
                ends, [y + 0.3] * 2, color=look.light, linewidth=1.0, alpha=0.55, gid=_gid(line)
            )
            _sign(ax, line, y + 0.3, 5.0)
            word(ax, LEFT, y + 0.3, cell_name(line.cell), MUTED, size)
            y += 1.0
    set_rows(ax, (y, 0.0))


def _draw_tables(ax: Axes, rows: Sequence[Row], pitch: float) -> None:
    """Draw a row for each table with the name of its farthest cell; `pitch` in inches."""
    set_rows(ax, (len(rows) - 0.5, -0.5))
    word(ax, LEFT, -0.5 - WORD / pitch, "table (cells)", MUTED, SMALL)
    word(ax, RIGHT, -0.5 - WORD / pitch, "its farthest cell", MUTED, SMALL)
    # Signs that would overlap use different lanes, within the height of the row.
    lanes = max(1, int(72.0 * pitch / (SIGN + 0.8)))
    for y, row in enumerate(rows):
        ax.axhline(y + 0.5, color=HAIRLINE.light, linewidth=0.6, zorder=0)
        for line, lane in zip(row.lines, _lanes(ax, row.lines, lanes), strict=True):
            _sign(ax, line, y + 0.86 * lane / lanes, SIGN)
        count = len(row.lines)
        name = f"{row.name} ({count})" if count > 1 else row.name
        word(ax, LEFT, y, name, INK, SMALL)
        word(ax, RIGHT, y, _told(row.farthest), _look(row.farthest), SMALL)


def _lanes(ax: Axes, lines: Sequence[Line], lanes: int) -> list[int]:
    """Lane of each sign, counted from the middle one: the nearest free lane.

    If no lane is free, the lane whose last sign is farthest away.
    """
    places = ax.transData.transform([(line.deviation or 0.0, 0.0) for line in lines])[:, 0]
    width = (SIGN + 0.4) * ax.get_figure(root=True).dpi / 72.0  # type: ignore[union-attr]
    order = sorted((k // 2 + k % 2) * (-1) ** k for k in range(lanes))
    order.sort(key=abs)
    last = dict.fromkeys(order, -np.inf)
    chosen = [0] * len(lines)
    for k in np.argsort(places, kind="stable"):
        free = [lane for lane in order if places[k] - last[lane] >= width]
        chosen[k] = free[0] if free else min(order, key=lambda lane: last[lane])
        last[chosen[k]] = float(places[k])
    return chosen


def _told(line: Line) -> str:
    """Deviation and short name of a cell."""
    name = cell_name(line.cell)
    if len(name) > SHORT:
        name = name[: SHORT - 1].rstrip(" ·") + "…"
    return f"{percent(line.deviation)}  {name}"


def _sign(ax: Axes, line: Line, y: float, size: float) -> None:
    look = _look(line)
    ax.plot(
        [line.deviation or 0.0],
        [y],
        marker=look.marker,
        color=look.light,
        markersize=1.3 * size if look.marker == "*" else size,
        markeredgewidth=1.1 if look.marker == "x" else 0,
        linestyle="none",
        clip_on=False,
        gid=_gid(line),
    )


def _look(line: Line) -> Look:
    return STATUS[line.status or Status.SIMULATED]


def _gid(line: Line) -> str:
    return f"cell:{line.cell.path}"


def _with_tooltips(svg: str, lines: Sequence[Line]) -> str:
    """Add the class of its status and a tooltip to the group of each cell."""
    by_gid = {str(escape(_gid(line))): line for line in lines}

    def told(found: re.Match[str]) -> str:
        line = by_gid[found[1]]
        return f'<g class="{_look(line).name}"><title>{escape(_tooltip(line))}</title>'

    return re.sub(r'<g id="(cell:[^"]*)">', told, svg)


def _tooltip(line: Line) -> str:
    shown = shown_line(line)
    unit = f" {shown.unit}" if shown.unit else ""
    return (
        f"{shown.table} · {shown.name}: published {shown.published}{unit}, "
        f"reproduced {shown.reproduced}{unit} ({shown.deviation}), {shown.verdict}, {shown.status}"
    )


def _draw_axis(ax: Axes, lines: Sequence[Line]) -> None:
    largest = max(abs(line.deviation or 0.0) for line in lines)
    limit = max(1.3 * largest, 15.0)
    signed_decades(ax, limit, LINEAR, 0.6, lambda tick: f"{tick:+g} %" if tick else "0")
    ax.set_xlim(-limit, limit)
    ax.set_xlabel("Deviation of the reproduced from the published value")
    zero_line(ax)


def _draw_legend(ax: Axes, lines: Sequence[Line]) -> None:
    from matplotlib.lines import Line2D

    sheet = ax.get_figure()
    if sheet is not None:
        handles = [
            Line2D([], [], linestyle="none", marker=look.marker, color=look.light, markersize=5)
            for look in _present(lines).values()
        ]
        names = [str(status) for status in _present(lines)]
        sheet.legend(handles, names, loc="outside upper left", ncols=ACROSS, borderpad=0)


def _present(lines: Sequence[Line]) -> dict[Status, Look]:
    statuses = {line.status for line in lines}
    return {status: look for status, look in STATUS.items() if status in statuses}
