"""Draws of a random bench on the page: a strip per published value, and its place in words."""

from __future__ import annotations

import csv
import io
import re

import pytest

from campaign.published.draws import SEED
from campaign.published.evidence import Evidence
from campaign.published.scoreboard import Scoreboard, score, to_csv
from campaign.published.values import read_published
from campaign.report.content.lines import shown_line
from campaign.report.drawing.strips import draw_strips
from campaign.result import Finding

PUBLISHED = read_published(
    """
source = "made up"
[[table]]
name = "4.1"
title = "Breakaway torque"
quantity = "torque"
unit = "N m"
decimals = 2
rows = { condition = "reading" }
columns = { condition = "component", names = ["motor", "load"] }
[table.cells]
1 = [5.0, 20.0]
mean = [4.0, 0.0]
[[table.mark]]
cells = ["1/*"]
status = "not reproducible"
reason = "a single reading"
""",
    "made-up.toml",
)


def board(draws: int) -> Scoreboard:
    """Draws of 3.6, 3.7 ... for every cell."""
    findings = [
        Finding("torque", 3.6 + 0.1 * n, "N m", {"reading": row, "component": part, SEED: n})
        for n in range(draws)
        for row in (1.0, "mean")
        for part in ("motor", "load")
    ]
    return score(PUBLISHED, [Evidence("t", ("4.1",), findings)])


def test_each_value_but_single_readings_and_zeros_has_a_strip() -> None:
    svg = draw_strips(board(10))
    assert svg is not None
    words = re.findall(r">([^<>]*)</text>", svg)
    assert [word for word in words if "motor" in word or "load" in word] == ["4.1 · mean · motor"]
    assert "45 %" in words, "four draws are below 4.00, and one is 4.00"
    assert svg == draw_strips(board(10)), "the same bytes"


def test_without_draws_there_is_no_picture() -> None:
    assert draw_strips(board(1)) is None
    assert draw_strips(Scoreboard()) is None
    assert shown_line(board(1).lines[0]).place == ""


def test_the_place_stands_beside_what_was_found() -> None:
    """4.5 of 10 below; Clopper and Pearson with 4.5 in place of a whole number."""
    line = next(line for line in board(10).lines if line.cell.path == "4.1/mean/motor")
    place = line.place
    assert place is not None
    low, high = 100 * (place.low or 0.0), 100 * (place.high or 0.0)
    assert shown_line(line).place == f"above 45 % ({low:.0f} to {high:.0f} %) of 10 draws"
    (row,) = csv.DictReader(io.StringIO(to_csv([line])))
    assert float(row["place"]) == pytest.approx(0.45)
    assert row["draws"] == "10"
