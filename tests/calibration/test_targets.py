"""What deviations count, by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from campaign.calibration.targets import Target, make_target, restricted, shortest, weight_of
from campaign.published.patterns import covers
from campaign.published.values import Cell, thesis
from campaign.published.verdicts import ReproducedNumber, deviation, judge

GAIN_MARGIN = next(c for c in thesis()["5.3"].cells if c.path == "5.3/gain_margin/none")
ERROR = next(c for c in thesis()["5.11"].cells if c.path == "5.11/0.8/static")


def of(*tables: str) -> list[Cell]:
    return [cell for name in tables for cell in thesis()[name].cells]


def test_absolute_weight_is_in_the_printed_unit() -> None:
    target = make_target(GAIN_MARGIN, "1.5 dB")
    assert target.residual(30.5 + 3.0) == pytest.approx(2.0)
    assert make_target(ERROR, "20 urad").residual(0.43 - 0.04) == pytest.approx(-2.0)


def test_relative_weight_counts_twice_and_half_the_same() -> None:
    target = make_target(ERROR, "10 %")
    assert target.residual(0.86) == pytest.approx(math.log(2) / 0.1)
    assert target.residual(0.215) == pytest.approx(-math.log(2) / 0.1)


@pytest.mark.parametrize("weight", ["10 %", "0.05 mrad"])
def test_nothing_found_is_finite_and_the_worst(weight: str) -> None:
    target = make_target(ERROR, weight)
    for nothing in (None, math.nan, math.inf):
        assert target.residual(nothing) == target.worst
    assert math.isfinite(target.worst)
    assert abs(target.residual(1e9)) <= target.worst
    assert 0 < target.residual(10 * 0.43) < target.worst


def test_a_claim_asks_for_no_more_than_it_says() -> None:
    at_most = Target(replace(ERROR, relation="at most"), 0.1, relative=True)
    assert at_most.residual(0.2) == 0.0
    assert at_most.residual(0.86) > 0
    at_least = Target(replace(ERROR, relation="at least"), 0.1, relative=True)
    assert at_least.residual(0.86) == 0.0
    assert at_least.residual(0.2) < 0


@pytest.mark.parametrize(
    ("relation", "found", "percent"),
    [
        ("equal", 0.86, 100.0),
        ("near", 0.215, -50.0),
        ("at most", 0.86, 100.0),
        ("at most", 0.2, None),
        ("at least", 0.2, 100 * (0.2 / 0.43 - 1)),
        ("at least", 0.86, None),
        ("rank", 0.86, None),
        ("equal", None, None),
    ],
)
def test_percent_mean_what_they_mean_on_the_scoreboard(
    relation: str, found: float | None, percent: float | None
) -> None:
    cell = replace(ERROR, relation=relation)
    target = Target(cell, 0.1, relative=True)
    assert target.percent(found) == pytest.approx(
        math.nan if percent is None else percent, nan_ok=True
    )
    if found is not None:
        again = ReproducedNumber(found)
        assert deviation(cell, again, judge(cell, again)) == (percent and pytest.approx(percent))
    zero = Target(replace(cell, value=0.0), 0.1, relative=False)
    assert math.isnan(zero.percent(0.1))


def test_the_closest_name_weighs() -> None:
    weights: dict[str, str | float] = {"5.11": "6 %", "5.11/*/static": "7 %", "5.11/0.8": "8 %"}
    assert weight_of(ERROR, weights) == "5.11/*/static"
    assert weight_of(ERROR, {**weights, "5.11/0.8/static": "1 %"}) == "5.11/0.8/static"
    assert weight_of(GAIN_MARGIN, weights) is None


def test_a_fit_sees_no_other_cell() -> None:
    kept = restricted(thesis(), [make_target(ERROR, "1 %")])
    assert [cell.path for table in kept.values() for cell in table.cells] == ["5.11/0.8/static"]


def test_fitted_names_whole_tables_and_rows() -> None:
    wanted = [cell for cell in of("5.10", "5.11") if cell.row != "0.1"][:-1]
    names = shortest([make_target(cell, "1 %") for cell in wanted], thesis())
    assert names[:2] == ("5.10", "5.11/0.2")
    assert names[-3:] == ("5.11/2.0/none", "5.11/2.0/static", "5.11/2.0/lugre")
    assert {c.path for c in of("5.10", "5.11") if any(covers(n, c.path) for n in names)} == {
        cell.path for cell in wanted
    }
