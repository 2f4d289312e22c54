"""What drawing costs is done once: the picture, the renderer, the thinning out of lines."""

from itertools import pairwise

import matplotlib.backends.backend_svg as backend
import numpy as np
import pytest
from matplotlib.figure import Figure as Canvas

from campaign.report.drawing.cached_axes import settled
from campaign.report.drawing.canvas import canvas
from campaign.report.drawing.decimate import kept
from campaign.report.drawing.figures import draw
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
    draw(marked())  # what measures is made for the first of all sheets
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
    assert len(begun) == 1  # which writes


@pytest.mark.slow
def test_axes_are_asked_again_when_they_may_move() -> None:
    with canvas(4.0, 3.0) as sheet:
        ax = sheet.subplots()
        ax.set_ylim(0.0, 1.0)
        with settled([ax]):
            assert len(ax.yaxis._update_ticks()) > 2
        ax.set_ylim(40.0, 60.0)
        with settled([ax]):
            places = [tick.get_loc() for tick in ax.yaxis._update_ticks()]
        assert len(places) > 2
        assert min(places) >= 40.0


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
