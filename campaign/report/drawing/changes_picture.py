"""Changes against references in percent, one row each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from campaign.references.verdict import JudgedNumber, Verdict
from campaign.report.drawing.figures import WIDTH, canvas, to_svg
from campaign.report.palette import HAIRLINE, INK, MUTED, OTHERS, PAPER

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PITCH = 0.19
"""Inches from one row to the next."""
MOST = 60
"""Rows that a picture has room for; the tables have them all."""
LINEAR = 10.0
"""Percent up to which an axis of changes is linear where some are far larger."""
FAR = 60.0
"""Percent beyond which changes count as far larger."""
LABEL = 58
"""Letters of a row's name."""


def with_change(pairs: Sequence[tuple[JudgedNumber, str]]) -> list[tuple[JudgedNumber, str]]:
    """Those that are drawn: what is not judged is left out, unless nothing else is there."""
    known = [
        each for each in pairs if None not in (each[0].found.change.low, each[0].found.change.high)
    ]
    return ([each for each in known if each[0].testable] or known)[:MOST]


def draw_changes(shown: Sequence[tuple[JudgedNumber, str]]) -> str:
    """Every change in percent with its interval, filled where declared; with names of the rows.

    shown: of `with_change`, at least one.
    """
    with canvas(WIDTH, len(shown) * PITCH + 0.9) as sheet:
        ax = sheet.subplots()
        limit = _limit([pair for pair, _ in shown])
        for row, (pair, name) in enumerate(shown):
            _draw_change(ax, pair, row, limit)
            name_row(ax, row, name, bold=pair.verdict is Verdict.DIFFERENT)
        if limit > FAR:
            ax.set_xscale("symlog", linthresh=LINEAR, linscale=1.0)
            _ticks(ax, limit)
        ax.axvline(0, color=INK.light, linewidth=0.9, zorder=1)
        ax.set_xlim(-limit, limit)
        rows(ax, len(shown))
        ax.set_xlabel("Change, in percent of the reference")
        return to_svg(sheet)


def name_row(ax: Axes, row: int, name: str, *, bold: bool) -> None:
    """Its name, left of the axes."""
    text: dict[str, Any] = {"transform": ax.get_yaxis_transform(), "ha": "right", "va": "center"}
    short = name if len(name) <= LABEL else f"{name[: LABEL - 1]}…"
    colour = INK.light if bold else MUTED.light
    weight = "bold" if bold else "normal"
    ax.text(-0.015, row, short, fontsize=7.5, color=colour, weight=weight, **text)


def rows(ax: Axes, count: int) -> None:
    """Rows from top to bottom, with a line between each two."""
    ax.set_ylim(count - 0.4, -0.6)
    ax.yaxis.set_visible(False)
    ax.spines["left"].set_visible(False)
    ax.grid(axis="y", visible=False)
    for row in range(count - 1):
        ax.axhline(row + 0.5, color=HAIRLINE.light, linewidth=0.4, zorder=0)


def _limit(pairs: Sequence[JudgedNumber]) -> float:
    """Half of the axis (percent): all values and, up to three times as far, their intervals."""
    values = max(abs(100 * pair.found.change.value) for pair in pairs)
    ends = max(
        abs(100 * (end or 0.0))
        for pair in pairs
        for end in (pair.found.change.low, pair.found.change.high)
    )
    return 1.08 * max(min(ends, max(3 * values, 20.0)), values, 0.1)


def _draw_change(ax: Axes, pair: JudgedNumber, row: int, limit: float) -> None:
    change = pair.found.change
    low, value, high = (
        min(max(100 * (end or 0.0), -limit), limit)
        for end in (change.low, change.value, change.high)
    )
    declared = pair.verdict is Verdict.DIFFERENT
    look = OTHERS[1] if declared else MUTED
    ax.plot([low, high], [row, row], color=look.light, linewidth=1.6 if declared else 1.0)
    face = look.light if declared else PAPER.light
    ax.plot(
        [value],
        [row],
        marker="o" if pair.testable else "D",
        markersize=4.5,
        linestyle="none",
        color=look.light,
        markerfacecolor=face,
        markeredgewidth=1.0,
    )


def _ticks(ax: Axes, limit: float) -> None:
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    sizes = [10.0**n for n in range(1, 9) if 10.0**n <= limit]
    ax.xaxis.set_major_locator(FixedLocator([*(-s for s in reversed(sizes)), 0.0, *sizes]))
    ax.xaxis.set_minor_locator(NullLocator())
    ax.xaxis.set_major_formatter(FuncFormatter(lambda t, _: f"{t:g}".replace("-", "−")))
