"""Room around axes: nothing is cut or covered, and what did not change is not measured again."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from matplotlib.ticker import FuncFormatter

from campaign.report.drawing import figures
from campaign.report.drawing.figures import canvas, draw
from campaign.report.drawing.margins import ACROSS, DOWN, Margins
from campaign.result import Axis, Curve, Figure, Mark, Panel

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

T = np.linspace(0.0, 1.0, 50)


@pytest.fixture
def sheet() -> Iterator[Canvas]:
    with ExitStack() as stack:
        yield stack.enter_context(canvas(6.9, 4.0))


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


def test_panels_of_a_grid_are_equally_large_and_share_the_ratios(sheet: Canvas) -> None:
    axes = sheet.subplots(2, 2, height_ratios=[1, 2])
    axes[0, 0].set_ylabel("label")
    axes[1, 1].set_ylim(0, 1e5)
    Margins().execute(sheet)
    boxes = [[ax.get_position() for ax in row] for row in axes]
    assert boxes[0][0].width == pytest.approx(boxes[1][1].width)
    assert boxes[1][0].height == pytest.approx(2 * boxes[0][1].height)
    assert boxes[0][0].x0 == pytest.approx(boxes[1][0].x0)
    assert boxes[0][1].x0 > boxes[0][0].x1


def test_a_legend_has_its_room_above_all_axes(sheet: Canvas) -> None:
    ax = sheet.subplots()
    ax.plot(T, T, label="line")
    Margins().execute(sheet)
    before = ax.get_position()
    legend = sheet.legend(loc="outside upper left")
    Margins().execute(sheet)
    room = 72 * sheet.get_figheight() * (before.y1 - ax.get_position().y1)
    assert room == pytest.approx(legend.get_window_extent().height + 2 * DOWN, abs=0.2)
    assert ax.get_tightbbox().y1 < legend.get_window_extent().y0


def test_only_what_has_changed_is_measured_again(
    sheet: Canvas, monkeypatch: pytest.MonkeyPatch
) -> None:
    left, right = sheet.subplots(1, 2)
    measured: list[Any] = []
    for ax in (left, right):
        ax.set_xticks([0.0, 1.0])
        ax.set_yticks([0.0, 1.0])
        original = ax.get_tightbbox

        def told(*args: Any, ax: Any = ax, original: Any = original, **options: Any) -> Any:
            measured.append(ax)
            return original(*args, **options)

        monkeypatch.setattr(ax, "get_tightbbox", told)
    margins = Margins()
    margins.execute(sheet)
    margins.execute(sheet)
    assert measured == [left, right]
    before = right.get_position().width
    right.set_ylabel("two\nlines\nof a label")
    margins.forget(right)
    margins.execute(sheet)
    assert measured == [left, right, right]
    assert right.get_position().width < before


def test_ticks_that_become_others_in_their_place_are_measured_again(sheet: Canvas) -> None:
    """A low panel has fewer ticks than where it was measured, here with narrower names."""
    ax = sheet.subplots()
    ax.set_xlabel("\n".join(["a very high label"] * 20))
    names = FuncFormatter(lambda *_: "w" * len(ax.yaxis.get_majorticklocs()))
    ax.yaxis.set_major_formatter(names)
    Margins().execute(sheet)
    assert ax.get_tightbbox(for_layout_only=True).x0 == pytest.approx(ACROSS, abs=0.01)
