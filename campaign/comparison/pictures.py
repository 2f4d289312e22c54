"""Figures of pairs: changes in percent, and numbers of both runs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from campaign.api.quantity_words import axis_quantity_name, condition_words
from campaign.comparison.finding_pairs import Pair
from campaign.comparison.overlays import LOOKS, Letters
from campaign.estimate import Estimate
from campaign.estimation.difference import in_unit
from campaign.report.drawing.canvas import WIDTH, canvas, to_svg
from campaign.report.drawing.changes_picture import MOST, PITCH, name_row
from campaign.report.drawing.rows import set_rows
from campaign.report.palette import MUTED, Look
from campaign.text import capitalized, pretty_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes


PANELS = 6
"""Largest number of quantities in one figure."""


def with_names(pairs: Sequence[Pair]) -> list[tuple[Pair, str]]:
    """Pairs with their names: `Coulomb friction · direction positive`."""
    return [
        (pair, f"{axis_quantity_name(pair.test, pair.quantity)} · {place}".removesuffix(" · "))
        for pair, place in zip(pairs, row_names(pairs), strict=True)
    ]


def draw_side_by_side(pairs: Sequence[Pair], letters: Letters) -> str | None:
    """Figure of both runs' numbers, a panel per quantity with several pairs; None without any."""
    groups: dict[str, list[Pair]] = {}
    for pair in pairs:
        selected = pair.testable or not any(
            p.testable and p.quantity == pair.quantity for p in pairs
        )
        if selected and not (math.isnan(pair.reference.value) or math.isnan(pair.other.value)):
            groups.setdefault(pair.quantity, []).append(pair)
    several = [group[:MOST] for group in groups.values() if len(group) > 1][:PANELS]
    if not several:
        return None
    heights = [2 * PITCH * len(group) + 0.75 for group in several]
    with canvas(WIDTH, sum(heights) + 0.35) as sheet:
        axes = sheet.subplots(len(several), 1, squeeze=False, height_ratios=heights).ravel()
        for ax, group in zip(axes, several, strict=True):
            _draw_group(ax, group, letters)
        handles, labels = axes[0].get_legend_handles_labels()
        sheet.legend(handles, labels, loc="outside upper left", ncols=2, borderpad=0)
        return to_svg(sheet)


def _draw_group(ax: Axes, pairs: Sequence[Pair], letters: Letters) -> None:
    """Draw the numbers of one quantity: for each pair the reference above the other run."""
    first = pairs[0]
    unit, names = first.display, row_names(pairs)
    common = {n: v for n, v in first.conditions.items() if n not in _varied(pairs)}
    at = condition_words(first.test, common)
    if at:
        ax.set_title(capitalized(at), fontsize=7.5, weight="normal", color=MUTED.light)
    for row, pair in enumerate(pairs):
        own = zip((pair.reference, pair.other), LOOKS, (-0.16, 0.16), letters, strict=True)
        for estimate, look, shift, letter in own:
            _draw_number(ax, in_unit(estimate, unit), look, row + shift, letter if not row else "")
        name_row(ax, row, names[row], pair)
    set_rows(ax, (len(pairs) - 0.4, -0.6), len(pairs) - 1)
    label = capitalized(axis_quantity_name(first.test, first.quantity))
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
    """Text of the conditions of each pair that vary within its test and quantity."""
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
    """Names of conditions that vary between the pairs."""
    names = {name for pair in pairs for name in pair.conditions}
    return frozenset(n for n in names if len({repr(p.conditions.get(n)) for p in pairs}) > 1)
