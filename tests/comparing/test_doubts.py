"""Intervals that say too little: of one trial (in `test_judging`), and of a wrong model."""

from __future__ import annotations

import pytest

from campaign.access.analysis import AnalysedTest
from campaign.comparing.doubts import WRONG_MODEL, contradicted, doubt
from campaign.estimate import Estimate, Origin
from campaign.identification.intervals import with_error
from campaign.physics.bench import Bench
from campaign.reason import NONE, Reason
from campaign.result import Finding
from tests.comparing.test_judging import made_up


def numbers(free: float, error: float, origin: Origin = Origin.GIVEN) -> list[Finding]:
    """A torque and an exponent, each with the exponent free and held at 2."""
    held = Estimate.without_interval(
        "exponent", 2.0, "", Reason("test", "held at 2"), origin=origin
    )
    return [
        Finding.of(with_error("torque", 25.0, "N m", 0.1, 9.0, ""), {"exponent": "free"}),
        Finding.of(with_error("torque", 26.0, "N m", 0.1, 9.0, ""), {"exponent": "2"}),
        Finding.of(with_error("exponent", free, "", error, 9.0, ""), {"exponent": "free"}),
        Finding.of(held, {"exponent": "2"}),
    ]


def test_of(findings: list[Finding], bench: Bench) -> AnalysedTest:
    return made_up(findings, [{"speed": float(n)} for n in range(8)], bench)


test_of.__test__ = False  # type: ignore[attr-defined]


def test_a_number_beside_one_that_was_held_where_the_data_exclude_it_is_doubted(platform: Bench):
    findings = numbers(0.9, 0.05)
    test = test_of(findings, platform)
    assert list(contradicted(test, findings[0])) == []
    (why,) = contradicted(test, findings[1])
    assert why == "exponent held at 2, found 0.90 ± 0.11"
    told = doubt((test, test), (findings[1], findings[1]))
    assert told in WRONG_MODEL
    assert str(told).startswith("the reference: exponent held at 2")
    assert "model that the data contradict" in str(told)
    assert doubt((test, test), (findings[0], findings[0])) == NONE


@pytest.mark.parametrize(
    ("free", "error", "origin"),
    [(1.9, 0.2, Origin.GIVEN), (0.9, 0.9, Origin.GIVEN), (0.9, 0.05, Origin.MEASURED)],
)
def test_where_the_data_leave_room_for_it_nothing_is_doubted(
    platform: Bench, free: float, error: float, origin: Origin
):
    findings = numbers(free, error, origin)
    test = test_of(findings, platform)
    assert doubt((test, test), (findings[1], findings[1])) == NONE


def test_the_doubt_of_one_side_is_enough(platform: Bench):
    sure, unsure = numbers(2.0, 0.1), numbers(0.9, 0.05)
    sides = test_of(sure, platform), test_of(unsure, platform)
    assert str(doubt(sides, (sure[1], unsure[1]))).startswith("the other: exponent held at 2")
