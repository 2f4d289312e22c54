"""Legend of a figure: curves and published values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from campaign.report.drawing.curves import DOTTED, HOLLOW, PALE, hollow_marker, series_name
from campaign.report.drawing.published_marks import Marks
from campaign.report.palette import INK, Look
from campaign.result import Figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

LETTER, SIGN = 0.072, 0.65
"""Width of a letter in a legend, and of the sign of an entry with all spaces (inches)."""
MOST_SIGNS = 4
"""Maximum number of signs of published series beside one entry of a legend."""


def add_legend(sheet: Canvas, axes: Sequence[Axes], more: Mapping[str, Any] | None = None) -> None:
    """Add one legend for all panels above them, where it covers no data.

    more: further entries, sign by label.
    """
    from matplotlib.legend_handler import HandlerTuple

    signs: dict[str, dict[object, Any]] = {}
    for ax in axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            signs.setdefault(label, {}).setdefault(_sign(handle), handle)
    entries: dict[str, Any] = {label: tuple(each.values()) for label, each in signs.items()}
    entries |= more or {}
    if not entries:
        return
    columns = _columns([len(label) for label in entries], sheet.get_figwidth())
    # A legend is filled column by column, and read row by row.
    order = [label for column in range(columns) for label in list(entries)[column::columns]]
    sheet.legend(
        [entries[label] for label in order],
        order,
        loc="outside upper left",
        ncols=columns,
        borderpad=0,
        handler_map={tuple: HandlerTuple(ndivide=None, pad=0.1)},
    )


def _sign(handle: Any) -> object:
    """Look of a curve: it may be a line in one panel, and dots in another."""
    from matplotlib.lines import Line2D

    if not isinstance(handle, Line2D):
        return type(handle)
    return handle.get_color(), handle.get_linestyle() != "None", handle.get_marker()


def _columns(lengths: Sequence[int], width: float) -> int:
    """Maximum number of columns of a legend in `width` (inches), for entries of these `lengths`."""
    for columns in range(len(lengths), 1, -1):
        widest = [max(lengths[column::columns]) for column in range(columns)]
        if sum(LETTER * each + SIGN for each in widest) <= width:
            return columns
    return 1


def published_signs(figure: Figure, published: Marks, chosen: Mapping[str, Look]) -> dict[str, Any]:
    """Legend entries of published values: their hollow signs side by side."""
    from matplotlib.lines import Line2D

    signs: dict[str, dict[tuple[str, str], Any]] = {}
    for (place, number), marks in published.items():
        look = chosen[series_name(figure.panels[place].curves[number])]
        for each in marks:
            sign, colour = hollow_marker(look), look.light
            style = HOLLOW | {"marker": sign, "markersize": 5.5}
            label = "published"
            if each.joined:
                sign, colour, style, label = "", INK.light, DOTTED, "published parameters"
            elif each.doubtful:
                style = style | {"alpha": PALE}
            label += ", doubtful" if each.doubtful else ""
            line = Line2D([], [], color=colour, **style)
            signs.setdefault(label, {}).setdefault((sign, colour), line)
    return {label: tuple(each.values())[:MOST_SIGNS] for label, each in sorted(signs.items())}
