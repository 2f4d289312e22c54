"""A number in a sentence has its interval, and a ratio is more or less only where that is shown."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from campaign.api.conclusion_sentences import is_decided, remarks, sentence, words
from campaign.estimate import Estimate, Origin, Systematic
from campaign.reason import NONE, Reason
from campaign.result import Amount, Conclusion, Factor

REASON = Reason("test", "a single value")


def ratio(value: float, low: float | None = None, high: float | None = None, **more) -> Factor:
    reason = NONE if low is not None or high is not None else REASON
    estimate = Estimate("ratio", value, "", low, high, 0.95, reason=reason, **more)
    return Factor(estimate, above="less", below="more")


@pytest.mark.parametrize(
    ("factor", "said"),
    [
        # Error without over error with: above 1 is less.
        (ratio(2.9, 2.7, 3.1), "2.9 times less (2.7 to 3.1)"),
        (ratio(4.04, 3.2, 5.8), "4.0 times less (3.2 to 5.8)"),
        (ratio(820.4, 800.0, 850.0), "820 times less (800 to 850)"),
        # Below 1 it is the reciprocal, whose ends change places: 1/0.8, 1/0.84, 1/0.76.
        (ratio(0.8, 0.76, 0.84), "1.25 times more (1.19 to 1.32)"),
        # What touches or holds 1 is no difference, whatever the value says.
        (ratio(2.9, 0.9, 9.0), "no difference that the data show (0.9 to 9.0 times)"),
        (ratio(1.5, 1.0, 2.25), "no difference that the data show (1.0 to 2.2 times)"),
        (ratio(0.7, 0.4, 1.0), "no difference that the data show (0.4 to 1.0 times)"),
        (ratio(1.0, 1.0, 1.0), "no difference that the data show"),
        # An end that would be rounded to 1 keeps the digit that tells it from 1.
        (ratio(1.3, 1.004, 1.6), "1.300 times less (1.004 to 1.600)"),
        # So narrow that the interval is left out: as many digits as tell the ratio itself from 1.
        (ratio(1.5, 1.49999, 1.50001), "1.5 times less"),
        (ratio(1.00002, 1.00001, 1.00003), "0.00200 % less"),
        (ratio(0.999998, 0.999997, 0.999999), "0.000200 % more"),
        # Open on one side: decided only by the side that is there.
        (ratio(1.1, 1.06, 1.14), "9.1 ± 3.3 % less"),  # 0.91 of what it was
        (ratio(0.9, 0.87, 0.93), "11.1 ± 3.7 % more"),
        (replace(ratio(1.065, 1.054, 1.076), above="more", below="less"), "6.5 ± 1.1 % more"),
        (replace(ratio(0.9, 0.87, 0.93), above="more", below="less"), "10.0 ± 3.0 % less"),
        (
            replace(ratio(0.9, 0.87, 0.93), above="stiffer", below="softer"),
            "1.11 times softer (1.08 to 1.15)",
        ),
        (ratio(0.9, -0.1, 0.93), "1.11 times more (at least 1.08)"),
        (ratio(1.1, 1.06, None), "9.09 % less (at least 5.66)"),
        (ratio(1.1, kind="at least"), "at least 9.09 % less"),
        (ratio(2.9, 2.7, None), "2.9 times less (at least 2.7)"),
        (ratio(1.9, 1.00004, None), "1.9 times less (at least 1.00004)"),
        (ratio(2.9, None, 3.1), "no difference that the data show (at most 3.1 times)"),
        (ratio(0.5, None, 0.8), "2 times more (at least 1.25)"),
        (ratio(0.5, 0.3, None), "no difference that the data show (at least 0.3 times)"),
        (ratio(0.1, 0.0, 0.2), "10 times more (at least 5)"),
        (ratio(0.1, -0.1, 0.2), "10 times more (at least 5)"),
        (ratio(0.1, 1e-320, 0.2), "10 times more (at least 5)"),  # 1e320 is no number
        (ratio(1e-320, None, 0.2), "at least 5 times more"),
        # Bounds: the truth lies beyond them.
        (ratio(3.0, kind="at least"), "at least 3 times less"),
        (ratio(0.25, kind="at most"), "at least 4 times more"),
        (ratio(0.8, kind="at least"), "no difference that the data show (at least 0.8 times)"),
        (ratio(3.0, kind="at most"), "no difference that the data show (at most 3 times)"),
        # Nothing to be sure by.
        (ratio(7.4), "a ratio of 7.4 without an interval"),
        (ratio(0.0), "a ratio of 0"),
        (ratio(0.0, -0.5, 0.4), "a ratio of 0.00 (−0.50 to 0.40)"),
        (ratio(-2.0, -3.0, -1.5), "a ratio of −2.00 (−3.00 to −1.50)"),
        (
            ratio(math.nan, origin=Origin.NOT_DETERMINED),
            "a ratio that is not determined (a single value)",
        ),
        (
            Factor(
                Estimate(
                    "r",
                    3.0,
                    "",
                    2.0,
                    4.0,
                    origin=Origin.NOT_DETERMINED,
                    reason=Reason("test", "wide"),
                )
            ),
            "a ratio that is not determined (wide)",
        ),
    ],
)
def test_a_ratio_in_words(factor: Factor, said: str) -> None:
    assert words(factor) == said


def test_a_systematic_part_can_take_the_difference_away() -> None:
    """1.10 ± 0.04 by scatter; 0.06 (1 sigma) beside it makes it 1.10 ± 0.12."""
    by_scatter = ratio(1.10, 1.06, 1.14)
    assert words(by_scatter) == "9.1 ± 3.3 % less"
    shifted = ratio(1.10, 1.06, 1.14, systematic=(Systematic("torque constant", 0.06),))
    assert words(shifted) == "no difference that the data show (0.98 to 1.22 times)"


numbers = st.floats(-1e3, 1e6, allow_nan=False) | st.sampled_from([0.0, 1.0, 1 - 1e-9, 1 + 1e-9])
ends = st.none() | numbers


@st.composite
def ratios(draw: st.DrawFn) -> Factor:
    low, high = draw(ends), draw(ends)
    value = draw(numbers)
    known = sorted(each for each in (low, value, high) if each is not None)
    value = known[len(known) // 2] if low is not None and high is not None else value
    low = None if low is None else min(low, value, *([high] if high is not None else []))
    high = None if high is None else max(high, value)
    kind = draw(st.sampled_from(["number", "number", "at least", "at most"]))
    if kind != "number":
        low = high = None
    size = draw(st.none() | st.floats(0, 10))
    parts = () if size is None else (Systematic("cause", size),)
    return ratio(value, low, high, kind=kind, systematic=parts)


@given(ratios())
def test_no_word_of_a_difference_where_none_is_shown(factor: Factor) -> None:
    """The rule, told again from the numbers: by the end that is nearest to 1."""
    estimate, said = factor.estimate, words(factor)
    low, high = estimate.combined
    below_1, above_1 = high is not None and high < 1, low is not None and low > 1
    shown = (below_1 or above_1) and estimate.value > 0
    assert is_decided(factor) == shown
    assert bool(re.search(r"(times|%) (less|more)", said)) == shown
    if shown:
        assert ("less" in said) == above_1


@given(ratios())
def test_a_factor_that_is_told_lies_within_its_ends_and_away_from_1(factor: Factor) -> None:
    said = re.fullmatch(r"([\d.]+) times \w+ \(([\d.]+) to ([\d.]+)\)", words(factor))
    if said and "×" not in words(factor):
        value, low, high = map(float, said.groups())
        assert low <= value <= high
        assert low >= 1


def amount(value: float, low: float | None = None, high: float | None = None, **more) -> Amount:
    display = more.pop("display", "")
    return Amount(
        Estimate("torque", value, more.pop("unit", "N m"), low, high, 0.95, **more), display
    )


@pytest.mark.parametrize(
    ("part", "said"),
    [
        (amount(25.3, 25.2, 25.4), "25.30 ± 0.10 N·m"),
        (amount(0.26e-3, 0.25e-3, 0.27e-3, unit="rad", display="mrad"), "0.260 ± 0.010 mrad"),
        (amount(3e-6, unit="rad", display="urad", reason=Reason("test", "set")), "3 µrad"),
        (amount(24.5, kind="at least", reason=Reason("test", "a bound")), "at least 24.5 N·m"),
        (amount(24.5, kind="at most", reason=Reason("test", "a bound")), "at most 24.5 N·m"),
        (amount(0.0, None, 0.5, origin=Origin.AT_BOUND), "0 (≤ 0.5) N·m (at its bound)"),
        (
            amount(2.64, 2.44, 2.84, origin=Origin.CONTRADICTED, reason=Reason("test", "bent")),
            "2.64 ± 0.20 N·m (model contradicted)",
        ),
        (
            amount(1165.0, origin=Origin.ASSUMED, reason=Reason("test", "a rule")),
            "1165 N·m (assumed)",
        ),
        (amount(0.24, unit="Hz", origin=Origin.GIVEN, reason=Reason("test", "set")), "0.24 Hz"),
        # Settings that differ late in their digits are told apart; computed ones are shortened.
        (amount(33.0001, origin=Origin.GIVEN, reason=Reason("test", "set")), "33.0001 N·m"),
        (amount(100 / 3, origin=Origin.GIVEN, reason=Reason("test", "set")), "33.33 N·m"),
        (
            amount(math.nan, origin=Origin.NOT_DETERMINED, reason=Reason("test", "no ramp slid")),
            "not determined (no ramp slid)",
        ),
        # A number that is there and says nothing is not told: somebody would take it for one.
        (
            amount(5.0, 1.0, 9.0, origin=Origin.NOT_DETERMINED, reason=Reason("test", "too wide")),
            "not determined (too wide)",
        ),
        (amount(math.nan, origin=Origin.NOT_DETERMINED), "not determined"),
    ],
)
def test_a_number_in_words(part: Amount, said: str) -> None:
    assert words(part) == said


def test_an_interval_is_left_out_only_where_it_is_narrower_than_the_digits() -> None:
    value, half = 0.0040000173, 1.07e-7  # 2.7e-5 of it: its digits end where it does
    assert words(amount(value, value - half, value + half)) == "(4.00002 ± 0.00011) × 10⁻³ N·m"
    assert words(amount(value, value - 0.1 * half, value + 0.1 * half)) == "0.0040000 N·m"


def test_a_sentence_is_its_parts() -> None:
    said = sentence(Conclusion(("Friction at rest is ", amount(25.3, 25.2, 25.4), ".")))
    assert said == "Friction at rest is 25.30 ± 0.10 N·m."


def test_what_numbers_do_not_say_is_told_once() -> None:
    single = amount(1.0, reason=Reason("test", "a single value"))
    one_trial = amount(1.0, 0.9, 1.1, reason=Reason("test", "the interval is of one trial"))
    unknown = amount(1.0, 0.9, 1.1, systematic=(Systematic("dwell"), Systematic("inertia", 0.1)))
    given_ = amount(1.0, origin=Origin.GIVEN, reason=Reason("test", "it was set"))
    open_ = amount(math.nan, origin=Origin.NOT_DETERMINED, reason=Reason("test", "lost"))
    bound = amount(1.0, kind="at least", reason=Reason("test", "a bound"))
    parts = ("x", single, single, one_trial, unknown, given_, open_, bound)
    assert list(remarks([Conclusion(parts), Conclusion(parts)])) == [
        "Without an interval: a single value.",
        "The interval is of one trial.",
        "Of unknown size, and in no interval: dwell.",
    ]
