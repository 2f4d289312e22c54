"""What `--interactive` adds to a page: the drawn points, one script, and nothing to the others."""

from __future__ import annotations

import base64
import hashlib
import html
import json
import re
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from campaign.report.build import Report
from campaign.report.drawing import curves as drawing
from campaign.report.drawing.curves import drawn_points
from campaign.report.drawing.decimate import decimate, points_of_each
from campaign.report.drawing.figures import draw
from campaign.report.page import interactive as module
from campaign.report.page.folder import ShownFigure
from campaign.report.page.interactive import growing, zooms
from campaign.result import Axis, Curve, Figure, Mark, Panel

pytestmark = pytest.mark.usefixtures("drawings_kept")

VENDORED = {
    "uPlot.iife.min.js": "19c8d4c6ad88929a79f4ae49d6f7161566dfd0ba3d15cc495e974f787eb78f1f",
    "uPlot.min.css": "df630c6a8d6f8eeaff264b50f73ce5b114f646ffd9a0bb74f049b0a00135fa04",
}
AXIS = Axis("t", "s", "s")
SHOWN = ShownFigure(1, "figure-1", "Title", "c", "", "k.svg")


def figure(*curves: Curve) -> Figure:
    return Figure("k", "Title", "c", "a", (Panel(AXIS, Axis("rate", "rad/s", "deg/s"), curves),))


@pytest.fixture(scope="module")
def zoomed(made_up: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> str:
    folder = tmp_path_factory.mktemp("zoomed")
    report = made_up.build(made_up.made_up_run(folder), folder / "report", zoom=True)
    return report.path.read_text(encoding="utf-8")


@pytest.mark.slow
def test_quotes_of_the_data_stand_as_they_are_and_nothing_leaves_their_element(
    zoomed: str,
) -> None:
    (data,) = re.findall(r'<template id="interactive-data">(.*?)</template>', zoomed, re.DOTALL)
    assert data.startswith('{"figure-')
    assert not re.search(r"[<>]|&(?!lt;|gt;|amp;)", data)
    hostile = figure(Curve(np.arange(9.0), np.arange(9.0), "a </template><script>&quot;", "a"))
    (panel,) = module._figure(hostile, None)["panels"]
    assert panel["curves"][0]["label"] == "a </template><script>&quot;"
    shown = replace(SHOWN, anchor="figure-1", data=hostile)
    told = str(module.interactive([shown]).data)
    assert "<" not in told
    assert json.loads(html.unescape(told))["figure-1"]["panels"] == [panel]


def test_an_interval_has_both_of_its_ends_in_the_units_of_its_axis() -> None:
    curve = Curve(np.arange(9.0), np.arange(9.0), "a", "a")
    marks = (Mark("window", x=1.0, until=2.0), Mark("band", y=0.5, until=1.0), Mark("line", x=3.0))
    axes = Axis("t", "s", "ms"), Axis("rate", "rad/s", "deg/s")
    shown = Figure("k", "Title", "c", "a", (Panel(*axes, (curve,), marks=marks),))
    (panel,) = module._figure(shown, None)["panels"]
    band = {"y": np.rad2deg(0.5), "until": np.rad2deg(1.0)}
    assert panel["marks"] == [
        {"label": "window", "x": 1000.0, "until": 2000.0},
        {"label": "band", **{name: pytest.approx(value) for name, value in band.items()}},
        {"label": "line", "x": 3000.0},
    ]


def test_without_what_it_adds_the_page_is_the_static_one_to_the_byte(
    report: Report, zoomed: str
) -> None:
    static = report.path.read_text(encoding="utf-8")
    (script,) = re.findall("<script>(.*?)</script>", static, re.DOTALL)
    bare = re.sub(r"<template.*?</template>\n?", "", zoomed, flags=re.DOTALL)
    bare = re.sub(rf"({re.escape(script)}).*?</script>", r"\1</script>", bare, flags=re.DOTALL)
    allowed = 'script-src [^"]*'
    bare = re.sub(allowed, re.search(allowed, static)[0], bare)
    bare = re.sub(r"(</style>\n)<style>.*?</style>\n", r"\1", bare, flags=re.DOTALL)
    assert bare == static


@pytest.mark.parametrize("name", VENDORED)
def test_what_others_wrote_is_what_they_released(name: str) -> None:
    """uPlot 1.6.32."""
    raw = (Path(module.__file__).parent / "vendor" / name).read_bytes()
    assert hashlib.sha256(raw).hexdigest() == VENDORED[name]


def test_the_page_carries_the_points_of_the_drawing_as_float32(
    made_up: ModuleType, zoomed: str
) -> None:
    found = json.loads(html.unescape(re.search("<template[^>]*>(.*?)</template>", zoomed)[1]))
    _, errors = made_up.stabilization(None).figures
    carried = next(each for each in found.values() if len(each["panels"]) == 4)
    for panel, shown in zip(errors.panels, carried["panels"], strict=True):
        (curve,), (told,) = panel.curves, shown["curves"]
        x, y = (
            np.frombuffer(base64.b64decode(carried["arrays"][told[name]]), "<f4") for name in "xy"
        )
        expected_x, expected_y, _ = drawn_points(curve, panel, points_of_each(errors))
        np.testing.assert_array_equal(x, expected_x.astype(np.float32))
        np.testing.assert_array_equal(y, expected_y.astype(np.float32))
        assert shown["y"]["label"] == "Position error (mrad)"


def test_the_points_are_those_that_are_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """As few as the drawing has of each of its curves, and the same ones."""
    drawn = []

    def recorded(*given: object) -> tuple[np.ndarray, np.ndarray]:
        drawn.append(decimate(*given))
        return drawn[-1]

    monkeypatch.setattr(drawing, "decimate", recorded)
    t = np.linspace(0.0, 8.0, 40_000)
    noise = np.random.default_rng(1)
    curves = [Curve(t, noise.normal(size=len(t)), f"{n}", f"{n}") for n in range(20)]
    shown = figure(*curves)
    draw(shown)
    by_drawing = drawn[:]
    assert len(by_drawing) == 20
    for curve, (x, y) in zip(curves, by_drawing, strict=True):
        found = drawn_points(curve, shown.panels[0], points_of_each(shown))
        np.testing.assert_array_equal(found[0], x)
        np.testing.assert_array_equal(found[1], y)


def test_only_lines_that_go_from_left_to_right_zoom() -> None:
    x = np.linspace(0.0, 1.0, 50)
    line = Curve(x, x, "a", "none")
    assert zooms(figure(line))
    assert zooms(figure(line, replace(line, style="points", x=x[::-1])))
    assert not zooms(figure(line, replace(line, x=np.sin(7 * x))))  # a loop
    assert not zooms(figure(replace(line, style="points")))
    assert not zooms(figure(replace(line, x=x[:5], y=x[:5])))
    assert not zooms(replace(figure(line), panels=()))


def test_equal_places_go_up_by_one_unit_in_the_last_place() -> None:
    found = growing(np.array([0.0, 1.0, 1.0, 1.0 + 1e-12, 2.0]))
    unit = np.float32(2.0**-23)
    np.testing.assert_array_equal(found, np.float32([0.0, 1.0, 1.0 + unit, 1.0 + 2 * unit, 2.0]))
