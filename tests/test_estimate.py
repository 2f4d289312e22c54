"""What an estimate says of itself: combination, bounds, what is not determined."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from campaign.estimate import Estimate, Kind, Origin, Systematic
from campaign.reason import Reason

KT = Systematic("torque constant", 0.3)
J = Systematic("inertia", 0.4)
UNKNOWN = Systematic("alignment")
NORMAL, ONE_SIDED = 1.959963984540054, 1.6448536269514722
"""Quantiles of the normal distribution for 95 %, as printed in tables."""


def test_half_widths_add_in_squares_and_stay_lopsided() -> None:
    told = Estimate("torque", 10.0, "N m", 9.0, 13.0, 0.95, systematic=(KT, J, UNKNOWN))
    wide = NORMAL * 0.5  # 0.3 and 0.4 in squares
    assert told.combined == pytest.approx((10.0 - math.hypot(1, wide), 10.0 + math.hypot(3, wide)))
    assert told.half_width == pytest.approx(0.5 * (math.hypot(1, wide) + math.hypot(3, wide)))


def test_a_part_of_unknown_size_widens_nothing() -> None:
    told = Estimate("torque", 10.0, "N m", 9.0, 13.0, 0.95, systematic=(UNKNOWN,))
    assert told.combined == (9.0, 13.0)


def test_an_open_side_stays_open() -> None:
    told = Estimate("sigma", 0.0, "N m", None, 2.0, 0.95, systematic=(KT,))
    assert told.combined == (None, pytest.approx(math.hypot(2.0, NORMAL * 0.3)))
    assert math.isnan(told.half_width)


def test_a_bound_gives_way_by_what_shifts_it() -> None:
    """A load that had not slid at 10 N m holds less where the torque constant is smaller."""
    least = Estimate("torque", 10.0, "N m", kind="at least", systematic=(KT,))
    most = Estimate("torque", 10.0, "N m", kind="at most", systematic=(KT,))
    assert least.combined == (pytest.approx(10.0 - ONE_SIDED * 0.3), None)
    assert most.combined == (None, pytest.approx(10.0 + ONE_SIDED * 0.3))
    assert not least.has_interval
    assert least.says_enough


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_value_is_finite_or_not_determined(value: float) -> None:
    with pytest.raises(ValueError, match="finite"):
        Estimate("torque", value, "N m")
    with pytest.raises(ValueError, match="finite"):
        Estimate("torque", math.inf, "N m", origin=Origin.NOT_DETERMINED)


@pytest.mark.parametrize("kind", ["number", "count", "quantile"])
@pytest.mark.parametrize(("low", "high"), [(10.1, 11.0), (9.0, 9.9), (10.1, None), (None, 9.9)])
def test_an_interval_holds_its_own_value(kind: Kind, low: float | None, high: float | None) -> None:
    with pytest.raises(ValueError, match=r"torque: 10.0 lies outside of its interval"):
        Estimate("torque", 10.0, "N m", low, high, kind=kind)
    with pytest.raises(ValueError, match="outside"):
        replace(Estimate("torque", 10.0, "N m", 9.0, 11.0), value=12.0)


def test_a_value_may_lie_at_an_end_or_off_it_by_rounding() -> None:
    assert Estimate("torque", 0.3, "N m", 0.1 + 0.2, 0.4).value == 0.3
    assert Estimate("torque", -10.0, "N m", -10.0, -10.0).half_width == 0.0


def test_nothing_known_is_not_determined() -> None:
    told = Estimate.without_interval("torque", math.nan, "N m", Reason("test", "no ramp slid"))
    assert told.origin is Origin.NOT_DETERMINED
    assert told.says_enough
