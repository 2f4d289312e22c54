"""Draws of a random bench as a picture: one strip per published value, with its place in it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from campaign.published.scoreboard import Line, Scoreboard
from campaign.published.status import Status
from campaign.report.figures import WIDTH, canvas, to_svg
from campaign.report.overview import cell_name
from campaign.report.palette import HAIRLINE, INK, MUTED, STATUS
from campaign.report.text import number

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PITCH = 0.24
"""Inches from one strip to the next."""
MOST = 48
"""Strips that a page has room for; the tables have every place."""


def draw_strips(scoreboard: Scoreboard) -> str | None:
    """The picture as an SVG document; None when nothing was drawn more than once."""
    lines = [line for line in scoreboard.lines if _has_strip(line)][:MOST]
    if not lines:
        return None
    with canvas(WIDTH, len(lines) * PITCH + 0.75) as sheet:
        ax = sheet.subplots()
        for row, line in enumerate(lines):
            _draw_strip(ax, line, row)
        ax.axvline(0, color=INK.light, linewidth=0.9, zorder=1)
        ax.set_ylim(len(lines) - 0.4, -0.6)
        ax.set_xlabel("Draws, in percent from the published value")
        ax.yaxis.set_visible(False)
        ax.spines["left"].set_visible(False)
        ax.grid(axis="y", visible=False)
        return to_svg(sheet)


def place_words(line: Line) -> str:
    """`above 26 % (14 to 42 %) of 39 draws`; empty without draws."""
    if line.place is None or line.place.low is None or line.place.high is None:
        return ""
    share, low, high = (
        number(100 * end, 2) for end in (line.place.value, line.place.low, line.place.high)
    )
    return f"above {share} % ({low} to {high} %) of {len(line.draws)} draws"


def _has_strip(line: Line) -> bool:
    """Single readings would fill a page; and of a printed 0 nothing has a percentage."""
    return bool(line.draws and line.cell.value) and line.status is not Status.NOT_REPRODUCIBLE


def _draw_strip(ax: Axes, line: Line, row: int) -> None:
    published = line.cell.value

    def percent(value: float) -> float:
        return 100 * (value - published) / abs(published)

    colour = STATUS[line.status or Status.SIMULATED].light
    found = line.found
    if found is not None and found.low is not None and found.high is not None:
        ends = [percent(found.low), percent(found.high)]
        ax.plot(
            ends, [row, row], color=HAIRLINE.light, linewidth=5, solid_capstyle="butt", zorder=0
        )
    dots: dict[str, Any] = {"linestyle": "none", "color": colour, "clip_on": False}
    ax.plot(
        [percent(draw) for draw in line.draws], [row] * len(line.draws), "|", markersize=8, **dots
    )
    if line.reproduced is not None:
        ax.plot([percent(line.reproduced)], [row], marker="o", markersize=4, **dots)
    side: dict[str, Any] = {"transform": ax.get_yaxis_transform(), "va": "center"}
    name = f"{line.cell.table} · {cell_name(line.cell)}"
    ax.text(-0.015, row, name, fontsize=7.5, color=MUTED.light, ha="right", **side)
    if line.place is not None:
        share = f"{number(100 * line.place.value, 2)} %"
        ax.text(1.015, row, share, fontsize=7.5, color=MUTED.light, ha="left", **side)
