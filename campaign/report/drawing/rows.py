"""Pictures of named rows: a name beside each, values along one axis."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from campaign.report.palette import HAIRLINE, INK, Look

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LEFT, RIGHT = -0.015, 1.015
"""Positions beside the axes, as shares of their width."""
LABEL = 58
"""Maximum number of letters of a row's name."""


def word(
    ax: Axes, x: float, row: float, text: str, look: Look, size: float = 7.5, **more: Any
) -> None:
    """Write a text beside the axes: left of `LEFT`, or right of `RIGHT`."""
    side = "right" if x < 0.5 else "left"
    at: dict[str, Any] = {"transform": ax.get_yaxis_transform(), "ha": side, "va": "center"}
    short = text if len(text) <= LABEL else f"{text[: LABEL - 1]}…"
    ax.text(x, row, short, fontsize=size, color=look.light, **at, **more)


def set_rows(ax: Axes, ends: tuple[float, float], lines: int = 0) -> None:
    """Replace the y axis by rows from top to bottom, with `lines` lines between them."""
    ax.set_ylim(*ends)
    ax.yaxis.set_visible(False)
    ax.spines["left"].set_visible(False)
    ax.grid(axis="y", visible=False)
    for row in range(lines):
        ax.axhline(row + 0.5, color=HAIRLINE.light, linewidth=0.4, zorder=0)


def zero_line(ax: Axes) -> None:
    """Draw the line of zero difference."""
    ax.axvline(0, color=INK.light, linewidth=0.9, zorder=1)


def signed_decades(
    ax: Axes, limit: float, linear: float, scale: float, told: Callable[[float], str]
) -> None:
    """Set an x axis with both signs, linear up to `linear` and logarithmic beyond.

    limit: largest labelled value. scale: length of the linear part in decades. told: label of a
    value, with a hyphen for a minus.
    """
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    ax.set_xscale("symlog", linthresh=linear, linscale=scale)
    sizes = [linear * 10.0**n for n in range(9) if linear * 10.0**n <= limit]
    ax.xaxis.set_major_locator(FixedLocator([*(-size for size in reversed(sizes)), 0.0, *sizes]))
    ax.xaxis.set_minor_locator(NullLocator())
    ax.xaxis.set_major_formatter(FuncFormatter(lambda tick, _: told(tick).replace("-", "−")))
