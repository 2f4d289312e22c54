"""Curves that are drawn beside one another at one place: the place is true in all but a picture."""

from __future__ import annotations

import csv
import io
from typing import Any

import numpy as np
import pytest

from campaign.archive.layout.results import ResultsOfTest, RunResults
from campaign.archive.layout.results_text import from_text, to_text
from campaign.archive.writing.plots import joined, plots_of
from campaign.report.drawing import figures
from campaign.report.drawing.figure_csv import figure_csv
from campaign.report.drawing.published_marks import PublishedMarks
from campaign.report.formats.as_json import _curve
from campaign.result import Array, Axis, Curve, Figure, Panel, Result

PLACES = np.deg2rad([-30.0, 0.0, 30.0])
ASIDE = np.deg2rad(2.0)
POSITION = Axis("Position", "rad", "deg")


def side_by_side() -> Figure:
    torque = np.array([20.0, 21.0, 22.0])
    curves = [
        Curve(PLACES, y, name, name, "points", low=y - 0.2, high=y + 0.2, aside=aside)
        for name, y, aside in (("up", torque, ASIDE), ("down", -torque, -ASIDE))
    ]
    return Figure("key", "Title", "", "", (Panel(POSITION, Axis("Torque", "N m"), curves),))


def lines_of(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Array, Array]]:
    """x and y of all that is drawn, a published value of the first curve included."""
    sheets: list[Any] = []
    original = figures.to_svg
    monkeypatch.setattr(figures, "to_svg", lambda sheet: (sheets.append(sheet), original(sheet))[1])
    published = PublishedMarks(PLACES[:1], np.array([19.0]), ("Table 1",))
    figures.draw(side_by_side(), {(0, 0): (published,)})
    (ax,) = sheets[0].axes
    return [(np.asarray(line.get_xdata()), np.asarray(line.get_ydata())) for line in ax.lines]


def test_a_drawing_has_them_apart_with_their_bars_and_published_values(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    drawn = lines_of(monkeypatch)
    assert len(drawn) == 5, "dots and bars of both, and the published value"
    for x, y in drawn:
        way = np.sign(y[0])
        off = x[np.isfinite(y)] - 2.0 * way
        assert set(np.round(off, 6)) <= {-30.0, 0.0, 30.0}


def test_the_numbers_of_a_figure_are_at_the_places_that_they_are_of() -> None:
    found = list(csv.DictReader(io.StringIO(figure_csv(side_by_side()))))
    assert [float(row["x"]) for row in found] == pytest.approx([-30.0, 0.0, 30.0] * 2)
    for curve in side_by_side().panels[0].curves:
        np.testing.assert_allclose(np.array(_curve(curve).x, dtype=float), PLACES, rtol=1e-6)


def test_results_keep_the_place_and_how_far_aside_it_is_drawn() -> None:
    arrays: list[Array] = []

    def place(values: Array) -> str:
        arrays.append(values)
        return str(len(arrays) - 1)

    tests = (ResultsOfTest("map", "breakaway", "", Result(figures=(side_by_side(),))),)
    found = RunResults("n", "n.nxs", "ab" * 32, "2026-11-21T09:40:00Z", "0.1.0", "cd" * 32, tests)
    back = from_text(to_text(found, place), lambda at: arrays[int(at)])
    (figure,) = back.tests[0].result.figures
    for curve, aside in zip(figure.panels[0].curves, (ASIDE, -ASIDE), strict=True):
        np.testing.assert_array_equal(curve.x, PLACES)
        assert curve.aside == aside


def test_single_points_beside_each_place_are_one_series_for_each_side() -> None:
    """Two maps with two directions each, and the mean: viewers show the first series alone."""
    at = [np.array([place]) for place in (1.0, 2.0, 3.0)]
    curves = [
        *(Curve(x, x + 10.0, "up", "up", "points", aside=0.1) for x in at[:2]),
        *(Curve(x, x + 20.0, "down", "down", "points", aside=-0.1) for x in at[:2]),
        Curve(at[2], at[2], "mean", "measured", "points"),
    ]
    plots = [joined(each) for each in plots_of(Panel(Axis("Sets"), Axis("Torque", "N m"), curves))]
    told = [(list(each.x), list(each.y)) for each in plots if each is not None]
    assert told == [([1.0, 2.0, 3.0], [11.0, 12.0, 3.0]), ([1.0, 2.0], [21.0, 22.0])]
