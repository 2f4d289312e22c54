"""The scoreboard's picture: fits a screen, says which cell is which, and shows what was found."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from functools import cache

import pytest

from campaign.published.evidence import Evidence
from campaign.published.scoreboard import Scoreboard, score
from campaign.published.values import read_published
from campaign.report.drawing.scoreboard_picture import draw_overview
from campaign.result import Finding

SHEET = 768.0
"""Pixels of a figure on a page 1440 pixels wide."""
SVG = "{http://www.w3.org/2000/svg}"


def board(
    sizes: list[int], off: dict[str, float] | None = None, marked: str = "none"
) -> Scoreboard:
    """Tables of so many cells, of 10 each; found is 10.1, or what `off` says of `table/row`.

    The row `marked` is not reproducible, by the document.
    """
    document, findings = ['source = "made up"'], []
    for table, size in enumerate(sizes, start=1):
        rows = "\n".join(f"r{row} = [10.0]" for row in range(size))
        document.append(
            f'[[table]]\nname = "{table}.1"\ntitle = "T"\nquantity = "q{table}"\nunit = "N m"\n'
            f'decimals = 1\nrows = {{ condition = "row" }}\ncolumn.value = {{}}\n'
            f"[table.cells]\n{rows}"
        )
        if marked in rows:
            document.append(
                f'[[table.mark]]\ncells = ["{marked}/*"]\nstatus = "not reproducible"\nreason = "x"'
            )
        for row in range(size):
            value = (off or {}).get(f"{table}.1/r{row}", 10.1)
            findings.append(Finding(f"q{table}", value, "N m", {"row": f"r{row}"}))
    published = read_published("\n".join(document), "made-up.toml")
    return score(published, [Evidence("t", tuple(published), findings)])


def drawn(scoreboard: Scoreboard) -> ET.Element:
    svg = draw_overview(scoreboard)
    assert svg is not None
    return ET.fromstring(svg)


@cache
def picture(*sizes: int) -> ET.Element:
    """Of tables of these sizes; to be read only."""
    return drawn(board([*sizes]))


def size_of(root: ET.Element) -> tuple[float, float]:
    _, _, width, height = map(float, root.attrib["viewBox"].split())
    return width, height


def titles(root: ET.Element) -> list[str]:
    return [e.text or "" for e in root.iter(f"{SVG}title")]


def words(root: ET.Element) -> list[str]:
    return [e.text or "" for e in root.iter(f"{SVG}text")]


def is_sign(group: ET.Element) -> bool:
    """Whether a group is the sign of a cell, with its tooltip."""
    return group.find(f"{SVG}title") is not None and group.find(f".//{SVG}use") is not None


SIZES = {
    "5 cells": [5],
    "48 cells": [10, 20, 18],
    "280 cells": [36, 15, 32, 22, *[7] * 25],
    "600 cells": [6] * 100,
    "600 cells of one table": [600],
    "600 tables": [1] * 600,
}


@pytest.mark.slow
@pytest.mark.parametrize("sizes", SIZES.values(), ids=SIZES)
def test_it_fits_a_screen_and_its_words_are_legible(sizes: list[int]) -> None:
    root = picture(*sizes)
    width, height = size_of(root)
    assert SHEET * height / width <= 900
    told = ET.tostring(root).decode()
    fonts = [float(size) for size in re.findall(r"font[^;\"]*?([\d.]+)px", told)]
    assert fonts
    assert min(fonts) * SHEET / width >= 9


@pytest.mark.parametrize("sizes", SIZES.values(), ids=SIZES)
def test_each_cell_has_one_sign_that_tells_which_it_is(sizes: list[int]) -> None:
    root = picture(*sizes)
    told = [text for text in titles(root) if "published" in text]
    signs = [g for g in root.iter(f"{SVG}g") if is_sign(g)]
    assert len(signs) == sum(sizes)
    assert {g.attrib["class"] for g in signs} == {"st-simulated"}
    assert len(set(told)) == sum(sizes)
    assert "1.1 · r0: published 10.0 N·m, reproduced 10.1 N·m (+1.00 %), differs, simulated" in told


@pytest.mark.parametrize("size", [5, 60])
def test_a_sign_has_the_class_of_the_status_of_its_cell(size: int) -> None:
    root = drawn(board([size], marked="r3"))
    classes = {
        (g.findtext(f"{SVG}title") or "").split(":")[0]: g.attrib["class"]
        for g in root.iter(f"{SVG}g")
        if is_sign(g)
    }
    assert classes.pop("1.1 · r3") == "st-not-reproducible"
    assert set(classes.values()) == {"st-simulated"}


def test_all_that_belongs_to_a_cell_has_its_class() -> None:
    """A page that hides a status hides the stem with the sign."""
    svg = draw_overview(board([5])) or ""
    root = ET.fromstring(svg)
    assert len([g for g in root.iter(f"{SVG}g") if g.attrib.get("class")]) == 2 * 5
    assert 'id="cell' not in svg, "a class in place of an id that would stand twice"


def test_a_row_of_a_table_names_its_farthest_cell() -> None:
    root = drawn(board([30, 30], {"1.1/r7": 9.0, "2.1/r3": 30.0, "2.1/r4": 25.0}))
    shown = words(root)
    assert "Table 1.1 (30)" in shown
    assert "−10.0 %  r7" in shown
    assert "+200 %  r3" in shown


def test_few_cells_have_their_names_beside_them() -> None:
    shown = words(drawn(board([3, 2])))
    assert [word for word in shown if re.fullmatch(r"r\d", word)] == ["r0", "r1", "r2", "r0", "r1"]


@pytest.mark.parametrize("others", [3, 60])
def test_signs_lie_at_their_deviation(others: int) -> None:
    """Beyond 1 % the axis is logarithmic: as far from 1 to 10 % as from 10 to 100 %."""
    off = {"1.1/r0": 10.1, "1.1/r1": 11.0, "1.1/r2": 20.0, "1.1/r3": 9.9}
    root = drawn(board([4, others], off))
    at: dict[str, float] = {}
    for g in root.iter(f"{SVG}g"):
        title, use = g.find(f"{SVG}title"), g.find(f".//{SVG}use")
        if title is not None and use is not None and (title.text or "").startswith("1.1"):
            at[(title.text or "").split(":")[0]] = float(use.attrib["x"])
    one, ten, hundred, minus = (at[f"1.1 · r{k}"] for k in range(4))
    assert ten - one == pytest.approx(hundred - ten, rel=1e-3)
    assert ten > one > minus


@pytest.mark.slow
def test_signs_of_one_place_do_not_cover_each_other() -> None:
    root = drawn(board([4, 60]))
    places = set()
    for g in root.iter(f"{SVG}g"):
        title, use = g.find(f"{SVG}title"), g.find(f".//{SVG}use")
        if title is not None and use is not None and (title.text or "").startswith("1.1"):
            places.add((use.attrib["x"], use.attrib["y"]))
    assert len(places) == 4


def test_tables_without_a_row_of_their_own_are_counted() -> None:
    shown = words(picture(*[1] * 600))
    assert any(re.fullmatch(r"\d+ further tables \(\d+\)", word) for word in shown)


def test_where_nothing_was_compared_nothing_is_drawn() -> None:
    assert draw_overview(Scoreboard()) is None
    assert draw_overview(board([2], {"1.1/r0": float("nan"), "1.1/r1": float("nan")})) is None


def test_the_same_board_is_the_same_bytes() -> None:
    assert draw_overview(board([30, 40])) == draw_overview(board([30, 40]))
