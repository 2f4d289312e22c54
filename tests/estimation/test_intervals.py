"""Intervals that were found in the logarithm, or that a factor multiplies."""

from __future__ import annotations

import math

import pytest

from campaign.estimate import Origin
from campaign.estimation.intervals import (
    SPANS_DECADES,
    WIDEST,
    exponential,
    multiplied,
    shifted_by,
    with_error,
)

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
    assert below.high / below.low == pytest.approx(1e3, rel=0.02)
    assert not above.has_interval
    assert above.value == pytest.approx(math.exp(2.0))


@pytest.mark.parametrize("factor", [0.5, -2.0])
def test_the_interval_and_all_parts_go_with_it(factor: float) -> None:
    one = shifted_by(with_error("torque", 3.0, "N m", 0.1, 10.0, ""), "constant", 0.06)
    own = multiplied(shifted_by(one, "inertia", None), factor)
    assert own.value == 3.0 * factor
    assert own.standard_error == 0.1 * abs(factor)
    assert sorted((own.low, own.high)) == [own.low, own.high]
    assert {own.low, own.high} == {one.low * factor, one.high * factor}
    assert [each.standard_uncertainty for each in own.systematic] == [0.06 * abs(factor), None]
