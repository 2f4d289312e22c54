"""The numbers behind a figure, as the file beside it has them."""

from __future__ import annotations

import csv
import io
from itertools import groupby
from types import ModuleType

import numpy as np
import pytest

from campaign.experiments.interface import TestData
from campaign.report.drawing.decimate import POINTS
from campaign.report.drawing.figure_csv import COLUMNS, figure_csv
from campaign.result import Axis, Curve, Figure, Panel

X = np.array([0.0, 0.5, 1.0])
Y = np.array([0.001, np.nan, -0.002])
ERROR = Axis("Error", "rad", "mrad")
TIME = Axis("Time", "s", "ms")


def rows(*panels: Panel) -> list[dict[str, str]]:
    text = figure_csv(Figure("key", "Title", "Caption", "Alt", panels))
    assert text.splitlines()[0] == ",".join(COLUMNS)
    return list(csv.DictReader(io.StringIO(text)))


def column(found: list[dict[str, str]], name: str) -> list[float]:
    return [float(row[name]) if row[name] else float("nan") for row in found]


def test_curves_are_in_the_units_of_the_axes_which_stand_there() -> None:
    found = rows(Panel(TIME, ERROR, [Curve(X, Y, "LuGre", "lugre")], "Error"))
    assert column(found, "x") == pytest.approx([0.0, 500.0, 1000.0])
    assert column(found, "y") == pytest.approx([1.0, np.nan, -2.0], nan_ok=True)
    first = found[0]
    assert (first["panel"], first["curve"]) == ("Error", "LuGre")
    assert (first["x_unit"], first["y_unit"]) == ("ms", "mrad")
    assert first["low"] == first["high"] == ""


def test_intervals_and_bands_have_their_ends() -> None:
    bars = Curve(X, X, "found", "fit", "points", low=X - 0.25, high=np.array([0.5, np.nan, 2.0]))
    band = Curve(X, X + 1, "band", "fit", "band", y_low=X - 1)
    floor = Curve(X, X + 1, "", "share", "band")
    found = rows(Panel(Axis("x"), Axis("y"), [bars, band, floor]))
    by_curve = {row["curve"]: [r for r in found if r["curve"] == row["curve"]] for row in found}
    assert column(by_curve["found"], "low") == pytest.approx([-0.25, 0.25, 0.75])
    assert column(by_curve["found"], "high") == pytest.approx([0.5, np.nan, 2.0], nan_ok=True)
    assert column(by_curve["band"], "low") == pytest.approx([-1.0, -0.5, 0.0])
    assert column(by_curve["band"], "high") == pytest.approx([1.0, 1.5, 2.0])
    assert {row["y"] for row in by_curve["band"]} == {""}
    assert column(by_curve["share"], "low") == [0.0, 0.0, 0.0]


def test_curves_and_panels_of_one_name_are_told_apart() -> None:
    twice = [Curve(X, X, "measured"), Curve(X, -X, "measured"), Curve(X, X)]
    found = rows(Panel(Axis("x"), Axis("y"), twice), Panel(Axis("x"), Axis("y"), twice))
    assert {row["panel"] for row in found} == {"1", "2"}
    assert {row["curve"] for row in found} == {"measured 1", "measured 2", "3"}
    assert len(found) == 18


def test_a_long_line_has_its_own_points_and_its_peaks() -> None:
    x = np.linspace(0, 1, 50_000)
    y = np.sin(40 * x)
    y[31_234] = 7.0
    found = rows(
        Panel(Axis("x"), Axis("y"), [Curve(x, y, "line"), Curve(x, y, "p", "p", "points")])
    )
    line = [row for row in found if row["curve"] == "line"]
    assert len(line) <= POINTS
    assert len(found) - len(line) == 50_000, "of points all are shown"
    assert max(column(line, "y")) == 7.0
    index = np.rint(np.array(column(line, "x")) * 49_999).astype(int)
    assert column(line, "y") == pytest.approx(list(y[index]), rel=1e-8)


def test_all_of_a_figure_is_in_its_file(made_up: ModuleType) -> None:
    figure = made_up.velocity_map(TestData("t", "t", {}, ())).figures[0]
    found = list(csv.DictReader(io.StringIO(figure_csv(figure))))
    pieces = [list(each) for _, each in groupby(found, lambda r: (r["panel"], r["curve"]))]
    curves = [curve for panel in figure.panels for curve in panel.curves]
    assert len(pieces) == len(curves) == 5
    for mine, curve in zip(pieces, curves, strict=True):
        assert column(mine, "x") == pytest.approx(list(np.degrees(curve.x)), rel=1e-8)
        told = "high" if curve.style == "band" else "y"
        assert column(mine, told) == pytest.approx(list(curve.y), rel=1e-8)


def test_hostile_names_stay_in_their_cells() -> None:
    hostile = 'a,"b"\nc=1'
    found = rows(Panel(Axis("x"), Axis("y"), [Curve(X, X, hostile)], hostile))
    assert [(row["panel"], row["curve"]) for row in found] == [(hostile, hostile)] * 3
