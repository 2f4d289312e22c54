"""Matching and statuses on a small published file, with deviations worked out by hand."""

from __future__ import annotations

import csv
import io
import math

import pytest

from campaign.estimate import Estimate
from campaign.published.evidence import Evidence
from campaign.published.provenance import OF_A_TRUTH, Provenance, SweepPoint
from campaign.published.scoreboard import COLUMNS, Line, Scoreboard, score, to_csv
from campaign.published.values import read_published
from campaign.reason import Reason
from campaign.result import Finding

PUBLISHED = read_published(
    """
source = "made up"
[[table]]
name = "1.1"
title = "Errors"
quantity = "error"
unit = "mrad"
decimals = 1
conditions = { acceleration = "18 deg/s^2" }
rows = { condition = "frequency", unit = "Hz" }
columns = { condition = "compensation", names = ["none", "lugre"] }
[table.cells]
"0.5" = [0.5, 0.2]
"2.0" = [0.8, 0.0]
[[table.mark]]
cells = ["2.0/none"]
status = "not reproducible"
reason = "the base cannot do that"
[[table.mark]]
cells = ["2.0/none", "0.5/lugre"]
status = "inconsistent"
reason = "printed twice"
[[table]]
name = "text 1.2"
title = "Claim"
column.value = {}
[table.row.rise_time]
quantity = "rise_time"
unit = "ms"
relation = "at most"
[table.cells]
rise_time = [40]
""",
    "made-up.toml",
)
SHAKEN = {"acceleration": math.radians(18), "compensation": "none", "frequency": 0.5}
ERROR = Finding("error", 0.55e-3, "rad", SHAKEN)
ALTERED = Provenance((SweepPoint({}, "none", "somebody changed it"),))


def board(*findings: Finding, **more: object) -> Scoreboard:
    return score(PUBLISHED, [Evidence("test", ("1.1", "text 1.2"), findings, **more)])


def line(found: Scoreboard, path: str) -> Line:
    return next(line for line in found.lines if line.cell.path == path)


def test_the_deviation_is_in_percent_of_the_published_value_in_its_unit() -> None:
    found = line(board(ERROR), "1.1/0.5/none")
    assert found.reproduced == pytest.approx(0.55)
    assert found.deviation == pytest.approx(10.0)
    assert found.status == "simulated"


@pytest.mark.parametrize(
    ("changed", "matches"),
    [
        ({}, True),
        ({"frequency": 0.5 * 1.0009}, True),
        ({"frequency": 0.5 * 1.0011}, False),
        ({"acceleration": None}, False),
        ({"compensation": "static"}, False),
        ({"position": 3}, True),
    ],
)
def test_every_condition_of_the_cell_must_be_stated_and_met(
    changed: dict[str, float], matches: bool
) -> None:
    conditions = {k: v for k, v in {**SHAKEN, **changed}.items() if v is not None}
    found = board(Finding("error", 0.55e-3, "rad", conditions))
    assert (line(found, "1.1/0.5/none").found is not None) is matches


def test_another_quantity_does_not_match() -> None:
    found = board(Finding("peak_error", 0.55e-3, "rad", SHAKEN))
    assert {line.verdict for line in found.lines} == {"not run"}


def test_every_cell_of_a_table_that_was_spoken_to_is_a_line() -> None:
    """What was not tried must not leave the board: it would look complete."""
    found = board(ERROR)
    assert [line.cell.path for line in found.lines] == [
        "1.1/0.5/none",
        "1.1/0.5/lugre",
        "1.1/2.0/none",
        "1.1/2.0/lugre",
        "text 1.2/rise_time/value",
    ]
    assert [line.verdict for line in found.lines] == ["agrees", *["not run"] * 4]
    marks = [None, "inconsistent", "not reproducible", None, None]
    assert [line.status for line in found.lines] == ["simulated", *marks[1:]]


def test_a_table_nobody_reproduces_is_not_spoken_to() -> None:
    assert score(PUBLISHED, [Evidence("test", (), [ERROR])]) == Scoreboard()


@pytest.mark.parametrize(
    ("more", "recomputed", "status"),
    [
        ({}, False, "simulated"),
        ({"fitted": ("5.3",)}, False, "predicted"),
        ({"fitted": ("5.3",)}, True, "recomputed"),
        ({"fitted": ("5.3",), "given": ("1.1",)}, True, "recovered"),
        ({"fitted": ("1.1",), "given": ("1.1",)}, True, "calibrated"),
        ({"fitted": ("1.1/0.5/none",)}, False, "calibrated"),
        ({"fitted": ("1.1/0.5/lugre",)}, False, "predicted"),
        ({"seen": ("1.1",)}, False, "selected"),
        ({"seen": ("1.1/*/none",), "fitted": ("5.3",)}, False, "selected"),
        ({"seen": ("1.1",)}, True, "recomputed"),
        ({"seen": ("1.1",), "given": ("1.1",)}, False, "recovered"),
        ({"seen": ("1.1",), "fitted": ("1.1",)}, False, "calibrated"),
        ({"seen": ("1.1/0.5/lugre",)}, False, "simulated"),
        ({"fitted": ("1.1",), "provenance": ALTERED}, True, "altered"),
    ],
)
def test_the_first_status_that_applies(
    more: dict[str, object], recomputed: bool, status: str
) -> None:
    finding = Finding("error", 0.55e-3, "rad", SHAKEN, recomputed)
    assert line(board(finding, **more), "1.1/0.5/none").status == status


def test_a_marked_cell_is_a_line_with_and_without_a_finding() -> None:
    without = line(board(), "1.1/0.5/lugre")
    assert (without.status, without.reproduced) == ("inconsistent", None)
    finding = Finding("error", 0.2e-3, "rad", {**SHAKEN, "compensation": "lugre"})
    found = line(board(finding, fitted=("1.1",)), "1.1/0.5/lugre")
    assert (found.status, found.reproduced) == ("inconsistent", pytest.approx(0.2))


def test_a_published_zero_has_no_deviation_in_percent() -> None:
    conditions = {**SHAKEN, "compensation": "lugre", "frequency": 2.0}
    found = line(board(Finding("error", 0.01e-3, "rad", conditions)), "1.1/2.0/lugre")
    assert found.deviation is None
    assert found.verdict == "agrees"


def test_nan_is_no_finding_and_was_tried() -> None:
    found = board(Finding("error", math.nan, "rad", SHAKEN))
    here, *others = found.lines
    assert (here.verdict, here.reproduced, here.status) == ("not found", None, None)
    assert here.why == "test: the analysis found no number"
    assert tuple(others) == board().lines[1:]


def test_the_first_test_that_found_a_cell_counts() -> None:
    other = Finding("error", 0.6e-3, "rad", SHAKEN)
    empty = Finding("error", math.nan, "rad", SHAKEN)
    tests = [Evidence(n, ("1.1",), [f]) for n, f in (("a", empty), ("b", ERROR), ("c", other))]
    found = score(PUBLISHED, tests)
    assert line(found, "1.1/0.5/none").test == "b"
    assert [(line.test, line.reproduced) for line in found.further] == [("c", pytest.approx(0.6))]


def test_what_a_sweep_finds_again_is_told() -> None:
    """Of three days the first counts, whichever suits best."""
    days = [
        Finding("error", value, "rad", {**SHAKEN, "bench.variation.day": day})
        for day, value in ((1, 0.6e-3), (2, 0.5e-3), (3, 0.7e-3))
    ]
    found = board(*days)
    assert line(found, "1.1/0.5/none").reproduced == pytest.approx(0.6)
    assert [line.reproduced for line in found.further] == pytest.approx([0.5, 0.7])


def test_a_number_counts_before_a_bound_that_an_earlier_test_found() -> None:
    bound = Finding("error", 0.3e-3, "rad", SHAKEN, lower_bound=True)
    tests = [Evidence(n, ("1.1",), [f]) for n, f in (("a", bound), ("b", ERROR))]
    assert line(score(PUBLISHED, tests), "1.1/0.5/none").test == "b"
    within = score(PUBLISHED, [Evidence("a", ("1.1",), [bound, ERROR])])
    assert line(within, "1.1/0.5/none").reproduced == pytest.approx(0.55)
    assert within.further == ()


def test_what_is_known_of_the_test_holds_for_its_findings() -> None:
    bare = {k: v for k, v in SHAKEN.items() if k != "acceleration"}
    finding = Finding("error", 0.55e-3, "rad", bare)
    assert line(board(finding, known={"acceleration": math.radians(18)}), "1.1/0.5/none")


def test_an_impossible_unit_is_told_and_costs_nothing_else() -> None:
    found = board(Finding("error", 1.0, "kg m^2", SHAKEN), ERROR)
    assert found.problems == (
        "test: error in 'kg m^2' cannot be compared with 1.1/0.5/none in 'mrad'",
    )
    assert line(found, "1.1/0.5/none").reproduced == pytest.approx(0.55)


def test_an_unknown_table_is_told() -> None:
    found = score(PUBLISHED, [Evidence("test", ("9.9", "figure 5.4"), ())])
    assert found.problems == ("test reproduces '9.9', which is no published table",)


def test_the_file_has_exactly_these_columns_and_unrounded_values() -> None:
    rows = list(csv.DictReader(io.StringIO(to_csv(board(ERROR).lines))))
    assert tuple(rows[0]) == COLUMNS == (
        "table", "row", "column", "unit", "published", "reproduced", "deviation_percent", "status",
        "low", "high", "verdict", "source", "place", "place_low", "place_high", "draws"
    )  # fmt: skip
    by_cell = {(r["row"], r["column"]): r for r in rows}
    found = by_cell["0.5", "none"]
    assert found["published"] == "0.5"
    assert float(found["reproduced"]) == 0.55e-3 * 1e3
    empty = by_cell["2.0", "none"]
    assert (empty["reproduced"], empty["deviation_percent"]) == ("", "")
    assert empty["status"] == "not reproducible"


def test_the_file_has_the_interval_and_a_bound_only_on_its_side() -> None:
    found = Estimate("error", 0.56e-3, "rad", 0.5e-3, 0.6e-3, 0.95)
    bound = Estimate.without_interval(
        "error", 0.3e-3, "rad", Reason("test", "never passed"), kind="at least"
    )
    there = {**SHAKEN, "compensation": "lugre"}
    evidence = Evidence(
        "t", ("1.1",), [Finding.of(found, SHAKEN), Finding.of(bound, there)], source="hardware"
    )
    rows = list(csv.DictReader(io.StringIO(to_csv(score(PUBLISHED, [evidence]).lines))))
    number, beyond = rows[0], rows[1]
    ends = [float(number["low"]), float(number["high"])]
    assert ends == pytest.approx([0.5, 0.6], rel=1e-12)
    assert (number["verdict"], number["source"]) == ("compatible", "hardware")
    assert (beyond["reproduced"], beyond["high"]) == ("", "")
    assert float(beyond["low"]) == pytest.approx(0.3)
    assert beyond["verdict"] == "not reached"
    assert (rows[3]["verdict"], rows[3]["status"], rows[3]["source"]) == ("not run", "", "")


def test_the_file_of_further_runs_says_who_found_them() -> None:
    tests = [Evidence(name, ("1.1",), [ERROR]) for name in ("first", "again")]
    (row,) = csv.DictReader(
        io.StringIO(to_csv(score(PUBLISHED, tests).further, (*COLUMNS, "test")))
    )
    assert (row["test"], row["row"]) == ("again", "0.5")


def test_an_altered_bench_is_told_with_the_reason() -> None:
    found = board(ERROR, provenance=ALTERED)
    assert found.altered == ("test: somebody changed it",)
    assert found.misdescribed


def test_a_reason_that_several_tests_share_is_told_once() -> None:
    """And nobody is advised to describe a bench anew which was not simulated."""
    truth = Provenance((SweepPoint({}, "none", OF_A_TRUTH),))
    claim = Finding("rise_time", 0.03, "s", {})
    evidence = [
        Evidence("first", ("1.1",), [ERROR], provenance=truth),
        Evidence("other", ("text 1.2",), [claim], provenance=truth),
    ]
    found = score(PUBLISHED, evidence)
    assert found.altered == (f"first, other: {OF_A_TRUTH}",)
    assert not found.misdescribed
    changed = Evidence("third", ("1.1",), [ERROR], provenance=ALTERED)
    assert score(PUBLISHED, [evidence[1], changed]).misdescribed
