"""Sentences of several draws of a random bench are one, with the spread of its numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence

import pytest

from campaign.api.conclusion_sentences import sentence
from campaign.estimate import Estimate, Origin
from campaign.experiments.post_processing.draws import merged
from campaign.experiments.post_processing.merged_sentences import concluded
from campaign.experiments.shared.conclusion_parts import SET
from campaign.result import Amount, Conclusion, Factor, Result
from tests.experiments.laboratory import MADE_UP

T_2 = 4.302653
"""Student's t, 97.5 %, two degrees of freedom: three draws."""


def torque(value: float, name: str = "torque") -> Amount:
    if math.isnan(value):
        lost = Estimate(name, value, "N m", reason=MADE_UP(), origin=Origin.NOT_DETERMINED)
        return Amount(lost, "N m")
    return Amount(Estimate(name, value, "N m", value - 0.1, value + 0.1, 0.95), "N m")


def draw(value: float, ratio: float = 2.0, position: float = 1.0) -> tuple[Conclusion, ...]:
    place = Amount(Estimate("setting", position, "rad", origin=Origin.GIVEN, reason=SET()))
    factor = Factor(Estimate("r", ratio, "", ratio - 0.01, ratio + 0.01, 0.95))
    return (
        Conclusion(("It takes ", torque(value), " at ", place, ".")),
        Conclusion(("Against the other: ", factor, ".")),
    )


def said(draws: Sequence[tuple[Conclusion, ...]]) -> list[str]:
    return [sentence(each) for each in concluded(dict(enumerate(draws)))]


def test_a_number_is_the_median_and_where_one_more_draw_lies() -> None:
    """Draws 9, 10, 11: mean 10, deviation 1; one more lies within t √(1 + 1/3) = 4.97."""
    first, _ = said([draw(9.0), draw(11.0), draw(10.0)])
    half = T_2 * math.sqrt(4 / 3)
    assert first == (
        "Median of 3 draws of the bench's scatter, and where one more lies: "
        f"It takes 10.0 ± {half:.1f} N·m at 1 rad."
    )


@pytest.mark.parametrize(
    ("ratios", "word"),
    [
        # 2.0, 2.1, 2.2: one more is 2.1 ± 0.5; all of them are above 1.
        ((2.0, 2.1, 2.2), "2.1 times more (1.6 to 2.6)"),
        # Each draw by itself is surely above 1, and the next may well not be: 1.5 ± 2.5.
        ((1.1, 1.3, 2.1), "no difference that the data show"),
    ],
)
def test_draws_show_a_difference_only_where_the_next_one_would(
    ratios: Sequence[float], word: str
) -> None:
    _, second = said([draw(10.0, ratio) for ratio in ratios])
    assert word in second


def test_a_draw_without_a_number_leaves_it_open() -> None:
    first, _ = said([draw(9.0), draw(math.nan), draw(10.0)])
    assert "It takes not determined (1 of 3 draws have no number)" in first


def test_a_draw_that_says_nothing_is_a_draw_without_a_number() -> None:
    first, _ = said([draw(9.0), (), draw(10.0)])
    assert "not determined (1 of 3 draws have no number)" in first


def test_a_sentence_that_draws_say_in_other_words_is_left_out() -> None:
    """At which position a draw has its largest torque is each draw's own."""
    (only,) = said([draw(9.0, position=1.0), draw(10.0, position=2.0)])
    assert only.startswith("Median of 2 draws of the bench's scatter, and where one more lies: Ag")


def test_draws_without_a_word_in_common_are_told_by_the_first() -> None:
    one = (Conclusion(("It takes ", torque(9.0), ".")),)
    other = (Conclusion(("Nothing moved.",)),)
    assert said([one, other]) == ["The draw of seed 0 alone: It takes 9.00 ± 0.10 N·m."]
    assert said([(), ()]) == []


def test_a_deviation_is_never_below_zero() -> None:
    sentences = [(Conclusion((torque(value, "standard_deviation"), ".")),) for value in (0.1, 1, 3)]
    (only,) = said(sentences)
    assert "(0" in only
    assert "−" not in only


def test_the_result_of_draws_has_them() -> None:
    results = {
        seed: Result(conclusions=draw(value), telling="one")
        for seed, value in ((44, 9.0), (1, 10.0))
    }
    told = merged(results)
    assert len(told.conclusions) == 2
    assert told.telling == "one"
