"""Decimation, colours and the SVG documents."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
import pytest

from campaign.report.content.tables import show, table_csv
from campaign.report.drawing import figures
from campaign.report.drawing.canvas import inline
from campaign.report.drawing.curves import DENSE
from campaign.report.drawing.decimate import decimate
from campaign.report.drawing.figures import draw, pretty_unit
from campaign.report.palette import (
    INK,
    MUTED,
    OTHERS,
    PAPER,
    SERIES,
    STATUS,
    looks,
    looks_of_page,
    variables,
)
from campaign.result import Axis, Column, Curve, Figure, Mark, Panel, Table
from campaign.text import number, percent
from tests.report.print_checks import DEFICIENCIES, contrast, lab

TIME = Axis("Time", "s", "ms")


def figure(*curves: Curve, y: Axis | None = None, **more: object) -> Figure:
    panel = Panel(TIME, y or Axis("Error", "rad", "mrad"), curves, **more)
    return Figure("key", "Title", "Caption.", "What it shows.", (panel,))


def texts(svg: str) -> list[str]:
    return [e.text or "" for e in ET.fromstring(svg).iter("{http://www.w3.org/2000/svg}text")]


# --- decimation -----------------------------------------------------------------------------


def test_a_short_line_is_left_alone() -> None:
    x = np.arange(10.0)
    assert np.array_equal(decimate(x, x, 10)[0], x)


@pytest.mark.parametrize("points", [3000, 100, 4])
def test_a_long_line_keeps_its_ends_and_its_only_spike(points: int) -> None:
    x = np.linspace(0, 1, 100_003)
    y = np.zeros_like(x)
    y[77_777], y[12_345] = 1.0, -2.0
    few_x, few_y = decimate(x, y, points)
    assert len(few_x) <= points
    assert (few_x[0], few_x[-1]) == (0, 1)
    assert (few_y.max(), few_y.min()) == (1.0, -2.0)
    assert set(zip(few_x, few_y, strict=True)) <= set(zip(x, y, strict=True))
    assert (np.diff(few_x) > 0).all()


def test_a_gap_stays_a_gap() -> None:
    y = np.sin(np.arange(50_000.0))
    y[20_000:30_000] = np.nan
    few_x, few_y = decimate(np.arange(50_000.0), y, 400)
    holes = few_x[np.isnan(few_y)]
    assert holes.min() >= 20_000
    assert holes.max() < 30_000
    assert np.isfinite(few_y[few_x < 20_000]).all()


def test_a_loop_keeps_its_extremes_in_both_directions() -> None:
    angle = np.linspace(0, 40 * np.pi, 60_000)
    x, y = decimate(np.cos(angle), np.sin(angle), 1000)
    assert np.ptp(x) == pytest.approx(2, abs=1e-6)
    assert np.ptp(y) == pytest.approx(2, abs=1e-6)


# --- colours --------------------------------------------------------------------------------


def test_contrast_is_that_of_the_wcag() -> None:
    assert contrast("#000000", "#ffffff") == pytest.approx(21)
    assert contrast("#777777", "#ffffff") == pytest.approx(4.48, abs=0.005)


@pytest.mark.parametrize("look", [*SERIES.values(), *OTHERS[:8]], ids=lambda look: look.name)
def test_lines_stand_out_on_light_and_dark(look) -> None:
    assert contrast(look.light, PAPER.light) >= 3
    assert contrast(look.dark, PAPER.dark) >= 3


@pytest.mark.parametrize("look", [INK, MUTED, *STATUS.values()], ids=lambda look: look.name)
def test_text_is_readable_on_light_and_dark(look) -> None:
    assert contrast(look.light, PAPER.light) >= 4.5
    assert contrast(look.dark, PAPER.dark) >= 4.5


@pytest.mark.parametrize("deficiency", DEFICIENCIES)
@pytest.mark.parametrize("shade", ["light", "dark"])
def test_the_four_methods_differ_to_every_eye(deficiency: str, shade: str) -> None:
    matrix = DEFICIENCIES[deficiency]
    for a, b in combinations(("none", "static", "lugre", "observer"), 2):
        one, other = getattr(SERIES[a], shade), getattr(SERIES[b], shade)
        difference = np.linalg.norm(lab(one, matrix) - lab(other, matrix))
        dashed = SERIES[a].dash != SERIES[b].dash
        assert difference > (12 if dashed else 20), (a, b)


@pytest.mark.parametrize("deficiency", DEFICIENCIES)
@pytest.mark.parametrize("shade", ["light", "dark"])
def test_the_first_five_series_without_a_look_of_their_own_differ_to_every_eye(
    deficiency: str, shade: str
) -> None:
    matrix = DEFICIENCIES[deficiency]
    seen = [lab(getattr(look, shade), matrix) for look in OTHERS[:5]]
    least = min(np.linalg.norm(one - other) for one, other in combinations(seen, 2))
    assert least > (30 if deficiency == "normal" else 10)
    assert len({look.dash for look in OTHERS[:5]}) == 5


def test_every_status_has_its_own_shape() -> None:
    markers = [look.marker for look in STATUS.values()]
    assert len(set(markers)) == len(markers)


def test_a_series_looks_the_same_whatever_is_beside_it() -> None:
    assert looks(["lugre"])["lugre"] is looks(["x", "y", "lugre"])["lugre"] is SERIES["lugre"]
    assert looks(["b", "a"]) == {"b": OTHERS[0], "a": OTHERS[1]}


def test_a_series_keeps_its_look_through_a_page() -> None:
    figures = [["lugre", "set 1"], ["set 2", "set 1", "positive"], ["loop"], ["set 2", "loop"]]
    chosen = looks_of_page(figures)
    assert set(chosen) == {name for names in figures for name in names}
    assert chosen == looks_of_page([list(names) for names in figures])
    assert (chosen["lugre"], chosen["positive"]) == (SERIES["lugre"], SERIES["positive"])
    for names in figures:
        assert len({chosen[name].light for name in names}) == len(names)
        assert len({chosen[name].dash for name in names}) == len(names)


@pytest.mark.parametrize("count", [2, 8, 60])
def test_series_of_one_figure_differ_by_dash_or_mark(count: int) -> None:
    chosen = looks([f"series {k}" for k in range(count)])
    assert len({(look.dash, look.marker) for look in chosen.values()}) == count


def test_what_the_program_draws_differs_by_dash_or_mark() -> None:
    every = [*SERIES.values()]
    assert len({(look.dash, look.marker) for look in every}) == len(every)
    lines = [look.dash for name, look in SERIES.items() if name != "none"]  # or "measured"
    assert len(set(lines)) == len(lines)
    assert len({look.marker for look in every}) == len(every)
    assert len({(look.dash, look.marker) for look in OTHERS}) == len(OTHERS)


def test_more_series_than_looks_are_drawn_all_the_same() -> None:
    assert len(looks([f"series {k}" for k in range(200)])) == 200


@pytest.mark.parametrize("deficiency", DEFICIENCIES)
@pytest.mark.parametrize("shade", ["light", "dark"])
def test_the_two_directions_differ_to_every_eye(deficiency: str, shade: str) -> None:
    one, other = (getattr(SERIES[name], shade) for name in ("positive", "negative"))
    matrix = DEFICIENCIES[deficiency]
    assert np.linalg.norm(lab(one, matrix) - lab(other, matrix)) > 20


def test_a_light_colour_has_one_dark_one() -> None:
    pairs = set(variables().values())
    assert len({light for light, _ in pairs}) == len(pairs)


# --- figures --------------------------------------------------------------------------------


def test_axes_are_in_display_units_and_named_with_them() -> None:
    x = np.linspace(0, 0.008, 9)
    svg = draw(figure(Curve(x, x, "line", "none")))
    assert "Time (ms)" in texts(svg)
    assert "Error (mrad)" in texts(svg)
    assert "8" in texts(svg)


def test_the_same_figure_is_the_same_bytes() -> None:
    x = np.linspace(0, 1, 10_000)
    one = figure(Curve(x, np.sin(50 * x), "a", "none"), Curve(x, x, "b", "odd one"))
    assert draw(one) == draw(one)


def test_names_are_names_whatever_signs_are_in_them() -> None:
    x = np.arange(3.0)
    svg = draw(figure(Curve(x, x, "$\\frac{<script>&", "odd"), title="50 % of $x"))
    assert "$\\frac{<script>&" in texts(svg)
    assert "50 % of $x" in texts(svg)


@pytest.mark.parametrize(
    "curves",
    [
        (),
        (Curve(np.empty(0), np.empty(0), "empty", "none"),),
        (Curve(np.arange(3.0), np.full(3, np.nan), "nan", "none"),),
        (Curve(np.arange(3.0), np.full(3, np.inf), "infinite", "none", "points"),),
        (Curve(np.full(3, np.nan), np.arange(3.0), "no time", "none", "line+points"),),
        (Curve(np.arange(3.0), -np.ones(3), "negative", "none", "band", -2 * np.ones(3)),),
    ],
)
@pytest.mark.parametrize("scale", ["linear", "log"])
def test_a_figure_without_data_says_so(curves: tuple[Curve, ...], scale: str) -> None:
    y = Axis("Error", "rad", "mrad", scale, limits=None)
    shown = texts(draw(figure(*curves, y=y, marks=[Mark("here", x=1.0), Mark("nan", y=np.nan)])))
    drawable = any(c.label == "negative" for c in curves) and scale == "linear"
    assert ("no data" in shown) is not drawable


def test_rounding_errors_are_not_blown_up() -> None:
    x, noise = np.arange(3.0), np.array([0.0, 1e-9, -1e-9])
    shown = texts(draw(figure(Curve(x, 1e-3 * (18 + noise), "flat", "measured", "points"))))
    assert "18.0" in shown
    assert max(len(text) for text in shown if text[:2] == "18") <= 5


def test_many_long_curves_do_not_outweigh_the_page() -> None:
    x = np.linspace(0, 1, 5_000)
    curves = [Curve(x, np.sin(90 * x + i), "", f"run {i}", "thin") for i in range(120)]
    assert len(draw(figure(*curves))) < 2_000_000


def test_a_dense_scatter_becomes_an_image() -> None:
    x = np.linspace(0, 1, DENSE + 1)
    assert "<image" in draw(figure(Curve(x, x, "dense", "measured", "points")))
    assert "<image" not in draw(figure(Curve(x[:-1], x[:-1], "thin", "measured", "points")))


def test_figures_in_one_page_share_no_ids_and_keep_their_links() -> None:
    x = np.linspace(0, 1, 9)
    svg = draw(figure(Curve(x, x, "a", "none", "line+points")))
    one, two = (inline(svg, prefix, "Title <1>", 'Alt "2"') for prefix in ("f1", "f2"))
    ids = [set(re.findall(r'\bid="([^"]+)"', text)) for text in (one, two)]
    assert not ids[0] & ids[1]
    links = set(re.findall(r'href="#([^"]+)"', one)) | set(re.findall(r"url\(#([^)]+)\)", one))
    assert links
    assert links <= ids[0]
    root = ET.fromstring(
        one.replace("<svg ", '<svg xmlns:xlink="http://www.w3.org/1999/xlink" ', 1)
    )
    assert [child.text for child in root[:2]] == ["Title <1>", 'Alt "2"']
    names = re.findall(rf"var\(--([\w-]+), {SERIES['none'].light}\)", one)
    assert {variables()[name][1] for name in names} == {SERIES["none"].dark}


# --- tables and numbers ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (0.48841, "0.4884"),
        (0.24, "0.24"),
        (26.0, "26"),
        (0.000595, "0.000595"),
        (1.23456e-7, "1.235 × 10⁻⁷"),
        (-4.0712, "−4.071"),
        (159176.4, "159176"),
        (12345678901.0, "1.235 × 10¹⁰"),
        (0.0, "0"),
        (float("nan"), "–"),
        (float("inf"), "–"),
        (9.99996, "10.00"),
    ],
)
def test_numbers_for_people(value: float, shown: str) -> None:
    assert number(value) == shown


@pytest.mark.parametrize(
    ("value", "shown"),
    [(0.8278, "+0.83 %"), (-12.34, "−12.3 %"), (150.2, "+150 %"), (1e-9, "0.00 %"), (None, "–")],
)
def test_deviations_for_people(value: float | None, shown: str) -> None:
    assert percent(value) == shown


def test_units_for_people() -> None:
    assert [pretty_unit(u) for u in ("N m s/rad", "urad", "uN m", "deg/s^2", "deg", "percent")] == [
        "N·m·s/rad",
        "µrad",
        "µN·m",
        "deg/s²",
        "°",
        "%",
    ]


TABLE = Table(
    "key",
    "Title",
    (
        Column("method", "Method"),
        Column("error", "Error", "rad", "mrad"),
        Column("rate", "Rate", "rad/s", "deg/s"),
        Column("met", "Met"),
        Column("n", "Count"),
    ),
    (
        {"method": "a,b", "error": 0.00048841234, "rate": np.pi, "met": True, "n": 3},
        {"method": None, "error": float("nan"), "met": False},
    ),
)


def test_a_csv_file_has_all_digits_and_names_its_units() -> None:
    lines = table_csv(TABLE).splitlines()
    assert lines[0] == "method,error_mrad,rate_deg_per_s,met,n"
    name, error, rate, met, count = lines[1].rsplit(",", 4)
    assert (name, met, count) == ('"a,b"', "true", "3")
    assert float(error) == pytest.approx(0.48841234, rel=1e-15)
    assert float(rate) == pytest.approx(180)
    assert lines[2] == ",nan,,false,"


def test_a_table_on_the_page_is_rounded_and_bounded() -> None:
    shown = show(TABLE)
    assert shown.headers == ("Method", "Error (mrad)", "Rate (deg/s)", "Met", "Count")
    assert [cell.text for cell in shown.rows[0]] == ["a,b", "0.4884", "180", "yes", "3"]
    assert [cell.text for cell in shown.rows[1]] == ["–", "–", "–", "no", "–"]
    long = Table("k", "t", (Column("n", "N"),), tuple({"n": i} for i in range(5000)))
    assert (len(show(long).rows), show(long).left_out) == (300, 4700)


def test_a_legend_has_as_many_columns_as_fit_and_reads_by_rows() -> None:
    x = np.arange(3.0)
    names = ["a", "b", "c", "d", "a rather long name of a series that takes half of the width", "e"]
    svg = draw(figure(*(Curve(x, x + k, name, name) for k, name in enumerate(names))))
    root = ET.fromstring(svg)
    at = {
        e.text: [float(n) for n in re.findall(r"-?[\d.]+", e.get("transform", ""))][-2:]
        for e in root.iter("{http://www.w3.org/2000/svg}text")
        if e.text in names
    }
    rows = sorted(names, key=lambda name: (round(at[name][1]), at[name][0]))
    assert rows == names


def limits_of(shown: Figure, monkeypatch: pytest.MonkeyPatch) -> list[tuple[float, float]]:
    found: list[Any] = []
    original = figures.to_svg
    monkeypatch.setattr(figures, "to_svg", lambda sheet: (found.append(sheet), original(sheet))[1])
    draw(shown)
    return [tuple(ax.get_ylim()) for ax in found[0].axes]


def test_one_scale_is_for_axes_that_are_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    x = np.arange(3.0)
    error, rate = Axis("Error", "rad"), Axis("Rate", "rad/s")
    panels = tuple(
        Panel(Axis("Time", "s"), axis, [Curve(x, top * x, "a", "a")])
        for axis, top in ((error, 1.0), (error, 3.0), (rate, 9.0))
    )
    apart = Figure("key", "Title", "Caption.", "Alt.", panels)
    first, second, third = limits_of(replace(apart, one_scale=True), monkeypatch)
    assert first == second
    assert first[0] <= 0 < 6 <= first[1] < third[1]
    own = limits_of(apart, monkeypatch)
    assert own[0][1] < own[1][1] == second[1]


@pytest.mark.parametrize("scale", ["linear", "log"])
def test_a_bound_has_an_arrow_with_room(scale: str, monkeypatch: pytest.MonkeyPatch) -> None:
    x, y = np.array([1.0, 2.0]), np.array([1.0, 4.0])
    axis = Axis("Change", scale=scale)  # type: ignore[arg-type]
    low, high = np.array([0.9, np.nan]), np.array([1.1, np.inf])
    bound = Curve(x, y, "a", "a", "points", low=low, high=high)
    known = replace(bound, high=np.array([1.1, np.nan]))
    shown = [
        Figure("key", "Title", "Caption.", "Alt.", (Panel(Axis("x"), axis, [curve]),))
        for curve in (bound, known)
    ]
    ((_, above),), ((_, without),) = (limits_of(each, monkeypatch) for each in shown)
    assert above > without > 4.0
    with_arrow, plain = (draw(each) for each in shown)
    assert with_arrow.count("<path") > plain.count("<path")


@pytest.mark.parametrize(
    ("span", "step"), [(24.0, 5.0), (50.0, 10.0), (95.0, 15.0), (200.0, 30.0), (300.0, 45.0)]
)
def test_degrees_are_counted_in_parts_of_a_turn(
    span: float, step: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    found: list[Any] = []
    original = figures.to_svg
    monkeypatch.setattr(figures, "to_svg", lambda sheet: (found.append(sheet), original(sheet))[1])
    phase = Axis("Phase", "deg", limits=(0.0, span))
    x = np.arange(3.0)
    draw(Figure("k", "T", "C.", "A.", (Panel(Axis("x"), phase, [Curve(x, x)]),)))
    ticks = found[0].axes[0].get_yticks()
    assert np.unique(np.round(np.diff(ticks), 9)).tolist() == [step]


def test_named_places_stand_where_they_are() -> None:
    axis = Axis("Map", "rad", "deg", places=((0.0, "first"), (1.0, "second"), (2.0, "mean")))
    panel = Panel(axis, Axis("Torque"), [Curve(np.arange(3.0), np.arange(3.0), "a", "a", "points")])
    shown = texts(draw(Figure("k", "T", "C", "A", (panel,))))
    assert {"first", "second", "mean"} <= set(shown)
    assert "57.3" not in shown
