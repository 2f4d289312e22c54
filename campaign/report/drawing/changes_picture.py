"""Changes against references in percent, one row each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from campaign.references.verdict import JudgedNumber, Verdict
from campaign.report.drawing.canvas import WIDTH, canvas, to_svg
from campaign.report.drawing.rows import LEFT, set_rows, signed_decades, word, zero_line
from campaign.report.palette import INK, MUTED, OTHERS, PAPER

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PITCH = 0.19
"""Pitch of the rows (inches)."""
MOST = 60
"""Maximum number of rows; the tables have all pairs."""
LINEAR = 10.0
"""Limit of the linear part of a logarithmic axis of changes (percent)."""
FAR = 60.0
"""Limit of the axis above which it is logarithmic (percent)."""


def with_change(pairs: Sequence[tuple[JudgedNumber, str]]) -> list[tuple[JudgedNumber, str]]:
    """Select the pairs to draw: those with an interval that are testable, or else all of these."""
    known = [
        each for each in pairs if None not in (each[0].found.change.low, each[0].found.change.high)
    ]
    return ([each for each in known if each[0].testable] or known)[:MOST]


def draw_changes(shown: Sequence[tuple[JudgedNumber, str]]) -> str:
    """Draw each change in percent with its interval, filled if declared, and its name.

    shown: pairs of `with_change`, at least one.
    """
    with canvas(WIDTH, len(shown) * PITCH + 0.9) as sheet:
        ax = sheet.subplots()
        limit = _limit([pair for pair, _ in shown])
        for row, (pair, name) in enumerate(shown):
            _draw_change(ax, pair, row, limit)
            name_row(ax, row, name, pair)
        if limit > FAR:
            signed_decades(ax, limit, LINEAR, 1.0, "{:g}".format)
        zero_line(ax)
        ax.set_xlim(-limit, limit)
        set_rows(ax, (len(shown) - 0.4, -0.6), len(shown) - 1)
        ax.set_xlabel("Change, in percent of the reference")
        return to_svg(sheet)


def name_row(ax: Axes, row: int, name: str, pair: JudgedNumber) -> None:
    """Write the name of a pair left of the axes, bold if a difference is declared."""
    declared = pair.verdict is Verdict.DIFFERENT
    weight = "bold" if declared else "normal"
    word(ax, LEFT, row, name, INK if declared else MUTED, weight=weight)


def _limit(pairs: Sequence[JudgedNumber]) -> float:
    """Half of the axis (percent): all values, and intervals up to three times the largest."""
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
