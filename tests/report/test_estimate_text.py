"""A number as a reader is shown it: interval, unit, bound, flag; and what its text leaves out."""

from __future__ import annotations

import math
from typing import Any

import pytest

from campaign.api.estimate_text import estimate_text, remarks, shows_interval
from campaign.estimate import Estimate, Origin, Systematic
from campaign.reason import Reason


def found(
    value: float, low: float | None = None, high: float | None = None, **more: Any
) -> Estimate:
    return Estimate("torque", value, more.pop("unit", "N m"), low, high, 0.95, **more)


def why(text: str) -> Reason:
    return Reason("test", text)


@pytest.mark.parametrize(
    ("estimate", "display", "text"),
    [
        (found(25.3, 25.2, 25.4), "", "25.30 ± 0.10 N·m"),
        (found(0.26e-3, 0.25e-3, 0.27e-3, unit="rad"), "mrad", "0.260 ± 0.010 mrad"),
        (found(24.5, kind="at least", reason=why("a bound")), "", "at least 24.5 N·m"),
        (found(24.5, kind="at most", reason=why("a bound")), "", "at most 24.5 N·m"),
        (found(0.0, None, 0.5, origin=Origin.AT_BOUND), "", "0 (≤ 0.5) N·m (at its bound)"),
        (
            found(2.64, 2.44, 2.84, origin=Origin.CONTRADICTED, reason=why("bent")),
            "",
            "2.64 ± 0.20 N·m (model contradicted)",
        ),
        (found(1165.0, origin=Origin.ASSUMED, reason=why("a rule")), "", "1165 N·m (assumed)"),
        (
            found(math.nan, origin=Origin.NOT_DETERMINED, reason=why("no ramp slid")),
            "",
            "not determined (no ramp slid)",
        ),
        # A number that is there and says nothing is not shown: somebody would take it for one.
        (
            found(5.0, 1.0, 9.0, origin=Origin.NOT_DETERMINED, reason=why("too wide")),
            "",
            "not determined (too wide)",
        ),
        (found(math.nan, origin=Origin.NOT_DETERMINED), "", "not determined"),
        # A systematic part is in the interval: 0.04 by scatter, 1.96 * 0.06 beside it.
        (found(1.1, 1.06, 1.14, systematic=(Systematic("x", 0.06),)), "", "1.10 ± 0.12 N·m"),
    ],
)
def test_a_number_as_text(estimate: Estimate, display: str, text: str) -> None:
    assert estimate_text(estimate, display) == text


def test_an_interval_is_left_out_only_where_it_is_narrower_than_the_digits() -> None:
    value, half = 0.0040000173, 1.07e-7  # 2.7e-5 of it: its digits end where it does
    wide = found(value, value - half, value + half)
    narrow = found(value, value - 0.1 * half, value + 0.1 * half)
    assert estimate_text(wide) == "(4.00002 ± 0.00011) × 10⁻³ N·m"
    assert estimate_text(narrow) == "0.0040000 N·m"
    assert [shows_interval(each) for each in (wide, narrow)] == [True, False]


def test_what_numbers_do_not_say_is_told_once() -> None:
    numbers = (
        found(1.0, reason=why("a single value")),
        found(1.0, 0.9, 1.1, reason=why("the interval is of one trial")),
        found(1.0, 0.9, 1.1, systematic=(Systematic("dwell"), Systematic("inertia", 0.1))),
        found(1.0, origin=Origin.GIVEN, reason=why("it was set")),
        found(math.nan, origin=Origin.NOT_DETERMINED, reason=why("lost")),
        found(1.0, kind="at least", reason=why("a bound")),
    )
    assert list(remarks((*numbers, *numbers))) == [
        "Without an interval: a single value.",
        "The interval is of one trial.",
        "Not included in the intervals (size unknown): dwell.",
    ]
