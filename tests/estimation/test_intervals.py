"""Intervals that were found in the logarithm."""

from __future__ import annotations

import math

import pytest

from campaign.estimate import Origin
from campaign.estimation.intervals import SPANS_DECADES, WIDEST, exponential, with_error

NORMAL = 1.959964  # 97.5 % of the normal distribution: any table


@pytest.mark.parametrize(("value", "error"), [(25.0, 227_000.0), (5000.0, 0.1), (-5000.0, 9.0)])
def test_what_no_float_holds_is_not_determined(value: float, error: float) -> None:
    found = exponential(with_error("stiffness", value, "", error, math.inf, ""), "N m/rad")
    assert (found.origin, found.has_interval) == (Origin.NOT_DETERMINED, False)
    assert found.reason in SPANS_DECADES
    assert (found.standard_error, found.freedom, found.level) == (None, None, None)
    assert math.isfinite(found.value) == (value == 25.0)


def test_an_interval_of_decades_is_none() -> None:
    widest = WIDEST / NORMAL
    below, above = (
        exponential(with_error("stiffness", 2.0, "", share * widest, math.inf, ""), "N m/rad")
        for share in (0.999, 1.001)
    )
    assert below.low is not None
    assert below.high is not None
    assert below.high / below.low == pytest.approx(1e3, rel=0.02)
    assert not above.has_interval
    assert above.value == pytest.approx(math.exp(2.0))
