"""The place of a single value among repetitions, and where the next one will lie."""

from __future__ import annotations

import numpy as np
import pytest

from campaign.estimate import Estimate
from campaign.identification.place import of_next, place_in
from tests.identification.coverage import rejected

T2 = 4.302653  # Student's t with 2 degrees of freedom, 97.5 %: any table


def test_a_place_and_its_exact_interval() -> None:
    """None of ten: [0, 1 - 0.025^(1/10)]; three of ten: 0.0667 to 0.6525 (Clopper and Pearson)."""
    values = np.arange(10.0)
    below = place_in(values, -1.0)
    assert (below.value, below.low) == (0.0, 0.0)
    assert below.high == pytest.approx(1 - 0.025 ** (1 / 10))
    inside = place_in([Estimate("error", value, "rad") for value in values], 2.5)
    assert inside.value == 0.3
    assert (inside.low, inside.high) == pytest.approx((0.06674, 0.65245), abs=1e-5)
    assert place_in(values, 20.0).high == 1.0
    assert place_in([1.0, 2.0, np.nan], 2.0).value == 0.75  # a tie counts half
    with pytest.raises(ValueError, match="no values"):
        place_in([np.nan], 1.0)


def test_the_next_value_of_three() -> None:
    """Logarithms -0.1, 0, 0.1: mean 0, sd 0.1; half t 0.1 sqrt(1 + 1/3)."""
    found = of_next("error", np.exp([-0.1, 0.0, 0.1]), "rad")
    half = T2 * 0.1 * np.sqrt(4 / 3)
    assert found.value == pytest.approx(1.0)
    assert (found.low, found.high) == pytest.approx((np.exp(-half), np.exp(half)), rel=1e-6)
    assert of_next("error", [1.0], "rad").reason


@pytest.mark.parametrize(
    "count", [pytest.param(400, id="sample"), pytest.param(4000, id="all", marks=pytest.mark.soak)]
)
def test_the_next_value_lies_there(count: int) -> None:
    held = {}
    for size in (2, 3, 5, 20):
        random = np.random.default_rng([514, size])
        drawn = np.exp(0.01 * random.standard_normal((count, size + 1)))
        found = [(of_next("error", row[:-1], ""), row[-1]) for row in drawn]
        held[f"{size}"] = [told.low <= following <= told.high for told, following in found]
    assert rejected(held) == {}
