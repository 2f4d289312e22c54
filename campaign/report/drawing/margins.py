"""Measured margins for ticks, labels, titles and legend.

matplotlib's constrained layout measures every axes four times or more for one drawing, which takes
as long as all the rest of it. Here an axes is measured where it stands nearly right, and again only
if its ticks have become others in its place, or if somebody says that its labels have.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from matplotlib.layout_engine import LayoutEngine
from matplotlib.transforms import Bbox

from campaign.report.drawing.cached_axes import settled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

ACROSS, DOWN = 3.0, 4.3
"""Points that stay free around each axes with its labels, and around the legend."""


@dataclass(frozen=True)
class Room:
    """What stands around an axes (points)."""

    left: float
    right: float
    bottom: float
    top: float


USUAL = Room(38.0, 5.0, 26.0, 16.0)
"""Of most axes of a report: where these stand is nearly right before anything is measured."""


class Margins(LayoutEngine):
    """Axes of a grid as large as what stands around them allows; a legend is above all of them.

    They share what is left by the ratios of their grid. Axes without a grid stay where they are.
    """

    _adjust_compatible = False
    _colorbar_gridspec = False

    def __init__(self) -> None:
        super().__init__()
        self._measured: dict[Axes, Room] = {}

    def forget(self, ax: Axes) -> None:
        """What stands around it has changed: it is measured again when it is placed next."""
        self._measured.pop(ax, None)

    def execute(self, fig: Canvas) -> None:
        """Place all axes of the figure."""
        axes = [ax for ax in fig.axes if ax.get_subplotspec() is not None]
        if not axes:
            return
        if not self._measured:
            _place(fig, axes, dict.fromkeys(axes, USUAL))
        for _ in range(2):
            new = [ax for ax in axes if ax not in self._measured]
            self._measured |= {ax: _around(ax) for ax in new}
            ticks = [_ticks(ax) for ax in axes]
            _place(fig, axes, self._measured)
            for ax, before in zip(axes, ticks, strict=True):
                if _ticks(ax) != before:
                    self.forget(ax)
            if len(self._measured) == len(axes):
                return


def _ticks(ax: Axes) -> list[Any]:
    return [list(axis.get_majorticklocs()) for axis in (ax.xaxis, ax.yaxis)]


def _around(ax: Axes) -> Room:
    with settled([ax]):
        outer, inner = ax.get_tightbbox(for_layout_only=True), ax.get_window_extent()
    if outer is None:
        return Room(0.0, 0.0, 0.0, 0.0)
    figure = ax.get_figure(root=True)
    per_point = 1.0 if figure is None else figure.dpi / 72
    sides = inner.x0 - outer.x0, outer.x1 - inner.x1, inner.y0 - outer.y0, outer.y1 - inner.y1
    return Room(*(side / per_point for side in sides))


def _place(fig: Canvas, axes: list[Axes], rooms: dict[Axes, Room]) -> None:
    """Columns and rows as wide and high as the axes in them need it; the legend above them."""
    width, height = 72 * fig.get_figwidth(), 72 * fig.get_figheight()
    above = sum(
        72 / fig.dpi * legend.get_window_extent().height + 2 * DOWN for legend in fig.legends
    )
    spec = axes[0].get_subplotspec()
    assert spec is not None  # noqa: S101 (for the type checker; the caller looked)
    grid = spec.get_gridspec()
    places = {ax: _cell(ax) for ax in axes}

    def most(side: str, number: int, line: int) -> float:
        return max(
            (getattr(rooms[ax], side) for ax in axes if places[ax][number] == line), default=0.0
        )

    columns = [
        (most("left", 1, k) + ACROSS, most("right", 1, k) + ACROSS) for k in range(grid.ncols)
    ]
    rows = [(most("top", 0, k) + DOWN, most("bottom", 0, k) + DOWN) for k in range(grid.nrows)]
    x = _shared(columns, grid.get_width_ratios(), width)
    y = _shared(rows, grid.get_height_ratios(), height - above)
    for ax in axes:
        (x0, x1), (y0, y1) = x[places[ax][1]], y[places[ax][0]]
        down = height - above
        ax.set_position(
            Bbox([[x0 / width, (down - y1) / height], [x1 / width, (down - y0) / height]])
        )


def _cell(ax: Axes) -> tuple[int, int]:
    """Its row and column."""
    spec = ax.get_subplotspec()
    return (0, 0) if spec is None else (spec.rowspan.start, spec.colspan.start)


def _shared(
    margins: list[tuple[float, float]], ratios: Any, total: float
) -> list[tuple[float, float]]:
    """Where each stretch begins and ends, one behind the other, within its two margins."""
    ratios = list(ratios or [1.0] * len(margins))
    left = max(total - sum(map(sum, margins)), 0.1 * total)
    found: list[tuple[float, float]] = []
    here = 0.0
    for (before, behind), ratio in zip(margins, ratios, strict=True):
        end = here + before + left * ratio / sum(ratios)
        found.append((here + before, end))
        here = end + behind
    return found
