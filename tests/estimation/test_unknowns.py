"""Shares of ranges: ends, middles and slopes by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from campaign.estimation.unknowns import Unknown, shares_of, values_at

LINEAR = Unknown("viscous", 5.0, 40.0, 20.0)
DECADES = Unknown("stiffness", 1e2, 1e6, 1e3, logarithmic=True)


def test_ends_middle_and_beyond() -> None:
    assert [LINEAR.value(share) for share in (0.0, 0.5, 1.0, 1.2)] == [5.0, 22.5, 40.0, 47.0]
    found = [DECADES.value(share) for share in (0.0, 0.5, 1.0, -0.25)]
    assert found == pytest.approx([1e2, 1e4, 1e6, 1e1], rel=1e-12)


def test_shares_are_the_inverse() -> None:
    shares = np.array([0.3, 0.7])
    values = values_at((LINEAR, DECADES), shares)
    assert values == pytest.approx((15.5, 10**4.8), rel=1e-12)
    assert shares_of((LINEAR, DECADES), values) == pytest.approx(shares, rel=1e-12)


def test_slopes() -> None:
    """35 everywhere; ln(1e4) times the value."""
    assert LINEAR.slope(0.3) == 35.0
    assert DECADES.slope(0.5) == pytest.approx(1e4 * 4 * math.log(10), rel=1e-12)


@pytest.mark.parametrize(
    ("lower", "upper", "start", "logarithmic", "why"),
    [
        (2.0, 1.0, 1.5, False, "the upper one is greater"),
        (1.0, 1.0, 1.0, False, "the upper one is greater"),
        (0.0, math.inf, 1.0, False, "bounds are finite"),
        (0.0, 1.0, 0.5, True, "above zero"),
        (1.0, 2.0, 2.5, False, "2.5 is not between"),
        (1.0, 2.0, math.nan, False, "nan is not between"),
    ],
)
def test_what_makes_no_sense_is_refused(
    lower: float, upper: float, start: float, logarithmic: bool, why: str
) -> None:
    with pytest.raises(ValueError, match=f"x: .*{why}"):
        Unknown("x", lower, upper, start, logarithmic)
