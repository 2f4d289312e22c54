"""Where one more value will lie among repetitions."""

from __future__ import annotations

import numpy as np
import pytest

from campaign.estimation.intervals import of_next
from tests.estimation.coverage import draws, rejected

T2 = 4.302653  # Student's t with 2 degrees of freedom, 97.5 %: any table


def test_the_next_value_of_three() -> None:
    """Logarithms -0.1, 0, 0.1: mean 0, sd 0.1; half t 0.1 sqrt(1 + 1/3)."""
    found = of_next("error", np.exp([-0.1, 0.0, 0.1]), "rad")
    half = T2 * 0.1 * np.sqrt(4 / 3)
    assert found.value == pytest.approx(1.0)
    assert (found.low, found.high) == pytest.approx((np.exp(-half), np.exp(half)), rel=1e-6)
    assert of_next("error", [1.0], "rad").reason


@draws(400)
def test_the_next_value_lies_there(count: int) -> None:
    held = {}
    for size in (2, 3, 5, 20):
        random = np.random.default_rng([514, size])
        drawn = np.exp(0.01 * random.standard_normal((count, size + 1)))
        found = [(of_next("error", row[:-1], ""), row[-1]) for row in drawn]
        held[f"{size}"] = [told.low <= following <= told.high for told, following in found]
    assert rejected(held) == {}
