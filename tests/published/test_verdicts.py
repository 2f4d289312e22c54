"""Verdicts, with intervals and printed digits worked out by hand."""

from __future__ import annotations

import pytest

from campaign.estimate import OF_ONE_TRIAL, Estimate, Origin, Systematic
from campaign.published.values import Cell
from campaign.published.verdicts import ReproducedNumber, deviation, judge, reproduced
from campaign.result import Finding


def cell(value: float, relation: str = "equal", decimals: int | None = 1) -> Cell:
    return Cell("1", "r", "c", "error", "mrad", value, {}, relation=relation, decimals=decimals)


@pytest.mark.parametrize(
    ("found", "verdict"),
    [
        (ReproducedNumber(10.04), "agrees"),
        (ReproducedNumber(10.04, 9.1, 10.98), "agrees"),
        (ReproducedNumber(10.04, 1.0, 99.0), "undecided"),  # it may agree by luck
        (ReproducedNumber(10.06), "differs"),
        (ReproducedNumber(10.5, 9.9, 11.1), "compatible"),
        (ReproducedNumber(10.5, 9.55, 11.55), "compatible"),  # half-width 1.0, 10 % of 10
        (ReproducedNumber(10.5, 9.45, 11.55), "undecided"),
        (ReproducedNumber(10.5, 10.1, 10.9), "differs"),
        (ReproducedNumber(19.0, 9.9, 28.1), "undecided"),
        (ReproducedNumber(30.0, 10.1, 49.9), "differs"),
        (ReproducedNumber(10.5, 9.9, None), "undecided"),
        (ReproducedNumber(9.5, None, 10.1), "undecided"),
        (ReproducedNumber(10.5, 10.1, None), "differs"),
        (ReproducedNumber(9.5, None, 9.9), "differs"),
        (ReproducedNumber(10.0, 10.0, None, "at least"), "not reached"),
        (ReproducedNumber(12.0, None, 12.0, "at most"), "not reached"),
    ],
)
def test_a_number(found: ReproducedNumber, verdict: str) -> None:
    assert judge(cell(10.0), found) == verdict


@pytest.mark.parametrize(
    ("relation", "found", "verdict", "percent"),
    [
        ("at least", ReproducedNumber(10.0), "met", None),
        ("at least", ReproducedNumber(9.0), "missed", -10.0),
        ("at most", ReproducedNumber(10.0), "met", None),
        ("at most", ReproducedNumber(11.0), "missed", 10.0),
        ("at least", ReproducedNumber(11.0, 10.0, 12.0), "met", None),
        ("at least", ReproducedNumber(11.0, 9.9, 12.1), "undecided", None),
        ("at least", ReproducedNumber(9.0, 7.9, 10.1), "undecided", None),
        ("at least", ReproducedNumber(9.0, 8.1, 9.9), "missed", -10.0),
        ("at most", ReproducedNumber(9.0, 8.0, 10.0), "met", None),
        ("at most", ReproducedNumber(9.0, 7.9, 10.1), "undecided", None),
        ("at most", ReproducedNumber(11.0, 9.9, 12.1), "undecided", None),
        ("at most", ReproducedNumber(11.0, 10.1, 11.9), "missed", 10.0),
        # Open on one side.
        ("at least", ReproducedNumber(11.0, 10.5, None), "met", None),
        ("at least", ReproducedNumber(11.0, None, 12.0), "undecided", None),
        ("at most", ReproducedNumber(9.0, None, 9.5), "met", None),
        ("at most", ReproducedNumber(9.0, 8.0, None), "undecided", None),
        # Never passed up to 12: the threshold itself was not seen, and meets nothing.
        ("at least", ReproducedNumber(12.0, 12.0, None, "at least"), "not reached", None),
        ("at least", ReproducedNumber(9.0, 9.0, None, "at least"), "not reached", None),
        ("at most", ReproducedNumber(12.0, 12.0, None, "at least"), "missed", None),
        ("at least", ReproducedNumber(9.0, None, 9.0, "at most"), "missed", None),
        ("at most", ReproducedNumber(9.0, None, 9.0, "at most"), "not reached", None),
        ("near", ReproducedNumber(10.04), "agrees", pytest.approx(0.4)),
        ("near", ReproducedNumber(10.4), "differs", pytest.approx(4.0)),
        ("rank", ReproducedNumber(10.0), "agrees", None),
        ("rank", ReproducedNumber(11.0, 9.0, 13.0), "differs", None),
    ],
)
def test_claims_and_ranks(
    relation: str, found: ReproducedNumber, verdict: str, percent: float | None
) -> None:
    published = cell(10.0, relation)
    assert judge(published, found) == verdict
    assert deviation(published, found, judge(published, found)) == percent


@pytest.mark.parametrize("relation", ["equal", "near", "at most", "at least", "rank"])
@pytest.mark.parametrize("ends", [(None, None), (9.9, 10.1), (1.0, None)])
def test_what_is_not_determined_decides_nothing(
    relation: str, ends: tuple[float | None, float | None]
) -> None:
    estimate = Estimate("error", 10.0, "mrad", *ends, origin=Origin.NOT_DETERMINED)
    found = reproduced(Finding.of(estimate, {}), "mrad")
    assert judge(cell(10.0, relation), found) == "undecided"
    assert deviation(cell(10.0, relation), found, judge(cell(10.0, relation), found)) is None


def test_without_printed_digits_only_the_interval_can_agree() -> None:
    assert judge(cell(10.0, decimals=None), ReproducedNumber(10.04)) == "differs"
    assert judge(cell(10.0, decimals=None), ReproducedNumber(10.04, 9.9, 10.2)) == "compatible"


def test_the_interval_is_the_combined_one_in_the_printed_unit() -> None:
    """Half-widths 0.3 of scatter and 0.4 of a systematic part: 0.5 together."""
    part = Systematic("torque constant", 0.4e-3 / 1.959964)
    estimate = Estimate("error", 10e-3, "rad", 9.7e-3, 10.3e-3, 0.95, systematic=(part,))
    found = reproduced(Finding.of(estimate, {}), "mrad")
    assert (found.low, found.high) == (pytest.approx(9.5), pytest.approx(10.5))
    with pytest.raises(ValueError, match="no multiple"):
        reproduced(Finding.of(estimate, {}), "kg m^2")


@pytest.mark.parametrize(
    ("ends", "calibration", "low", "high"),
    [
        ((9.7, 10.3), 0.4, 9.5, 10.5),  # half-widths 0.3 and 0.4 add in squares
        ((9.7, 10.3), None, 9.7, 10.3),
        ((None, None), 0.4, 9.6, 10.4),
        ((None, None), None, None, None),
        ((10.0, 10.3), 0.4, 9.6, 10.5),
        ((9.7, None), 0.4, 9.5, None),
    ],
)
def test_what_the_calibration_leaves_open_adds_in_squares(
    ends: tuple[float | None, float | None],
    calibration: float | None,
    low: float | None,
    high: float | None,
) -> None:
    found = reproduced(Finding.of(Estimate("error", 10.0, "mrad", *ends), {}), "mrad", calibration)
    assert (found.low, found.high) == (pytest.approx(low), pytest.approx(high))


def test_the_scatter_within_one_trial_is_no_interval() -> None:
    """It is 1 % of the value; what trials share, and what the bench leaves open, is not in it."""
    one = Estimate("error", 10.0, "mrad", 9.9, 10.1, 0.95, reason=OF_ONE_TRIAL())
    alone = reproduced(Finding.of(one, {}), "mrad")
    assert (alone.low, alone.high) == (None, None)
    assert alone.reason in OF_ONE_TRIAL
    calibrated = reproduced(Finding.of(one, {}), "mrad", 0.6)
    assert calibrated.high == pytest.approx(10.0 + (0.1**2 + 0.6**2) ** 0.5)
    assert not calibrated.calibration_alone
    assert reproduced(Finding("error", 10.0, "mrad", {}), "mrad", 0.6).calibration_alone


def test_what_a_calibration_may_lose_decides_nothing() -> None:
    found = reproduced(Finding.of(Estimate("error", 10.0, "mrad"), {}), "mrad", lost=True)
    assert judge(cell(10.0), found) == judge(cell(20.0), found) == "undecided"
