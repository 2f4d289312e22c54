"""Several draws of a random bench: where one more lies, and the place of a published value."""

from __future__ import annotations

import csv
import io
import math

import numpy as np
import pytest

from campaign.estimate import Estimate, Origin, Systematic
from campaign.published.draws import SEED, place_in, spread, together
from campaign.published.evidence import Evidence
from campaign.published.provenance import Provenance, SweepPoint
from campaign.published.scoreboard import Line, score, to_csv
from campaign.published.values import read_published
from campaign.result import Finding
from tests.estimation.coverage import draws, rejected

T2 = 4.302653  # Student's t with 2 degrees of freedom, 97.5 %: any table
PUBLISHED = read_published(
    """
source = "made up"
[[table]]
name = "1"
title = "Torque"
quantity = "torque"
unit = "mN m"
decimals = 1
columns = { condition = "statistic", names = ["mean"] }
[table.cells]
a = [10.0]
""",
    "made-up.toml",
)


def test_a_place_and_its_exact_interval() -> None:
    """None of ten: [0, 1 - 0.025^(1/10)]; three of ten: 0.0667 to 0.6525 (Clopper and Pearson)."""
    values = [float(n) for n in range(10)]
    below = place_in(values, -1.0)
    assert (below.value, below.low) == (0.0, 0.0)
    assert below.high == pytest.approx(1 - 0.025 ** (1 / 10))
    inside = place_in(values, 2.5)
    assert inside.value == 0.3
    assert (inside.low, inside.high) == pytest.approx((0.06674, 0.65245), abs=1e-5)
    assert place_in(values, 20.0).high == 1.0
    assert place_in([1.0, 2.0, math.nan], 2.0).value == 0.75  # a tie counts half
    with pytest.raises(ValueError, match="no values"):
        place_in([math.nan], 1.0)


def test_what_rounds_to_the_printed_digits_is_a_tie() -> None:
    assert place_in([1.96, 2.04, 3.0, 1.0], 2.0, 0.05).value == 0.5
    assert place_in([1.96, 2.04, 3.0, 1.0], 2.0, 0.03).value == 0.5
    assert place_in([1.96, 1.97, 3.0, 4.0], 2.0, 0.05).value == 0.25


def test_one_more_of_three() -> None:
    """9, 10, 11: mean 10, sd 1; half t sqrt(1 + 1/3)."""
    found = spread("torque", [9.0, 11.0, 10.0], "N m")
    half = T2 * math.sqrt(4 / 3)
    assert found.value == 10.0
    assert (found.low, found.high) == pytest.approx((10 - half, 10 + half), rel=1e-6)


def test_thirty_nine_hold_one_more_without_a_distribution() -> None:
    """(39 + 1 - 2)/(39 + 1) = 95 %: smallest to largest. Of 79 the second ones, of 38 none do."""
    found = spread("torque", np.arange(39.0) ** 3, "N m")
    assert (found.value, found.low, found.high) == (19.0**3, 0.0, 38.0**3)
    more = spread("torque", np.arange(79.0), "N m")
    assert (more.low, more.high) == (1.0, 77.0)
    assert "Student" in spread("torque", np.arange(38.0) ** 3, "N m").method


def test_without_scatter_there_is_no_spread() -> None:
    assert spread("torque", [2.0, 2.0, math.nan], "N m").reason.text == "all 2 draws are alike"
    assert spread("torque", [2.0], "N m").reason
    coarse = spread("torque", [2.0, 2.0], "N m", (Systematic("resolution", 0.5),))
    assert coarse.combined == pytest.approx((2.0 - 0.979982, 2.0 + 0.979982))


@draws(400)
def test_the_interval_holds_one_more(count: int) -> None:
    """Of normal ones whatever their number, of deviations of ten and of steps from 39 on."""
    held = {}
    for size, kind in ((3, "normal"), (12, "normal"), (39, "normal"), (39, "skew"), (79, "skew")):
        random = np.random.default_rng([44, size, len(kind)])
        drawn = random.standard_normal((count, size + 1))
        if kind == "skew":
            drawn = np.sqrt(random.chisquare(9, (count, size + 1)))
        pairs = [(spread("x", row[:-1], ""), row[-1]) for row in drawn]
        held[f"{size} {kind}"] = [told.low <= last <= told.high for told, last in pairs]
    assert rejected(held) == {}


def draw(seed: int, value: float, **more: object) -> Finding:
    """A mean in N m with an interval of its own, and a systematic part of 0.3 mN m."""
    part = Systematic("torque constant", 0.3e-3)
    told = Estimate("torque", value, "N m", value * 0.99, value * 1.01, 0.95, systematic=(part,))
    return Finding.of(told, {"statistic": "mean", SEED: seed, **more})


def line_of(*findings: Finding, executed: tuple[int, ...] = (), **more: object) -> Line:
    places = tuple(SweepPoint({SEED: seed}, "none", "") for seed in executed)
    evidence = Evidence("t", ("1",), findings, provenance=Provenance(places), **more)
    (line,) = score(PUBLISHED, [evidence]).lines
    return line


SEVEN = [draw(seed, 10.2e-3 + 0.1e-3 * (seed - 4)) for seed in range(1, 8)]
"""9.9 to 10.5 mN m."""


def test_draws_are_one_line() -> None:
    """sd of 9.9 to 10.5 is 0.216; t with 6 freedoms 2.4469; half 0.5650; with 0.588 together."""
    found = line_of(*SEVEN, executed=tuple(range(1, 8)))
    assert found.reproduced == pytest.approx(10.2)
    half = math.hypot(2.446912 * 0.2160247 * math.sqrt(8 / 7), 1.959964 * 0.3)
    ends = (found.found.low, found.found.high)
    assert ends == pytest.approx((10.2 - half, 10.2 + half), rel=1e-6)
    assert found.verdict == "compatible"
    assert found.draws == pytest.approx([9.9 + 0.1 * n for n in range(7)])
    # 9.9 is below 10.0 and does not round to it; 10.0 is a tie.
    assert found.place.value == pytest.approx(1.5 / 7)
    (row,) = csv.DictReader(io.StringIO(to_csv([found])))
    assert (row["place"], row["draws"]) == (repr(1.5 / 7), "7")
    assert 0.0 < float(row["place_low"]) < 1.5 / 7 < float(row["place_high"]) < 1.0


def test_a_deviation_is_never_below_zero() -> None:
    """Three draws at 1, 2, 6 would have one more at 3 -+ 13."""
    found = [draw(k, value, statistic="standard deviation") for k, value in enumerate((1, 2, 6))]
    mean = [draw(k, value, statistic="mean") for k, value in enumerate((1, 2, 6))]
    assert together(found).known.low == 0.0
    assert together(mean).known.low == pytest.approx(3 - 4.3027 * 2.6458 * 2 / 3**0.5, rel=1e-4)


def test_a_published_value_beyond_all_draws_differs() -> None:
    """Although its share may be 3 %, as far as seven draws tell."""
    beyond = [draw(seed, 11.5e-3 + 0.05e-3 * seed) for seed in range(7)]
    found = line_of(*beyond)
    assert found.place.high > 0.025
    assert found.verdict == "differs"


def test_a_wide_spread_is_undecided() -> None:
    assert line_of(*(draw(seed, 5e-3 * seed) for seed in range(1, 5))).verdict == "undecided"


def test_the_middle_of_two_chosen_draws_agrees_with_nothing() -> None:
    """The bench's own seed says 8 mN m; another, looked for among many, 12: their middle is 10."""
    assert line_of(draw(44, 8e-3), draw(1017, 12e-3)).verdict == "undecided"
    close = [draw(seed, 10e-3 + 0.02e-3 * (seed - 4)) for seed in range(1, 8)]
    assert line_of(*close).verdict == "agrees"


def test_a_draw_that_was_lost_selects_the_others() -> None:
    """It may have been lost because of what it would have said."""
    lost = line_of(*SEVEN, executed=tuple(range(8)))
    assert (lost.verdict, lost.place) == ("undecided", None)
    alone = line_of(draw(3, 10e-3), executed=(3, 4))  # one is left, and agrees
    assert (alone.verdict, alone.place) == ("undecided", None)
    nothing = Finding("torque", math.nan, "N m", {"statistic": "mean", SEED: 0})
    assert line_of(*SEVEN, nothing).verdict == "undecided"
    bound = Finding("torque", 9e-3, "N m", {"statistic": "mean", SEED: 0}, lower_bound=True)
    assert line_of(*SEVEN, bound).verdict == "undecided"
    vague = Estimate("torque", 9e-3, "N m", origin=Origin.NOT_DETERMINED)
    open_one = Finding.of(vague, {"statistic": "mean", SEED: 0})
    assert together([*SEVEN, open_one]).known.origin == "not determined"
    assert together([*SEVEN, nothing]).known.reason.text == "1 of 8 draws have no number"


def test_two_numbers_of_one_draw_are_no_two_draws() -> None:
    """Forty findings of two seeds would have the order statistics of forty draws."""
    many = [draw(seed, 10e-3 + 1e-5 * k * seed) for seed in (1, 2) for k in range(20)]
    found = line_of(*many, executed=(1, 2))
    assert len(found.draws) == 2
    assert found.found == line_of(many[0], many[20], executed=(1, 2)).found


def test_only_what_differs_in_nothing_else_is_a_draw() -> None:
    """Of two places in a sweep the first counts, with its draws."""
    elsewhere = [draw(seed, 20e-3 + 1e-3 * seed, frequency=2.0) for seed in range(1, 8)]
    found = line_of(*[each for pair in zip(SEVEN, elsewhere, strict=True) for each in pair])
    assert found.draws == pytest.approx([9.9 + 0.1 * n for n in range(7)])
    (single,) = [line_of(SEVEN[0])]
    assert (single.draws, single.place) == ((), None)


def test_one_altered_draw_alters_the_line() -> None:
    places = tuple(SweepPoint({SEED: n}, "none", "changed" if n == 5 else "") for n in range(1, 8))
    evidence = Evidence("t", ("1",), SEVEN, provenance=Provenance(places))
    assert [line.status for line in score(PUBLISHED, [evidence]).lines] == ["altered"]
