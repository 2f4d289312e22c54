"""Which findings of a test are its key numbers."""

from __future__ import annotations

import math

import pytest

from campaign.estimate import Estimate, Origin
from campaign.experiments.interface import key
from campaign.experiments.post_processing.key_numbers import MOST, key_numbers
from campaign.published.draws import SEED
from campaign.result import Finding, Value
from tests.experiments.laboratory import MADE_UP

T_2 = 4.302653
"""Student's t, 97.5 %, two degrees of freedom: three draws."""


def found(name: str, value: float = 1.0, **conditions: Value) -> Finding:
    return Finding.of(Estimate(name, value, "N m", value - 0.1, value + 0.1, 0.95), conditions)


def test_quantities_stand_in_the_order_in_which_they_are_wanted() -> None:
    findings = [found("b", statistic="mean"), found("a", direction="positive"), found("a")]
    assert key_numbers(findings, [key("a"), key("b")]) == (*findings[1:], findings[0])
    assert key_numbers(findings, [key("a", direction="positive")]) == (findings[1],)
    assert key_numbers(findings, [key("a", direction=None)]) == tuple(findings), "not stated"


@pytest.mark.parametrize("wanted", [[], [key("of another analysis")]])
def test_without_any_of_these_all_findings_are_key_numbers(wanted: list) -> None:
    findings = [found("a"), found("b")]
    assert key_numbers(findings, wanted) == tuple(findings)


def test_of_a_long_sweep_the_first_and_the_last_place_stand_for_all() -> None:
    """By place and not by size: the largest of many values is large by chance, too."""
    sizes = [1.0, 9.0, 5.0, 0.1, 3.0]
    errors = [
        found("error", size, compensation=name, frequency=float(n))
        for n, size in enumerate(sizes)
        for name in ("none", "lugre")
    ]
    alone = [found("limit")]
    assert len(errors) > MOST
    assert key_numbers([*errors, *alone], [key("error"), key("limit")]) == (
        *errors[:2], *errors[-2:], *alone,
    )  # fmt: skip
    few = errors[: MOST - 1]
    assert key_numbers([*few, *alone], [key("error"), key("limit")]) == (*few, *alone)


def test_draws_are_one_number_the_median_and_where_one_more_lies() -> None:
    """Draws 9, 10, 11: mean 10, deviation 1; one more lies within t √(1 + 1/3) = 4.97."""
    draws = [found("torque", value, **{SEED: seed}) for seed, value in enumerate((9.0, 11.0, 10.0))]
    (told,) = key_numbers(draws, [key("torque")], (0, 1, 2))
    half = T_2 * math.sqrt(4 / 3)
    assert told.value == 10.0
    assert told.known.low == pytest.approx(10.0 - half)
    assert told.known.high == pytest.approx(10.0 + half)
    assert told.conditions == {}


def test_a_draw_without_a_number_leaves_it_open() -> None:
    lost = Estimate("torque", math.nan, "N m", reason=MADE_UP(), origin=Origin.NOT_DETERMINED)
    draws = [found("torque", 9.0, **{SEED: 0}), Finding.of(lost, {SEED: 1})]
    (told,) = key_numbers([*draws, found("torque", 10.0, **{SEED: 2})], [], (0, 1, 2))
    assert not told.known.is_determined
    (missing,) = key_numbers(draws[:1], [], (0, 1, 2))
    assert not missing.known.is_determined, "two draws have none at all"


def test_one_seed_is_no_draw() -> None:
    one = found("torque", **{SEED: 1})
    assert key_numbers([one], [], (1,)) == (one,)
