"""The published values: typed here by hand from the printed document, not from the file."""

from __future__ import annotations

import math

import numpy as np
import pytest

from campaign.errors import UsageError
from campaign.published.values import Cell, published_values, read_published, thesis

DEG = math.pi / 180


def cell(path: str) -> Cell:
    return next(c for c in thesis()[path.split("/")[0]].cells if c.path == path)


@pytest.mark.parametrize(
    ("path", "value", "unit"),
    [
        ("4.1/9/load", 22.10, "N m"), ("4.1/5/gearbox", 5.60, "N m"),
        ("4.3/static_torque/negative", 35.1, "N m"), ("4.3/stribeck_exponent/nominal", 0.91, ""),
        ("4.4/stribeck_velocity/negative 3-4", 0.0275, "rad/s"),
        ("4.4/static_torque/relative standard deviation", 4.2, "percent"),
        ("4.5/9/bristle_stiffness", 16334, "N m/rad"),
        ("4.5/mean/bristle_damping", 1165, "N m s/rad"),
        ("5.2/static/stabilization_error", 0.0660, "mrad"), ("5.3/gain_margin/lugre", 29.6, "dB"),
        ("5.4/lugre/stabilization_error", 0.17, "mrad"), ("5.5/1.5/static", 0.49, "mrad"),
        ("5.6/50/none", 0.68, "mrad"), ("5.7/0.2/static", 0.47, "mrad"),
        ("5.8/observer/stabilization_error", 0.0008, "mrad"),
        ("5.9/phase_margin/observer", 72, "deg"),
        ("5.10/observer/stabilization_error", 0.15, "mrad"), ("5.11/2.0/observer", 0.67, "mrad"),
        ("5.12/50/observer", 0.31, "mrad"), ("5.13/0.8/observer", 0.52, "mrad"),
        ("6.1/none/experimental", 0.59, "mrad"),
        ("figure 5.14/viscous_friction/threshold", 65, "percent"),
        ("text 4.2.3/settling_time/value", 400, "ms"),
        ("text 5.2.2.3/acceleration/value", 0.6234, "rad/s^2"),
    ],
)  # fmt: skip
def test_numbers_are_the_printed_ones(path: str, value: float, unit: str) -> None:
    found = cell(path)
    assert (found.value, found.unit) == (value, unit)


CELLS = {
    "4.1": 36, "4.3": 15, "4.4": 32, "4.5": 22, "5.2": 3, "5.3": 6, "5.4": 3, "5.5": 21, "5.6": 6,
    "5.7": 21, "5.8": 4, "5.9": 6, "5.10": 4, "5.11": 28, "5.12": 8, "5.13": 28, "6.1": 8,
}  # fmt: skip


def test_every_numeric_table_of_chapters_4_to_6_is_complete() -> None:
    assert {table: len(thesis()[table].cells) for table in CELLS} == CELLS


def test_conditions_are_si() -> None:
    found = cell("5.13/0.4/lugre")
    assert dict(found.conditions) == {
        "acceleration": pytest.approx(36 * DEG),
        "average_friction": pytest.approx(50),
        "frequency": pytest.approx(0.4),
        "compensation": "lugre",
    }


def test_a_row_with_conditions_of_its_own_is_no_value_of_the_others() -> None:
    assert dict(cell("4.5/mean/bristle_stiffness").conditions) == {"statistic": "mean"}
    assert dict(cell("4.5/7/bristle_stiffness").conditions) == {"measurement": 7.0}


def column(table: str, name: str) -> np.ndarray:
    return np.array([c.value for c in thesis()[table].cells if c.column == name])


def row(table: str, name: str) -> np.ndarray:
    return np.array([c.value for c in thesis()[table].cells if c.row == name])


def test_what_is_called_inconsistent_in_4_1_is() -> None:
    for name in ("motor", "gearbox", "load"):
        values = column("4.1", name)[:10]
        printed = cell(f"4.1/mean/{name}")
        assert abs(values.mean() - printed.value) > 0.015
        assert printed.status == "inconsistent"
        deviation = cell(f"4.1/standard deviation/{name}")
        agrees = bool(abs(values.std() - deviation.value) < 0.005)
        assert (deviation.status == "inconsistent") is not agrees


def test_the_means_of_4_4_are_inconsistent_just_where_they_do_not_follow() -> None:
    for name in ("viscous_friction", "coulomb_torque", "static_torque", "stribeck_velocity"):
        values, mean = row("4.4", name)[:6], cell(f"4.4/{name}/mean")
        half = 0.5 * 10.0**-mean.decimals * (1 + 1e-9)
        assert bool(abs(values.mean() - mean.value) > half) is (mean.status == "inconsistent")


def test_contradictions_between_tables_are_marked_on_both_sides() -> None:
    for one, other in [
        ("5.3/bandwidth/none", "5.9/bandwidth/none"),
        ("5.6/33/lugre", "5.12/33/lugre"),
        ("5.6/50/static", "5.12/50/static"),
        ("4.3/coulomb_torque/positive", "4.4/coulomb_torque/positive 5-6"),
    ]:
        assert cell(one).value != cell(other).value
        assert cell(one).status == cell(other).status == "inconsistent"
    assert cell("5.6/50/lugre").status is None


def test_the_base_cannot_have_swung_as_far_as_0_1_hz_needs() -> None:
    found = cell("5.11/0.1/none")
    swing = found.conditions["acceleration"] / (2 * math.pi * 0.1) ** 2 / DEG
    assert swing == pytest.approx(91, abs=0.5)
    assert found.status == "not reproducible"
    assert "91°" in found.reason


def test_printed_digits_survive() -> None:
    assert cell("5.2/static/stabilization_error").printed == "0.0660"
    assert cell("5.5/0.2/none").printed == "0.50"


OWN = """
source = "our own paper"
[[table]]
name = "5.8"
title = "Ours"
quantity = "stabilization_error"
unit = "urad"
rows = { condition = "compensation" }
columns = { condition = "frequency", unit = "mHz", names = ["240"] }
[table.cells]
none = [488]
lugre = [""]
"""


def test_a_laboratory_s_own_table_wins_and_the_others_stay() -> None:
    tables = published_values(OWN)
    (only,) = tables["5.8"].cells
    assert (only.value, only.unit, only.conditions["frequency"]) == (488, "urad", 0.24)
    assert tables["5.8"].source == "our own paper"
    whole = OWN.replace("[[table]]", 'author = "A. Author"\nyear = 2010\n[[table]]', 1)
    (source, *_) = {each.source for each in read_published(whole, "own.toml").values()}
    assert source == "A. Author: our own paper, 2010"
    assert tables["5.10"] is thesis()["5.10"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("source = ", "own.toml: "),
        ('source = "x"\nfoo = 1', "own.toml: foo: Extra inputs are not permitted"),
        (OWN.replace("[488]", "[488, 1]"), "row 'none' has 2 numbers for 1 columns (240)"),
        (OWN.replace('"urad"', '"wumpus"'), "'wumpus' is not a unit"),
        (OWN.replace('quantity = "stabilization_error"', ""), "cell none/240 has no quantity"),
        (OWN.replace('name = "5.8"', 'name = "<b>"'), "must be like 5.8, figure 5.14"),
        (OWN + OWN.split('paper"')[1], "two tables are called '5.8'"),
        (OWN + '[[table.mark]]\ncells = ["nine/*"]\nreason = "x"', "a mark names 'nine/*'"),
        (OWN.replace("[488]", "[nan]"), "own.toml: table.0.cells.none.0"),
    ],
)
def test_mistakes_in_a_file_are_told_by_name(text: str, message: str) -> None:
    with pytest.raises(UsageError) as caught:
        read_published(text, "own.toml")
    assert message in str(caught.value)
