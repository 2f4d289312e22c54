"""Intervals that say too little: of one trial (in `test_judging`), and of a wrong model."""

from __future__ import annotations

import pytest

from campaign.api.analysis import AnalysedTest
from campaign.comparison.finding_pairs import pairs_of
from campaign.comparison.same_quantity import PairedTest
from campaign.estimate import Origin
from campaign.estimation.intervals import with_error
from campaign.physics.bench import Bench
from campaign.reason import NONE, Cause
from campaign.references.verdict import WRONG_MODEL, JudgedNumber
from campaign.result import Finding
from tests.comparison.test_judging import made_up

CONTRADICTS = Cause("exponent contradicted", "the points contradict the exponent of 2")


def torque(origin: Origin) -> Finding:
    one = with_error("torque", 26.0, "N m", 0.1, 9.0, "", origin=origin, reason=CONTRADICTS())
    return Finding.of(one, {"exponent": "2"})


def test_of(finding: Finding, bench: Bench) -> AnalysedTest:
    return made_up([finding], [{"speed": float(n)} for n in range(8)], bench)


test_of.__test__ = False  # type: ignore[attr-defined]


def pair_of(findings: list[Finding], bench: Bench) -> JudgedNumber:
    own, other = (test_of(each, bench) for each in findings)
    (pair,) = pairs_of(PairedTest(own, other, ((findings[0], findings[1]),), (), ()))
    return pair


@pytest.mark.parametrize("side", [0, 1])
def test_a_number_of_a_model_that_the_data_contradict_is_not_judged(
    platform: Bench, side: int
) -> None:
    findings = [torque(Origin.MEASURED), torque(Origin.MEASURED)]
    findings[side] = torque(Origin.CONTRADICTED)
    told = pair_of(findings, platform)
    assert told.reason in WRONG_MODEL
    assert not told.testable
    assert str(told.reason).startswith(("the reference", "the other")[side])
    assert str(CONTRADICTS()) in str(told.reason)


def test_a_measured_number_is_judged(platform: Bench) -> None:
    told = pair_of([torque(Origin.MEASURED)] * 2, platform)
    assert told.reason == NONE
    assert told.testable
