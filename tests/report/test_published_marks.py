"""Published values stand beside the curves that they speak of, and nowhere else."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from matplotlib.lines import Line2D

from campaign.published.values import read_published
from campaign.report.drawing import figures
from campaign.report.drawing.published_marks import PublishedBeside, published_text
from campaign.report.page.drawings import _drawing
from campaign.report.palette import SERIES, looks
from campaign.result import Array, Axis, Curve, Figure, Panel

TABLES = """
source = "a book"
[[table]]
name = "1.1"
title = "Error over frequency"
quantity = "error"
unit = "mrad"
conditions = { acceleration = "18 deg/s^2" }
rows = { condition = "frequency", unit = "Hz" }
columns = { condition = "compensation", names = ["none", "lugre"] }
[table.cells]
"0.1" = [0.5, 0.2]
"0.4" = [0.9, 0.3]
[[table.mark]]
cells = ["0.4/lugre"]
status = "inconsistent"
reason = "printed twice"

[[table]]
name = "1.2"
title = "The same on a rig"
quantity = "error"
unit = "mrad"
conditions = { acceleration = "18 deg/s^2", frequency = "0.1 Hz", domain = "hardware" }
rows = { condition = "compensation" }
column.error = {}
[table.cells]
none = [0.7]

[[table]]
name = "1.4"
title = "A claim"
quantity = "error"
unit = "mrad"
conditions = { acceleration = "18 deg/s^2", compensation = "observer" }
columns = { condition = "frequency", unit = "Hz", names = ["0.1", "0.4"] }
row.number = {}
row.claim = { relation = "at least" }
[table.cells]
number = [0.5, ""]
claim = ["", 0.9]

[[table]]
name = "1.3"
title = "Parameters of a line"
columns = { condition = "direction", names = ["positive", "negative"] }
[table.row.slope]
quantity = "slope"
unit = "mN m/rad"
[table.row.level]
quantity = "level"
unit = "N m"
[table.cells]
slope = [2000, 3000]
level = [1, ""]
"""
BOOK = read_published(TABLES, "book.toml")
SHAKEN = {"acceleration": float(np.deg2rad(18.0)), "compensation": "none"}
X = np.array([0.1, 0.2, 0.4])


def line(x: Array, values: Mapping[str, float]) -> Array:
    return values["level"] + values["slope"] * x


def figure(curve: Curve) -> Figure:
    panel = Panel(Axis("Frequency", "Hz"), Axis("Error", "rad", "urad"), [curve])
    return Figure("key", "Title", "Caption.", "Alt.", (panel,))


def over_frequency(**conditions: object) -> Figure:
    curve = Curve(X, X, quantity="error", along="frequency", conditions={**SHAKEN, **conditions})  # type: ignore[arg-type]
    return figure(curve)


def beside(*tables: str, domain: str = "simulation") -> PublishedBeside:
    return PublishedBeside.of(BOOK, tables, {"domain": domain})


def test_hollow_marks_stand_at_the_published_numbers_and_places() -> None:
    (marks,) = beside("1.1").marks(over_frequency())[0, 0]
    assert marks.x == pytest.approx([0.1, 0.4])
    assert marks.y == pytest.approx([0.5e-3, 0.9e-3])
    assert not marks.joined
    assert not marks.doubtful


@pytest.mark.parametrize(
    "conditions",
    [
        {"acceleration": float(np.deg2rad(36.0))},
        {"acceleration": float(np.deg2rad(18.0 * 1.0011))},
        {"compensation": "static"},
        {"compensation": None},
    ],
)
def test_no_mark_stands_where_a_condition_differs(conditions: dict[str, object]) -> None:
    assert beside("1.1").marks(over_frequency(**conditions)) == {}


def test_a_condition_may_be_off_by_what_is_tolerated() -> None:
    near = float(np.deg2rad(18.0 * 1.0009))
    assert (0, 0) in beside("1.1").marks(over_frequency(acceleration=near))


def test_only_tables_that_the_test_stands_for_and_that_the_document_has() -> None:
    assert beside().marks(over_frequency()) == {}
    assert beside("9.9", "figure 1").marks(over_frequency()) == {}


@pytest.mark.parametrize(("domain", "places"), [("simulation", 0), ("hardware", 1)])
def test_numbers_of_a_rig_stand_beside_a_rig_only(domain: str, places: int) -> None:
    assert len(beside("1.2", domain=domain).marks(over_frequency())) == places


def test_what_contradicts_itself_is_apart() -> None:
    sound, doubtful = beside("1.1").marks(over_frequency(compensation="lugre"))[0, 0]
    assert (sound.y.tolist(), sound.doubtful) == ([pytest.approx(0.2e-3)], False)
    assert (doubtful.y.tolist(), doubtful.doubtful) == ([pytest.approx(0.3e-3)], True)


@pytest.mark.parametrize(("n", "places"), [(1, 1), (2, 0)])
def test_a_value_without_a_place_stands_beside_a_single_point(n: int, places: int) -> None:
    conditions = {**SHAKEN, "frequency": 0.1}
    curve = Curve(np.full(n, 7.0), X[:n], quantity="error", conditions=conditions)
    marks = beside("1.1").marks(figure(curve))
    assert len(marks) == places
    if marks:
        assert marks[0, 0][0].x.tolist() == [7.0]


def test_another_kind_of_unit_has_no_place_on_the_axis() -> None:
    curve = Curve(X, X, quantity="error", along="frequency", conditions=SHAKEN)
    panel = Panel(Axis("Frequency", "Hz"), Axis("Torque", "N m"), [curve])
    assert beside("1.1").marks(Figure("k", "T", "C", "A", (panel,))) == {}


def law(direction: str) -> Figure:
    units = {"slope": "N m/rad", "level": "N m"}
    return figure(Curve(X, X, conditions={"direction": direction}, law=line, parameters=units))


def test_published_parameters_are_a_curve_over_the_range_of_the_fit() -> None:
    (marks,) = beside("1.3").marks(law("positive"))[0, 0]
    assert marks.joined
    assert (marks.x[0], marks.x[-1]) == pytest.approx((0.1, 0.4))
    assert marks.y == pytest.approx(1.0 + 2.0 * marks.x)


def test_no_curve_is_drawn_where_a_parameter_is_missing() -> None:
    assert beside("1.3").marks(law("negative")) == {}


def test_the_caption_names_the_tables_of_each_sign() -> None:
    both = beside("1.1", "1.2", domain="hardware")
    assert published_text(both.marks(over_frequency())) == "Hollow: Tables 1.1, 1.2."
    assert published_text(both.marks(over_frequency(compensation="lugre"))) == (
        "Hollow: Table 1.1; pale what is inconsistent or not reproducible."
    )
    assert published_text(beside("1.3").marks(law("positive"))) == "Fine dotted line: Table 1.3."
    assert published_text({}) == ""


# As they are drawn, and on the page


def drawn(shown: Figure, found: PublishedBeside, monkeypatch: pytest.MonkeyPatch) -> Any:
    sheets: list[Any] = []
    original = figures.to_svg
    monkeypatch.setattr(figures, "to_svg", lambda sheet: (sheets.append(sheet), original(sheet))[1])
    figures.draw(shown, found.marks(shown))
    return sheets[0]


def test_hollow_marks_are_drawn_where_they_stand(monkeypatch: pytest.MonkeyPatch) -> None:
    sheet = drawn(over_frequency(), beside("1.1"), monkeypatch)
    (ax,) = sheet.axes
    hollow = [line for line in ax.lines if line.get_markerfacecolor() == "none"]
    (mark,) = hollow
    assert list(mark.get_xdata()) == pytest.approx([0.1, 0.4])
    assert list(mark.get_ydata()) == pytest.approx([500.0, 900.0])  # µrad
    assert ax.get_ylim()[1] > 900.0
    assert mark.get_color() == looks([""])[""].light
    assert [text.get_text() for text in sheet.legends[0].get_texts()] == ["published"]


def test_what_contradicts_itself_is_drawn_pale(monkeypatch: pytest.MonkeyPatch) -> None:
    sheet = drawn(over_frequency(compensation="lugre"), beside("1.1"), monkeypatch)
    hollow = [line for line in sheet.axes[0].lines if line.get_markerfacecolor() == "none"]
    assert [line.get_alpha() is not None for line in hollow] == [False, True]
    texts = [text.get_text() for text in sheet.legends[0].get_texts()]
    assert texts == ["published", "published, doubtful"]


def test_a_legend_shows_the_signs_of_each_series(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of two series whose hollow marks have different signs and colours."""
    curves = [
        Curve(X, X, series=name, quantity="error", along="frequency", conditions=told)
        for name in ("none", "lugre")
        for told in [{**SHAKEN, "compensation": name}]
    ]
    panel = Panel(Axis("Frequency", "Hz"), Axis("Error", "rad", "urad"), curves)
    shown = Figure("key", "Title", "Caption.", "Alt.", (panel,))
    sheet = drawn(shown, beside("1.1"), monkeypatch)
    signs = [
        (handle.get_marker(), handle.get_color())
        for handle in sheet.legends[0].findobj(Line2D)
        if handle.get_marker() != "None" and handle.get_alpha() is None
    ]
    assert signs == [(SERIES[name].marker, SERIES[name].light) for name in ("none", "lugre")]


def test_a_bound_has_an_arrow_and_a_number_none(monkeypatch: pytest.MonkeyPatch) -> None:
    sheet = drawn(over_frequency(compensation="observer"), beside("1.4"), monkeypatch)
    (ax,) = sheet.axes
    (arrow,) = ax.texts
    assert arrow.xy == pytest.approx((0.4, 900.0))
    assert arrow.get_position()[1] > 0, "upwards"
    assert ax.get_ylim()[1] > 1000.0, "room for it"
    marks = beside("1.4").marks(over_frequency(compensation="observer"))
    assert (
        published_text(marks) == "Hollow: Table 1.4. Hollow, with an arrow (at least): Table 1.4."
    )


def test_the_page_says_beside_a_figure_what_its_hollow_marks_are() -> None:
    plain, compared = (
        _drawing(over_frequency(), each, looks([""])) for each in (beside(), beside("1.1"))
    )
    assert plain.figure.caption == "Caption."
    assert compared.figure.caption == "Caption. Hollow: Table 1.1."
    assert ">published<" in compared.svg()
    assert ">published<" not in plain.svg()
