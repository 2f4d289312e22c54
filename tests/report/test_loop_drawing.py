"""Axes with an open end, the drift of the checks, and the strips of draws as pictures."""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET
from types import SimpleNamespace

import numpy as np
import pytest

from campaign.report.content.drift import Drift, drift_figure
from campaign.report.drawing.figures import draw
from campaign.report.drawing.strips import draw_strips
from campaign.result import Axis, Curve, Figure, Panel
from tests.report.test_strips import board

SVG = "{http://www.w3.org/2000/svg}"


def texts(svg: str) -> list[str]:
    return [e.text or "" for e in ET.fromstring(svg).iter(f"{SVG}text")]


def ticks(limits: tuple[float, float] | None) -> list[float]:
    """Labelled values of the y axis of points at 40 and 50."""
    curve = Curve(np.arange(2.0), np.array([40.0, 50.0]), "", "measured", "points")
    named = Axis("x", places=((0.0, "a"), (1.0, "b")))
    panel = Panel(named, Axis("y", limits=limits), [curve])
    shown = texts(draw(Figure("k", "t", "c", "a", (panel,))))
    return [float(word) for word in shown if re.fullmatch(r"[\d.]+", word)]


@pytest.mark.parametrize("end", [math.nan, math.inf])
def test_an_open_end_follows_from_what_is_drawn(end: float) -> None:
    assert min(ticks(None)) >= 39
    zero_based = ticks((0.0, end))
    assert min(zero_based) == 0
    assert 40 < max(zero_based) < 80
    assert max(ticks((0.0, 100.0))) == 100


def drift(rms: tuple[float, ...]) -> Drift:
    trials = tuple(
        SimpleNamespace(trial=SimpleNamespace(number=number))
        for number in range(3, 3 + 10 * len(rms), 10)
    )
    return Drift("sea", "Pointing error", "rad", "mrad", trials, rms)  # type: ignore[arg-type]


def test_the_drift_says_which_check_is_farthest_off() -> None:
    figure = drift_figure(drift((2.0, 2.02, 1.9)))
    assert "the largest, -5 %, is trial 23" in figure.caption
    assert figure.trials == (3, 13, 23)
    (curve,) = figure.panels[0].curves
    np.testing.assert_allclose(curve.y, [0.0, 0.01, -0.05])


@pytest.mark.parametrize("rms", [(2.0, 2.0), (0.0, 0.0)])
def test_where_nothing_changed_no_largest_change_is_told(rms: tuple[float, ...]) -> None:
    assert "the largest" not in drift_figure(drift(rms)).caption


def test_strips_say_what_is_what() -> None:
    shown = texts(draw_strips(board(10)) or "")
    assert {"a draw", "median", "95 % of further draws", "published", "draws below"} <= set(shown)
