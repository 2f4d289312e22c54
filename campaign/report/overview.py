"""The scoreboard as a picture: how far each published cell is from what the run found."""

from __future__ import annotations

from itertools import groupby
from typing import TYPE_CHECKING, Any

from campaign.published.scoreboard import Line, Scoreboard
from campaign.published.status import Status
from campaign.published.values import Cell
from campaign.report.figures import WIDTH, canvas, to_svg
from campaign.report.palette import HAIRLINE, INK, MUTED, STATUS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NAMED_CELLS = 48
"""Up to here every cell has a name beside it; beyond, only the tables have."""
LINEAR = 1.0
"""Percent up to which the deviation axis is linear; beyond, it is logarithmic."""


def draw_overview(scoreboard: Scoreboard) -> str | None:
    """The picture as an SVG document; None when no cell was compared."""
    lines = [line for line in scoreboard.lines if line.deviation is not None]
    if not lines:
        return None
    named = len(lines) <= NAMED_CELLS
    pitch = 0.17 if named else max(0.035, 0.09 - 0.0002 * len(lines))
    tables = [(name, list(group)) for name, group in groupby(lines, lambda a: a.cell.table)]
    gap = 0.24 / pitch
    places, y = [], 0.0
    for name, group in tables:
        rows = [y + i for i in range(len(group))]
        places.append((name, group, rows))
        y = rows[-1] + 1 + gap
    height = y * pitch + 0.95
    with canvas(WIDTH, height) as sheet:
        ax = sheet.subplots()
        for name, group, rows in places:
            _draw_table(ax, name, group, rows, named, gap)
        ax.set_ylim(y - gap, -gap)
        _draw_axis(ax, lines)
        _draw_legend(ax, lines)
        return to_svg(sheet)


def cell_name(cell: Cell) -> str:
    """A cell within its table in words, as short as it can be said."""
    row, column = cell.row, cell.column
    if cell.symbol and cell.quantity in (row, column):
        row = cell.symbol if row == cell.quantity else row
        column = cell.symbol if column == cell.quantity else column
    elif cell.symbol:
        row = f"{row} {cell.symbol}"
    # A column that only repeats what the whole table is about says nothing.
    told = [row] if column in (cell.quantity, "value") else [row, column]
    return " · ".join(part.replace("_", " ") for part in told)


def _draw_table(
    ax: Axes, name: str, group: list[Line], rows: list[float], named: bool, gap: float
) -> None:
    heading = name if " " in name else f"Table {name}"
    text: dict[str, Any] = {"transform": ax.get_yaxis_transform(), "ha": "right", "va": "center"}
    above = rows[0] - 0.62 * gap if named else sum(rows) / len(rows)
    ax.text(-0.015, above, heading.capitalize(), weight="bold", fontsize=8, **text)
    ax.axhline(rows[0] - gap, color=HAIRLINE.light, linewidth=0.6, zorder=0)
    for line, y in zip(group, rows, strict=True):
        look = STATUS[line.status or Status.SIMULATED]
        deviation = line.deviation or 0.0
        ax.plot([0, deviation], [y, y], color=look.light, linewidth=1.0, alpha=0.55)
        ax.plot(
            [deviation],
            [y],
            marker=look.marker,
            color=look.light,
            markersize=5 if named else 3.2,
            markeredgewidth=1.2 if look.marker == "x" else 0,
            linestyle="none",
        )
        if named:
            ax.text(-0.015, y, cell_name(line.cell), fontsize=7.5, color=MUTED.light, **text)


def _draw_axis(ax: Axes, lines: list[Line]) -> None:
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    largest = max(abs(line.deviation or 0.0) for line in lines)
    powers = [10.0**n for n in range(9) if 10.0**n <= 3 * max(largest, 10.0)]
    ax.set_xscale("symlog", linthresh=LINEAR, linscale=0.6)
    limit = max(1.3 * largest, 15.0)
    ax.set_xlim(-limit, limit)
    ticks = [t for t in [*(-p for p in reversed(powers)), 0.0, *powers] if abs(t) <= limit]
    ax.xaxis.set_major_locator(FixedLocator(ticks))
    ax.xaxis.set_minor_locator(NullLocator())
    ax.xaxis.set_major_formatter(
        FuncFormatter(lambda t, _: f"{t:+g} %".replace("-", "−") if t else "0")
    )
    ax.set_xlabel("Deviation of the reproduced from the published value")
    ax.yaxis.set_visible(False)
    ax.spines["left"].set_visible(False)
    ax.axvline(0, color=INK.light, linewidth=0.9, zorder=1)
    ax.grid(axis="y", visible=False)


def _draw_legend(ax: Axes, lines: list[Line]) -> None:
    from matplotlib.lines import Line2D

    present = [status for status in STATUS if any(line.status is status for line in lines)]
    handles = [
        Line2D(
            [],
            [],
            linestyle="none",
            marker=STATUS[status].marker,
            color=STATUS[status].light,
            markersize=5,
            label=str(status),
        )
        for status in present
    ]
    sheet = ax.get_figure()
    if sheet is not None:
        sheet.legend(handles=handles, loc="outside upper left", ncols=4, borderpad=0)
