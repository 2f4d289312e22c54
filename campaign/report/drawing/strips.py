"""Draws of a random bench: one strip per published value."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from campaign.published.scoreboard import Line, Scoreboard
from campaign.published.status import Status
from campaign.report.content.lines import cell_name
from campaign.report.drawing.canvas import WIDTH, canvas, to_svg
from campaign.report.drawing.rows import LEFT, RIGHT, set_rows, word, zero_line
from campaign.report.palette import INK, MUTED, STATUS
from campaign.text import number

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PITCH = 0.24
"""Pitch of the strips (inches)."""
BAND = 0.3
"""Opacity of an interval's bar."""
MOST = 48
"""Maximum number of strips; the tables have all draws."""


def draw_strips(scoreboard: Scoreboard) -> str | None:
    """Draw the picture as an SVG document; None without a value of several draws."""
    lines = [line for line in scoreboard.lines if _has_strip(line)][:MOST]
    if not lines:
        return None
    with canvas(WIDTH, len(lines) * PITCH + 1.0) as sheet:
        ax = sheet.subplots()
        for row, line in enumerate(lines):
            _draw_strip(ax, line, row)
        zero_line(ax)
        set_rows(ax, (len(lines) - 0.4, -0.6))
        ax.set_xlabel("Draws, in percent from the published value")
        _draw_legend(ax)
        return to_svg(sheet)


def _has_strip(line: Line) -> bool:
    """Whether a line has draws, no printed 0, and is reproducible (single readings are not)."""
    return bool(line.draws and line.cell.value) and line.status is not Status.NOT_REPRODUCIBLE


def _draw_strip(ax: Axes, line: Line, row: int) -> None:
    published = line.cell.value

    def percent(value: float) -> float:
        return 100 * (value - published) / abs(published)

    colour = STATUS[line.status or Status.SIMULATED].light
    estimate = line.found
    if estimate is not None and estimate.low is not None and estimate.high is not None:
        ends = [percent(estimate.low), percent(estimate.high)]
        ax.plot(ends, [row, row], color=MUTED.light, alpha=BAND, linewidth=5, solid_capstyle="butt")
    dots: dict[str, Any] = {"linestyle": "none", "color": colour, "clip_on": False}
    ax.plot(
        [percent(draw) for draw in line.draws], [row] * len(line.draws), "|", markersize=8, **dots
    )
    if line.reproduced is not None:
        ax.plot([percent(line.reproduced)], [row], marker="o", markersize=4, **dots)
    word(ax, LEFT, row, f"{line.cell.table} · {cell_name(line.cell)}", MUTED)
    if line.place is not None:
        word(ax, RIGHT, row, f"{number(100 * line.place.value, 2)} %", MUTED)


def _draw_legend(ax: Axes) -> None:
    """Draw the legend of ticks, dots, bars and lines, and the heading of the right column."""
    from matplotlib.lines import Line2D

    sign: dict[str, Any] = {"linestyle": "none", "color": INK.light}
    handles = [
        Line2D([], [], marker="|", markersize=8, **sign),
        Line2D([], [], marker="o", markersize=4, **sign),
        Line2D([], [], color=MUTED.light, alpha=BAND, linewidth=5, solid_capstyle="butt"),
        Line2D([], [], color=INK.light, linewidth=0.9),
    ]
    names = ["a draw", "median", "95 % of further draws", "published"]
    ax.figure.legend(handles, names, loc="outside upper left", ncols=4, borderpad=0)
    word(ax, RIGHT, -0.8, "draws below", MUTED)
