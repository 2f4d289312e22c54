"""Room around axes: nothing is cut or covered."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from campaign.report.drawing import figures
from campaign.report.drawing.figures import draw
from campaign.result import Axis, Curve, Figure, Mark, Panel

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

T = np.linspace(0.0, 1.0, 50)


def panel(title: str, scale: float, marks: tuple[Mark, ...] = ()) -> Panel:
    curves = [Curve(T, scale * np.sin(9 * T), f"curve {title}")]
    return Panel(Axis("time", "s"), Axis("torque", "N·m"), curves, title, marks)


def several(*marks: Mark) -> Figure:
    """Four panels, whose numbers are of very different lengths."""
    scales = (1.0, 12345.0, 1e-3, 7e7)
    panels = tuple(panel(f"Panel {k}", s, marks) for k, s in enumerate(scales))
    return Figure("several", "Several", "Several panels.", "Several.", panels, across=2)


@pytest.mark.parametrize(
    "figure",
    [
        several(),
        several(Mark("a long label over the axes", x=0.5), Mark("level of a friction", y=0.2)),
        Figure("one", "One", "One.", "One.", (panel("Alone", 3.0),)),
    ],
)
def test_everything_is_on_the_sheet_and_no_panel_reaches_into_another(
    figure: Figure, monkeypatch: pytest.MonkeyPatch
) -> None:
    found: list[list[Any]] = []
    original = figures.to_svg

    def keep(drawn: Canvas) -> str:
        text = original(drawn)
        width, height = drawn.get_size_inches() * drawn.dpi
        boxes = [ax.get_tightbbox() for ax in drawn.axes]
        boxes += [legend.get_window_extent() for legend in drawn.legends]
        found.append([(width, height), boxes])
        return text

    monkeypatch.setattr(figures, "to_svg", keep)
    draw(figure)
    (((width, height), boxes),) = found
    for box in boxes:
        assert -0.5 <= box.x0 < box.x1 <= width + 0.5
        assert -0.5 <= box.y0 < box.y1 <= height + 0.5
    for one, other in combinations(boxes, 2):
        assert not one.padded(-0.5).overlaps(other.padded(-0.5))
