"""Pairs as pictures: all changes in percent, and the numbers of both runs side by side."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from campaign.comparing.judging import Pair
from campaign.comparing.overlays import Letters
from campaign.comparing.words import condition_words, name_here
from campaign.estimate import Estimate
from campaign.estimation.difference import in_unit
from campaign.references.judged import Verdict
from campaign.report.drawing.figures import WIDTH, canvas, to_svg
from campaign.report.palette import HAIRLINE, INK, MUTED, OTHERS, PAPER, Look
from campaign.text import pretty_unit

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
PANELS = 6
"""Most quantities of a test that are shown side by side."""
LABEL = 58
"""Letters of a row's name."""


def draw_changes(pairs: Sequence[Pair]) -> str | None:
    """Every change in percent with its interval, filled where declared; None without any.

    What is not judged is left out, unless nothing else is there.
    """
    shown = [pair for pair in pairs if _has_change(pair) and pair.testable]
    shown = (shown or [pair for pair in pairs if _has_change(pair)])[:MOST]
    if not shown:
        return None
    with canvas(WIDTH, len(shown) * PITCH + 0.9) as sheet:
        ax = sheet.subplots()
        limit = _limit(shown)
        names = row_names(shown)
        for row, pair in enumerate(shown):
            _draw_change(ax, pair, row, limit)
            told = f"{name_here(pair.test, pair.quantity)} · {names[row]}".removesuffix(" · ")
            _name(ax, row, told, bold=pair.verdict is Verdict.DIFFERENT)
        if limit > FAR:
            ax.set_xscale("symlog", linthresh=LINEAR, linscale=1.0)
            _ticks(ax, limit)
        ax.axvline(0, color=INK.light, linewidth=0.9, zorder=1)
        ax.set_xlim(-limit, limit)
        _rows(ax, len(shown))
        ax.set_xlabel("Change, in percent of the reference")
        return to_svg(sheet)


def draw_side_by_side(pairs: Sequence[Pair], letters: Letters) -> str | None:
    """Both runs' numbers of each quantity that has several, a panel each; None without any."""
    groups: dict[str, list[Pair]] = {}
    for pair in pairs:
        told = pair.testable or not any(p.testable and p.quantity == pair.quantity for p in pairs)
        if told and not (math.isnan(pair.reference.value) or math.isnan(pair.other.value)):
            groups.setdefault(pair.quantity, []).append(pair)
    several = [group[:MOST] for group in groups.values() if len(group) > 1][:PANELS]
    if not several:
        return None
    rows = [len(group) for group in several]
    heights = [2 * PITCH * n + 0.75 for n in rows]
    with canvas(WIDTH, sum(heights) + 0.35) as sheet:
        axes = sheet.subplots(len(several), 1, squeeze=False, height_ratios=heights).ravel()
        for ax, group in zip(axes, several, strict=True):
            _draw_group(ax, group, letters)
        handles, labels = axes[0].get_legend_handles_labels()
        sheet.legend(handles, labels, loc="outside upper left", ncols=2, borderpad=0)
        return to_svg(sheet)


def _has_change(pair: Pair) -> bool:
    return pair.found.change.low is not None and pair.found.change.high is not None


def _limit(pairs: Sequence[Pair]) -> float:
    """Half of the axis (percent): all values and, up to three times as far, their intervals."""
    values = max(abs(100 * pair.found.change.value) for pair in pairs)
    ends = max(
        abs(100 * (end or 0.0))
        for pair in pairs
        for end in (pair.found.change.low, pair.found.change.high)
    )
    return 1.08 * max(min(ends, max(3 * values, 20.0)), values, 0.1)


def _draw_change(ax: Axes, pair: Pair, row: int, limit: float) -> None:
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


def _draw_group(ax: Axes, pairs: Sequence[Pair], letters: Letters) -> None:
    """The numbers of one quantity, the reference's above the other's."""
    first = pairs[0]
    unit, names = first.display, row_names(pairs)
    common = {n: v for n, v in first.conditions.items() if n not in _varied(pairs)}
    at = condition_words(first.test, common)
    if at:
        ax.set_title(at[0].upper() + at[1:], fontsize=7.5, weight="normal", color=MUTED.light)
    for row, pair in enumerate(pairs):
        own = zip((pair.reference, pair.other), letters.looks, (-0.16, 0.16), "ro", strict=True)
        for estimate, look, shift, whose in own:
            letter = letters.reference if whose == "r" else letters.other
            _draw_number(ax, in_unit(estimate, unit), look, row + shift, letter if not row else "")
        _name(ax, row, names[row], bold=pair.verdict is Verdict.DIFFERENT)
    _rows(ax, len(pairs))
    words = name_here(first.test, first.quantity)
    label = words[:1].upper() + words[1:]
    ax.set_xlabel(f"{label} ({pretty_unit(unit)})" if unit else label)


def _draw_number(ax: Axes, estimate: Estimate, look: Look, y: float, label: str) -> None:
    low, high = estimate.combined
    if low is not None and high is not None:
        ax.plot([low, high], [y, y], color=look.light, linewidth=1.2)
    ax.plot(
        [estimate.value],
        [y],
        marker=look.marker,
        markersize=4.5,
        markeredgewidth=0,
        linestyle="none",
        color=look.light,
        label=label or None,
    )


def row_names(pairs: Sequence[Pair]) -> list[str]:
    """The conditions of each pair in which others of its test and quantity differ."""
    groups: dict[tuple[str, str], list[Pair]] = {}
    for pair in pairs:
        groups.setdefault((pair.test.name, pair.quantity), []).append(pair)
    varied = {key: _varied(group) for key, group in groups.items()}
    return [
        condition_words(
            pair.test,
            {
                name: value
                for name, value in pair.conditions.items()
                if name in varied[pair.test.name, pair.quantity]
            },
        )
        for pair in pairs
    ]


def _varied(pairs: Sequence[Pair]) -> frozenset[str]:
    """Names of conditions that do not have one value in all pairs."""
    names = {name for pair in pairs for name in pair.conditions}
    return frozenset(n for n in names if len({repr(p.conditions.get(n)) for p in pairs}) > 1)


def _name(ax: Axes, row: int, name: str, *, bold: bool) -> None:
    text: dict[str, Any] = {"transform": ax.get_yaxis_transform(), "ha": "right", "va": "center"}
    short = name if len(name) <= LABEL else f"{name[: LABEL - 1]}…"
    colour = INK.light if bold else MUTED.light
    weight = "bold" if bold else "normal"
    ax.text(-0.015, row, short, fontsize=7.5, color=colour, weight=weight, **text)


def _rows(ax: Axes, count: int) -> None:
    ax.set_ylim(count - 0.4, -0.6)
    ax.yaxis.set_visible(False)
    ax.spines["left"].set_visible(False)
    ax.grid(axis="y", visible=False)
    for row in range(count - 1):
        ax.axhline(row + 0.5, color=HAIRLINE.light, linewidth=0.4, zorder=0)


def _ticks(ax: Axes, limit: float) -> None:
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    sizes = [10.0**n for n in range(1, 9) if 10.0**n <= limit]
    ax.xaxis.set_major_locator(FixedLocator([*(-s for s in reversed(sizes)), 0.0, *sizes]))
    ax.xaxis.set_minor_locator(NullLocator())
    ax.xaxis.set_major_formatter(FuncFormatter(lambda t, _: f"{t:g}".replace("-", "−")))
