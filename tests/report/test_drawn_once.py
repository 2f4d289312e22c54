"""What drawing costs is done once: the picture, the renderer, the thinning out of lines."""

import gc
from itertools import pairwise

import matplotlib.backends.backend_svg as backend
import numpy as np
import pytest
from matplotlib.figure import Figure as Canvas

from campaign.report.drawing.decimate import kept
from campaign.report.drawing.figures import draw
from campaign.report.processes import seldom_collecting
from campaign.result import Axis, Curve, Figure, Mark, Panel

X, Y = Axis("x", "s"), Axis("y", "rad")


def marked() -> Figure:
    """With labels over its axes, beside them and at dots, which take more than one layout."""
    t = np.linspace(0.0, 1.0, 50)
    marks = (
        Mark("a line", x=0.5),
        Mark("a level", y=0.2),
        Mark("a dot", x=0.3, y=0.9, point=True),
    )
    panel = Panel(X, Y, (Curve(t, t**2, "square"), Curve(t, t, "straight")), "a panel", marks=marks)
    return Figure("key", "A title", "a caption", "what it shows", (panel,))


def test_a_figure_is_drawn_once(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn, begun = [], []
    whole, begin = Canvas.draw, backend.RendererSVG.__init__

    def counted(self, renderer):
        drawn.append(renderer)
        return whole(self, renderer)

    def counting(self, *args, **kwargs):
        begun.append(self)
        begin(self, *args, **kwargs)

    monkeypatch.setattr(Canvas, "draw", counted)
    monkeypatch.setattr(backend.RendererSVG, "__init__", counting)
    assert "a dot" in draw(marked())
    assert len(drawn) == 1
    assert len(begun) == 2  # one that measures, and one that writes


def slowly_kept(x, y, points):
    """As `kept` says it, stretch by stretch."""
    places = []
    edges = np.linspace(0, len(x), max(points // 4, 1) + 1).astype(int)
    for start, stop in pairwise(edges):
        finite = [k for k in range(start, stop) if np.isfinite(x[k]) and np.isfinite(y[k])]
        for values in (x, y):
            places.append(min(finite, key=lambda k: values[k], default=start))
            places.append(max(finite, key=lambda k: values[k], default=start))
    return sorted(set(places))


@pytest.mark.parametrize("points", [1, 8, 100, 499])
def test_each_stretch_keeps_the_first_of_its_extremes(points: int) -> None:
    random = np.random.default_rng(points)
    x, y = np.round(random.normal(size=(2, 2000)), 1)  # many are equal
    x[random.random(2000) < 0.2] = np.nan
    y[random.random(2000) < 0.2] = np.inf
    y[700:1100] = -np.inf
    assert kept(x, y, points).tolist() == slowly_kept(x, y, points)


def test_garbage_is_looked_for_as_before_when_the_report_is_done() -> None:
    before = gc.get_threshold()
    within: list[tuple[int, int, int]] = []

    @seldom_collecting()
    def fail() -> None:
        within.append(gc.get_threshold())
        raise KeyError

    with pytest.raises(KeyError):
        fail()
    assert within[0] > before
    assert gc.get_threshold() == before
