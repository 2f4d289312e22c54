"""Labels of marks cover no data, wherever the data are; ticks say what an axis shows."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pytest

from campaign.report.drawing import figures
from campaign.report.drawing.mark_labels import covers_data
from campaign.report.drawing.ticks import logarithmic
from campaign.result import Axis, Curve, Figure, Mark, Panel

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas
    from matplotlib.transforms import Bbox


def drawn(monkeypatch: pytest.MonkeyPatch, *panels: Panel, across: int = 1) -> list[Axes]:
    """The axes of a figure as it is written."""
    sheets: list[Canvas] = []
    original = figures.to_svg

    def keep(sheet: Canvas) -> str:
        text = original(sheet)
        sheets.append(sheet)
        return text

    monkeypatch.setattr(figures, "to_svg", keep)
    figures.draw(Figure("key", "Title", "Caption", "Alt", panels, across=across))
    return sheets[0].axes[: len(panels)]


@pytest.mark.parametrize("end", [0.0164, 15000.0])
def test_labels_of_a_linear_axis_do_not_touch(monkeypatch: pytest.MonkeyPatch, end: float):
    """Such as hours of runs that are a minute apart: `0.0025` is wider than matplotlib expects."""
    boxes: list[Bbox] = []
    original = figures.to_svg

    def measured(sheet: Canvas) -> str:  # in the style in which the figure is drawn
        sheet.draw_without_rendering()
        low, high = sheet.axes[0].get_xlim()
        labels = zip(sheet.axes[0].get_xticks(), sheet.axes[0].get_xticklabels(), strict=True)
        boxes.extend(text.get_window_extent() for at, text in labels if low <= at <= high)
        return original(sheet)

    monkeypatch.setattr(figures, "to_svg", measured)
    x = np.linspace(0.0, end, 5)
    panel = Panel(Axis("Time", "h"), Axis("Torque", "N m"), (Curve(x, x),))
    figures.draw(Figure("key", "Title", "Caption", "Alt", (panel,) * 12, across=2))
    assert len(boxes) >= 2
    assert all(one.x1 + figures.GAP / 2 < other.x0 for one, other in pairwise(boxes))


def label_boxes(ax: Axes) -> dict[str, Bbox]:
    from matplotlib.text import Annotation

    labels = [text for text in ax.texts if isinstance(text, Annotation) and text.get_text()]
    return {text.get_text(): text.get_window_extent() for text in labels}


def assert_labels_are_free(ax: Axes, expected: Sequence[str]) -> None:
    boxes = label_boxes(ax)
    assert set(boxes) == set(expected)
    for name, box in boxes.items():
        assert not covers_data(ax, box), name
        for other, second in boxes.items():
            assert other == name or not box.overlaps(second), (name, other)


X = np.linspace(0.0, 1.0, 400)
FILLED = [Curve(X, np.sin(2 * np.pi * k * X), f"{k}", f"{k}") for k in range(1, 9)]
SHAPES = {
    "rising": [Curve(X, X, "a", "a")],
    "oscillating": [Curve(X, np.sin(70 * X), "a", "a")],
    "dots": [Curve(X[::9], np.cos(9 * X[::9]), "a", "a", "points")],
    "everywhere": FILLED,
}
MARKS = (
    Mark("threshold", y=0.5),
    Mark("crossing", x=0.5),
    Mark("breakaway", x=0.21, y=0.4, point=True),
    Mark("first slip", x=0.5, y=0.5, point=True),
    Mark("window", x=0.6, until=0.9),
    Mark("bound", y=0.55, until=0.7),
)


@pytest.mark.slow
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("scale", ["linear", "log"])
@pytest.mark.parametrize("panels", [1, 3])
def test_labels_cover_neither_data_nor_one_another(
    shape: str, scale: str, panels: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    panel = Panel(Axis("Time", "s", "s", scale), Axis("Rate"), SHAPES[shape], "Title", MARKS)  # type: ignore[arg-type]
    for ax in drawn(monkeypatch, *[panel] * panels, across=2):
        assert_labels_are_free(ax, [mark.label for mark in MARKS])


def test_labels_stay_on_the_sheet_and_off_the_titles(monkeypatch: pytest.MonkeyPatch) -> None:
    marks = [Mark(f"the mark at {x:g} s", x=x) for x in (0.0, 0.1, 0.5, 0.55, 1.0)]
    panel = Panel(Axis("Time", "s"), Axis("Rate"), SHAPES["rising"], "A long title of it", marks)
    (ax,) = drawn(monkeypatch, panel)
    sheet = ax.get_figure().bbox  # type: ignore[union-attr]
    title = ax._left_title.get_window_extent()  # type: ignore[attr-defined]
    for box in label_boxes(ax).values():
        assert sheet.x0 <= box.x0 < box.x1 <= sheet.x1
        assert box.y1 <= sheet.y1
        assert not box.overlaps(title)
    assert_labels_are_free(ax, [mark.label for mark in marks])


def test_what_is_out_of_view_has_no_label(monkeypatch: pytest.MonkeyPatch) -> None:
    axis = Axis("Time", "s", limits=(0.2, 0.4))
    marks = [Mark("late", x=0.9), Mark("there", x=0.3), Mark("dot", x=0.9, y=0.9, point=True)]
    (ax,) = drawn(monkeypatch, Panel(axis, Axis("Rate"), SHAPES["rising"], marks=marks))
    assert set(label_boxes(ax)) == {"there"}


def test_the_check_itself_sees_a_label_over_a_curve(monkeypatch: pytest.MonkeyPatch) -> None:
    (ax,) = drawn(monkeypatch, Panel(Axis("Time"), Axis("Rate"), SHAPES["rising"]))
    middle = ax.annotate("over it", (0.5, 0.5), ha="center", va="center")
    aside = ax.annotate("aside", (0.2, 0.8), ha="center", va="center")
    assert covers_data(ax, middle.get_window_extent())
    assert not covers_data(ax, aside.get_window_extent())


def test_a_mark_has_the_colour_of_its_series(monkeypatch: pytest.MonkeyPatch) -> None:
    marks = [Mark("x", x=0.5, y=0.5, point=True, series="lugre"), Mark("y", y=0.2)]
    (ax,) = drawn(monkeypatch, Panel(Axis("T"), Axis("R"), SHAPES["rising"], marks=marks))
    colours = {t.get_text(): t.get_color() for t in ax.texts if t.get_text()}
    assert colours["x"] == figures.looks(["lugre"])["lugre"].light
    assert colours["y"] == figures.MUTED.light


# Ticks


@pytest.mark.parametrize(
    ("low", "high", "places"),
    [
        (0.05, 3.1, [0.05, 0.1, 0.2, 0.5, 1, 2]),
        (0.15, 0.95, [0.2, 0.5]),
        (1e-3, 1.0, [1e-3, 1e-2, 1e-1, 1]),
        (1e-9, 1e9, [1e-9, 1e-6, 1e-3, 1, 1e3, 1e6, 1e9]),
    ],
)
def test_a_logarithmic_axis_has_ticks_enough(low: float, high: float, places: list[float]) -> None:
    found = logarithmic(low, high)
    if len(places) < 3:  # steps of another kind, but enough of them
        assert len(found) >= 3
        assert np.ptp(np.diff(found)) == pytest.approx(0.0, abs=1e-12)
    else:
        assert found == pytest.approx(places)


@pytest.mark.parametrize(("low", "high"), [(0.0, 1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, np.inf)])
def test_an_axis_that_cannot_be_logarithmic_has_no_such_ticks(low: float, high: float) -> None:
    assert logarithmic(low, high) == []


def ticks(ax: Axes) -> np.ndarray:
    low, high = ax.get_xlim()
    return np.array([tick for tick in ax.get_xticks() if low <= tick <= high])


def test_counted_things_have_whole_ticks(monkeypatch: pytest.MonkeyPatch) -> None:
    x = np.array([1.0, 2.0, 3.0])
    (ax,) = drawn(monkeypatch, Panel(Axis("Map"), Axis("R"), [Curve(x, x / 7, "a", "a", "points")]))
    assert ticks(ax).tolist() == [1, 2, 3]


def test_numbers_with_a_unit_are_not_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    x = np.array([1.0, 2.0])
    (ax,) = drawn(monkeypatch, Panel(Axis("Time", "s"), Axis("R"), [Curve(x, x / 7, "a", "a")]))
    assert not np.allclose(ticks(ax) % 1, 0)


def test_angles_go_in_parts_of_a_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    x = np.deg2rad(np.array([-45.0, 0.0, 45.0]))
    axis = Axis("Angle", "rad", "deg")
    (ax,) = drawn(monkeypatch, Panel(axis, Axis("R"), [Curve(x, x, "a", "a")]))
    assert ticks(ax) == pytest.approx([-45, -30, -15, 0, 15, 30, 45])
