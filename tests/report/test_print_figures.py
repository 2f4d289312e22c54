"""Every figure can go into a paper as it is, in both widths; each check of that can fail."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.lines import Line2D

from campaign.archive.reading.open_run import open_run
from campaign.estimate import Estimate
from campaign.experiments import experiments
from campaign.report.content.document import document_of
from campaign.report.drawing.figures import Column, draw_sheet
from campaign.report.page.drawings import drawings_of
from campaign.report.palette import SERIES, looks
from campaign.result import Axis, Curve, Figure, Finding, Mark, Panel
from tests.report.print_checks import problems, told_apart

PROTOCOLS = Path(__file__).parents[2] / "protocols"
USUAL = ("quickstart",)
LONG = ("compensator_data", "draws", "presliding_multisine", "stick_slip_map", "thesis")
"""They take minutes; but for two figures of multisines and one map, others draw what they draw."""
COLUMNS: tuple[Column, ...] = ("single", "double")
X = np.linspace(0.1, 5.0, 60)
SINE = Curve(X, np.sin(X), "sine", "measured")


def of_panel(*curves: Curve, **more: object) -> Figure:
    axes = {"x": Axis("Time", "s"), "y": Axis("Torque", "N m")}
    return Figure("key", "Title", "Caption.", "Alt.", (Panel(curves=curves, **(axes | more)),))


def several(count: int, **more: object) -> Figure:
    """Panels with long titles, marks and names."""
    levels = [Mark("level of the friction", y=0.2)] if count <= 6 else []
    (panel,) = of_panel(SINE, Curve(X, np.cos(X), "cosine", "fit")).panels
    panels = tuple(
        replace(
            panel,
            title=f"disturbance observer number {k}: 0.49 deg/s off" if levels else f"observer {k}",
            marks=[*levels, Mark("least", x=3.0, y=0.4, point=True)],
        )
        for k in range(count)
    )
    return Figure("key", "Title", "Caption.", "Alt.", panels, **more)


@pytest.mark.slow
@pytest.mark.parametrize("column", COLUMNS)
@pytest.mark.parametrize("count", [1, 3, 6, 12])
@pytest.mark.parametrize("across", [1, 2, 3])
def test_panels_with_long_titles_fit_on_a_page(count: int, across: int, column: Column) -> None:
    assert problems(several(count, across=across), column) == []


@pytest.mark.parametrize("column", COLUMNS)
@pytest.mark.parametrize("scale", ["linear", "log"])
def test_named_places_fit_and_are_low(column: Column, scale: str) -> None:
    names = ("none", "σ0\nnot reached", "disturbance observer", "a method of a plug-in", "LuGre")
    axis = Axis("Compensation", limits=(-0.5, 4.5), places=tuple(enumerate(map(str, names))))
    dots = [
        Curve(np.array([k + 0.0]), np.array([1.0 + k]), "", name, "points")
        for k, name in enumerate(names)
    ]
    y = Axis("Error (1σ)", "rad", scale=scale, limits=(0.0, np.nan) if scale == "linear" else None)
    assert problems(of_panel(*dots, x=axis, y=y), column) == []


@pytest.mark.parametrize("column", COLUMNS)
@pytest.mark.parametrize("across", [1, 2, 3])
def test_large_decades_do_not_run_together(across: int, column: Column) -> None:
    wide = np.geomspace(60.0, 7e5, 60)
    curve = Curve(wide, np.sin(X), "sine", "measured")
    (panel,) = of_panel(curve, x=Axis("Stiffness", "N m/rad", scale="log")).panels
    panels = [replace(panel, title=str(k)) for k in range(3)]
    assert problems(Figure("key", "T", "C.", "A.", panels, across=across), column) == []


def finding(value: float) -> Finding:
    known = Estimate("torque", value, "N m", low=value - 1.0, high=value + 1.0)
    return Finding.of(known, {})


@pytest.mark.parametrize(
    ("figure", "said"),
    [
        (of_panel(replace(SINE, y=np.full(60, np.nan))), "empty"),
        (of_panel(SINE, y=Axis("Torque", "N m", limits=(-60.0, 60.0))), "of its height"),
        (of_panel(SINE, y=Axis("Torque", "N m", limits=(5.0, 60.0))), "in view"),
        (of_panel(SINE, marks=[Mark("", x=2.0)]), "a mark without a name"),
        (of_panel(replace(SINE, label=""), Curve(X, X, "", "fit")), "without a name"),
        (of_panel(SINE, Curve(X, X, "line", "measured")), "look alike"),
        (of_panel(replace(SINE, quantity="torque", y=X)), "in the table alone"),
        (replace(several(2), panels=2 * several(1).panels), "(b) repeats (a)"),
        (of_panel(replace(SINE, label="t" * 90)), "leaves the sheet"),
        (of_panel(SINE, x=Axis("t", places=((1.0, "a long name"), (1.1, "too near")))), "overlaps"),
        (of_panel(SINE, x=Axis("t", places=((1.0, "a name"), (1.62, "near")))), "runs into"),
    ],
    ids=lambda each: each if isinstance(each, str) else "",
)
def test_what_is_wrong_is_noticed(figure: Figure, said: str) -> None:
    found = problems(figure, "single", findings=[finding(X[3])])
    assert [each for each in found if said in each], found


@pytest.mark.parametrize("own", SERIES)
def test_series_of_a_panel_are_told_apart_in_grey_and_by_every_eye(own: str) -> None:
    """`none` and `measured`, both solid, are in no panel together, as the last test holds."""
    drawn = [name for name in SERIES if {own, name} != {"none", "measured"}]
    chosen = looks([own, *drawn, *(f"series {k}" for k in range(6))])
    curves = {name: Curve(X, X, name, name) for name in chosen}
    alike = [
        name for name in chosen if name != own if not told_apart(curves[own], curves[name], chosen)
    ]
    assert alike == []


def test_colours_alone_do_not_tell_curves_apart() -> None:
    """Blue and red of one lightness are not, in grey; a paler red is."""
    one = replace(SERIES["lugre"], dash=())
    chosen = {"a": one, "b": replace(one, light="#b3202c"), "c": replace(one, light="#f0a0a0")}
    a, b, c = (Curve(X, X, name, name) for name in "abc")
    assert not told_apart(a, b, chosen)
    assert told_apart(a, c, chosen)


def test_a_legend_shows_all_that_a_series_looks_like() -> None:
    dots = replace(SINE, style="points")
    panels = (of_panel(SINE).panels[0], of_panel(dots).panels[0])
    (legend,) = draw_sheet(replace(several(1), panels=panels)).legends
    assert [text.get_text() for text in legend.get_texts()] == ["sine"]
    signs = {(sign.get_linestyle(), sign.get_marker()) for sign in legend.findobj(Line2D)}
    assert signs == {("-", "None"), ("None", "o")}


def test_numbers_of_named_places_are_bars_where_their_axis_begins_at_zero() -> None:
    places = Axis("Method", places=((0.0, "none"), (1.0, "static")))
    dots = Curve(np.array([0.0, 1.0]), np.array([0.7, 0.4]), "", "none", "points")
    for limits, heights in (((0.0, np.nan), [0.7, 0.4]), (None, [])):
        y = Axis("Error", "rad", limits=limits)
        (ax,) = draw_sheet(of_panel(dots, x=places, y=y)).axes
        assert [bar.get_height() for bar in ax.patches] == heights


def test_panels_one_below_the_other_name_a_common_axis_once() -> None:
    labels = [ax.get_xlabel() for ax in draw_sheet(several(3)).axes]
    assert labels == ["", "", "Time (s)"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "protocol",
    [
        *USUAL,
        *(
            pytest.param(path.stem, marks=pytest.mark.statistics)
            for path in sorted(PROTOCOLS.glob("*.toml"))
            if path.stem not in {*USUAL, *LONG}
        ),
    ],
)
def test_every_figure_of_a_shipped_protocol_can_be_printed(protocol: str, tmp_path: Path) -> None:
    subprocess.run(
        [sys.executable, "-m", "campaign", "run", protocol, "--results", str(tmp_path), "--yes"],
        check=True,
        capture_output=True,
    )
    (path,) = tmp_path.glob("*.nxs")
    document = document_of(open_run(path), experiments())
    findings = {test.name: test.result.findings for test in document.tests}
    drawings = drawings_of(document.tests, document.published)
    assert drawings
    wrong = {
        (name, key, column): found
        for (name, key), each in drawings.items()
        for column in COLUMNS
        if (found := problems(each.figure, column, each.marks, each.looks, findings[name]))
    }
    assert wrong == {}
