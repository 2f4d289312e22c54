"""Differences and ratios of two estimates: closed forms, other people's code, and coverage."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from campaign.estimate import Estimate, Origin, Systematic
from campaign.estimation.contrast import contrast, is_student, left_over, ratio_ends
from campaign.estimation.difference import (
    ALIKE_BOUNDS,
    AROUND_ZERO,
    NOT_A_MEAN,
    OPEN_SIDE,
    OTHER_LEVEL,
    difference_of,
)
from campaign.estimation.intervals import of_positive_repeats, of_repeats, with_error
from campaign.reason import Cause
from tests.estimation.coverage import draws

KT = "torque constant"


def student(value: float, error: float, freedom: float = 7.0, **more: object) -> Estimate:
    return with_error("torque", value, "N m", error, freedom, "", **more)


def lopsided(value: float, low: float, high: float, **more: object) -> Estimate:
    return Estimate("torque", value, "N m", low, high, 0.95, **more)  # type: ignore[arg-type]


def test_it_is_what_welchs_test_says():
    draw = np.random.default_rng(5)
    before, after = draw.normal(25.0, 0.3, size=4), draw.normal(25.6, 1.1, size=9)
    found = difference_of(of_repeats("t", before, "N m"), of_repeats("t", after, "N m"))
    other = stats.ttest_ind(after, before, equal_var=False)
    low, high = found.difference.combined
    assert (low, high) == pytest.approx(tuple(other.confidence_interval(0.95)), rel=1e-9)
    assert found.p == pytest.approx(other.pvalue, rel=1e-9)
    assert found.difference.value == pytest.approx(after.mean() - before.mean())


def test_very_small_p_values_are_told_apart():
    found = [difference_of(student(10.0, 0.1, 30.0), student(v, 0.1, 30.0)).p for v in (15, 20)]
    t = [5 / math.hypot(0.1, 0.1), 10 / math.hypot(0.1, 0.1)]
    assert found == pytest.approx([2 * stats.t.sf(each, 60.0) for each in t], rel=1e-6)


def test_the_ratio_is_that_of_fieller():
    """Known errors: a² - z² u² = 2 R (a b) - R² (b² - z² v²), a quadratic."""
    a, u, b, v = 12.0, 0.8, 10.0, 0.5
    z = stats.norm.ppf(0.975)
    roots = np.sort(np.roots([b * b - (z * v) ** 2, -2 * a * b, a * a - (z * u) ** 2]).real)
    known = [student(value, error, math.inf) for value, error in ((a, u), (b, v))]
    assert ratio_ends(*known) == pytest.approx(tuple(roots), rel=1e-9)
    change = difference_of(known[1], known[0]).change
    assert (change.low, change.high) == pytest.approx(tuple(roots - 1.0), rel=1e-8)
    assert change.value == pytest.approx(0.2)


def test_a_lopsided_interval_adds_the_half_widths_that_lead_to_each_side():
    found = difference_of(lopsided(5.0, 4.0, 5.5), lopsided(10.0, 9.0, 12.0)).difference
    assert found.value == 5.0
    assert found.low == pytest.approx(5.0 - math.hypot(1.0, 0.5))
    assert found.high == pytest.approx(5.0 + math.hypot(2.0, 1.0))
    assert found.standard_error is None


def test_of_a_sum_the_upper_sides_lead_to_the_upper_end():
    found = contrast(lopsided(5.0, 4.0, 5.5), lopsided(10.0, 9.0, 12.0), -1.0)
    assert found.value == 15.0
    assert found.half(upper=True) == pytest.approx(math.hypot(0.5, 2.0))
    assert found.half(upper=False) == pytest.approx(math.hypot(1.0, 1.0))


def test_an_interval_that_does_not_follow_from_its_error_is_no_students_t():
    assert is_student(student(10.0, 0.5))
    wider = replace(student(10.0, 0.5), low=7.0, high=13.0)
    assert not is_student(wider)
    found = difference_of(wider, student(10.0, 0.5)).difference
    assert found.high == pytest.approx(math.hypot(3.0, stats.t.ppf(0.975, 7) * 0.5))


def test_the_interval_excludes_0_exactly_where_p_is_below_5_percent_and_the_ratio_excludes_1():
    draw = np.random.default_rng(11)
    sides = 0
    for _ in range(150):
        b, a = 10.0, 10.0 + draw.normal(0.0, 1.5)
        parts = [Systematic(KT, draw.uniform(0, 0.4)), Systematic("window", draw.uniform(0, 0.3))]
        if draw.random() < 0.5:
            one, other = (
                student(v, draw.uniform(0.1, 0.6), draw.integers(2, 9), systematic=tuple(parts))
                for v in (a, b)
            )
        else:
            one, other = (
                lopsided(v, v - draw.uniform(0.1, 1), v + draw.uniform(0.1, 1), freedom=4.0)
                for v in (a, b)
            )
        shared = (KT,) if draw.random() < 0.5 else ()
        found = difference_of(other, one, shared)
        excluded = not _holds(found.difference.combined, 0.0)
        assert (
            excluded == (found.p < 0.05) == (not _holds((found.change.low, found.change.high), 0.0))
        )
        sides += excluded
    assert 30 < sides < 120  # both happen


def _holds(ends: tuple[float | None, float | None], value: float) -> bool:
    low, high = ends
    return (low is None or low <= value) and (high is None or value <= high)


def test_what_both_share_cancels_and_what_they_do_not_adds_in_squares():
    part = (Systematic(KT, 1.1),)
    one = student(110.0, 0.2, systematic=part)
    other = student(100.0, 0.2, systematic=(Systematic(KT, 1.0),))
    apart = left_over(one, other)
    assert apart == (Systematic(KT, pytest.approx(math.hypot(1.1, 1.0))),)  # type: ignore[arg-type]
    left = left_over(one, other, 1.0, (KT,))
    assert left == (Systematic(KT, pytest.approx(0.1)),)  # type: ignore[arg-type]
    # An error of 1 % of both is none of their ratio: 1.1 - 1.1 * 1.0.
    assert contrast(one, other, 1.1, (KT,)).shift == pytest.approx(0.0, abs=1e-12)
    with_part = difference_of(other, one, (KT,)).change
    bare = difference_of(replace(other, systematic=()), replace(one, systematic=())).change
    assert with_part.low == pytest.approx(bare.low, abs=1e-4)


def test_a_part_that_only_one_has_stays_and_an_unknown_one_is_told():
    one = student(10.0, 0.2, systematic=(Systematic("window", 0.5), Systematic(KT, None)))
    other = student(9.0, 0.2, systematic=(Systematic(KT, 0.3),))
    assert left_over(one, other) == (
        Systematic("window", 0.5),
        Systematic(KT, 0.3),
        Systematic(KT, None),
    )
    assert left_over(one, other, 1.0, ("window", KT)) == (Systematic("window", 0.5),)


def test_units_are_those_of_the_reference():
    reference = Estimate("e", 2e-3, "rad", 1.9e-3, 2.1e-3, 0.95)
    other = Estimate("e", 3.0, "mrad", 2.9, 3.1, 0.95, systematic=(Systematic("x", 0.1),))
    found = difference_of(reference, other)
    assert found.difference.unit == "rad"
    assert found.difference.value == pytest.approx(1e-3)
    assert found.difference.systematic[0].standard_uncertainty == pytest.approx(1e-4)
    assert found.change.value == pytest.approx(0.5)
    with pytest.raises(ValueError, match="multiple"):
        difference_of(reference, replace(other, unit="N m"))


def test_of_a_negative_reference_more_is_still_more():
    found = difference_of(student(-2.0, 0.05), student(-3.0, 0.05))
    assert found.change.value == pytest.approx(-0.5)
    assert found.change.low < -0.5 < found.change.high < 0
    assert found.difference.high < 0


def test_of_a_reference_that_may_be_0_there_is_no_share():
    found = difference_of(student(0.1, 0.2), student(5.0, 0.2))
    assert not found.change.has_interval
    assert found.change.reason in AROUND_ZERO
    assert found.p < 1e-6
    assert math.isnan(difference_of(student(0.0, 0.2), student(5.0, 0.2)).change.value)


def test_nothing_scatters_and_still_the_ratio_is_one_number():
    one, other = (lopsided(v, v, v) for v in (2.0, 3.0))
    assert ratio_ends(one, other) == pytest.approx((2 / 3, 2 / 3))
    assert difference_of(other, one).p == 0.0
    assert difference_of(one, one).p == 1.0


def test_a_number_without_interval_gives_a_difference_without_one_and_says_why():
    bare = Estimate.without_interval("t", 9.0, "N m", Cause("single value", "a single value")())
    for pair, whose in (
        ((bare, student(10.0, 0.1)), "the reference"),
        ((student(10.0, 0.1), bare), "the other"),
        ((bare, bare), "both"),
    ):
        found = difference_of(*pair)
        assert found.difference.value == pytest.approx(pair[1].value - pair[0].value)
        assert not found.difference.has_interval
        assert found.p is None
        assert str(found.reason) == f"{whose}: no interval (a single value)"
        assert found.reason.values == (("whose", whose), ("why", "single value"))
    unsaid = difference_of(Estimate("t", 9.0, "N m"), student(10.0, 0.1)).reason
    assert str(unsaid) == "the reference: no interval"
    held = Cause("held", "held at 2")()
    given = Estimate.without_interval("t", 2.0, "", held, origin=Origin.GIVEN)
    told = "given in both, not measured (held at 2)"
    assert str(difference_of(given, given).reason) == told


def test_a_number_that_was_not_found_has_no_difference():
    lost = Estimate.without_interval("t", math.nan, "N m", Cause("failed", "every ramp failed")())
    found = difference_of(student(10.0, 0.1), lost)
    assert math.isnan(found.difference.value)
    assert str(found.reason) == "the other: not found (every ramp failed)"


def test_where_one_more_trial_lies_is_not_how_well_a_number_is_known():
    one = lopsided(10.0, 9.0, 11.0, kind="quantile")
    found = difference_of(one, one)
    assert found.p is None
    assert found.reason in NOT_A_MEAN
    assert not found.difference.has_interval


def test_an_open_interval_gives_an_open_difference_and_no_p_value():
    at_bound = Estimate("t", 1.0, "N m", None, 1.5, 0.95, origin=Origin.AT_BOUND)
    found = difference_of(student(3.0, 0.1), at_bound)
    assert found.difference.low is None
    assert found.difference.high == pytest.approx(
        -2.0 + math.hypot(0.5, 0.1 * stats.t.ppf(0.975, 7))
    )
    assert found.p is None
    assert found.reason in OPEN_SIDE


def test_intervals_of_other_levels_are_not_mixed():
    found = difference_of(replace(student(3.0, 0.1), level=0.68), student(4.0, 0.1))
    assert found.p is None
    assert found.reason == OTHER_LEVEL(whose="the reference", percent=68.0)


def test_bounds_compare_as_bounds():
    least = Estimate("g", 24.5, "dB", kind="at least")
    number = Estimate("g", 12.0, "dB", 11.0, 13.0, 0.95)
    found = difference_of(number, least)  # from 12 to at least 24.5
    assert found.difference.kind == "at least"
    assert found.difference.value == pytest.approx(24.5 - 13.0)
    assert found.p is None
    fell = difference_of(least, number)
    assert fell.difference.kind == "at most"
    assert fell.difference.value == pytest.approx(13.0 - 24.5)
    assert not fell.change.has_interval
    alike = difference_of(least, least)
    assert alike.difference.kind == "number"
    assert alike.reason in ALIKE_BOUNDS
    apart = difference_of(Estimate("g", 5.0, "dB", kind="at most"), least)
    assert (apart.difference.kind, apart.difference.value) == ("at least", 19.5)


def covered(kind: str, count: int) -> int:
    """How often the interval of the difference held the truth, 0.7 of 10 and 10.7."""
    draw = np.random.default_rng({"welch": 71, "lopsided": 72, "shared": 73}[kind])
    held = 0
    for _ in range(count):
        if kind == "lopsided":  # known in the logarithm, from few trials each
            one, other = (
                of_positive_repeats("t", v * np.exp(draw.normal(0, s, size=n)), "N m")
                for v, s, n in ((10.7, 0.4, 6), (10.0, 0.5, 8))
            )
        else:
            shift = draw.normal(0.0, 0.05) if kind == "shared" else 0.0
            parts = [(Systematic(KT, 0.05 * v),) if kind == "shared" else () for v in (10.7, 10.0)]
            one = of_repeats(
                "t", 10.7 * (1 + shift) + draw.normal(0, 0.2, size=5), "N m", systematic=parts[0]
            )
            other = of_repeats(
                "t", 10.0 * (1 + shift) + draw.normal(0, 0.5, size=8), "N m", systematic=parts[1]
            )
        found = difference_of(other, one, (KT,))
        held += _holds(found.difference.combined, 0.7)
    return held


@pytest.mark.parametrize("kind", ["welch", "lopsided", "shared"])
@draws(400)
def test_the_interval_of_a_difference_holds_the_truth(kind: str, count: int):
    """Not less often than 95 %; Welch's freedom and half-widths in squares may hold more."""
    held = covered(kind, count)
    assert stats.binomtest(held, count, 0.95, alternative="less").pvalue > 0.01
    assert held < 0.985 * count
