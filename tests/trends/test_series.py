"""What is followed: which points take part, with which errors of their own."""

from __future__ import annotations

import math
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

import numpy as np
import pytest

from campaign.estimate import Estimate, Origin, Systematic
from campaign.reason import Reason
from campaign.trends.covariates import Covariate
from campaign.trends.members import Member
from campaign.trends.rig_trends import WITHIN, TrendSeries, Verdict, _followed, _judged
from campaign.trends.series import Collected, Series

CALIBRATED = "torque constant"


def member(number: int, constant: str = "one") -> Member:
    return Member(
        number,
        SimpleNamespace(name=f"run-{number}"),  # type: ignore[arg-type]
        datetime(2026, 1, 1, tzinfo=UTC) + timedelta(days=number),
        (),
        {CALIBRATED: constant} if constant else {},
    )


def number(value: float, half: float | None = 0.1, **more: object) -> Estimate:
    if half is None:
        return Estimate.without_interval("tc", value, "N m", Reason("test", "single"), **more)
    error = half / 1.96
    return Estimate(
        "tc", value, "N m", value - half, value + half, 0.95, standard_error=error,
        **more,  # type: ignore[arg-type]
    )  # fmt: skip


def series(*found: Estimate, constants: str = "") -> Series:
    keys = constants.split() or ["one"] * len(found)
    collected = Collected("N m")
    for n, (estimate, key) in enumerate(zip(found, keys, strict=True), start=1):
        collected.add(member(n, key), "map", estimate)
    return collected.series(test="map", title="Map", quantity="coulomb_torque",
                            name="Coulomb friction Tc", display="N m")  # fmt: skip


TIME = Covariate("time", "Time", "d", "month", 30.0, ordered=True, at=lambda m, _: 30.0 * m.number)


def judged(*all_of: Series) -> list[TrendSeries]:
    return _judged([_followed(each, TIME) for each in all_of], ordered=True)[0]


def test_what_is_no_number_takes_no_part_and_is_told():
    bound = Estimate("tc", 9.0, "N m", kind="at least")
    given = number(10.0, origin=Origin.GIVEN)
    found = series(number(10.0), number(math.nan, None), bound, given, number(10.5))
    assert [point.member.number for point in found.points] == [1, 5]
    assert str(found.reason) == (
        "found in 2 runs, not found in 1; a bound in 1; given, not measured in 1: three are the "
        "least"
    )
    (told,) = judged(found)
    assert told.verdict is Verdict.NOT_JUDGED
    assert told.reason == found.reason


def test_units_are_those_of_the_first_run():
    in_millis = Estimate("tc", 10_200.0, "mN m", 10_100.0, 10_300.0, 0.95, standard_error=51.0)
    found = series(number(10.0), in_millis, number(10.1))
    assert found.values.tolist() == pytest.approx([10.0, 10.2, 10.1])
    assert np.sqrt(np.diag(found.own()[0])) == pytest.approx([0.051] * 3, rel=0.1)
    with pytest.raises(ValueError, match="no multiple"):
        series(number(10.0), Estimate("tc", 1.0, "rad"))


def test_points_without_intervals_are_weighed_alike():
    found = series(number(10.0), number(10.2, None), number(10.1), number(10.4))
    assert not found.own()[0].any()
    assert found.bare == "1 of 4 have no interval: weighed alike"
    quantiles = series(*(number(10.0 + n, kind="quantile") for n in range(3)))
    assert not quantiles.own()[0].any()


def test_an_error_that_all_have_in_common_cancels_and_one_of_two_calibrations_does_not():
    part = (Systematic(CALIBRATED, 0.5),)
    found = [number(10.0 + 0.1 * (n % 3), systematic=part) for n in range(6)]
    own, cancelled, unknown = series(*found).own()
    assert cancelled == (CALIBRATED,)
    assert not unknown
    assert own == pytest.approx(np.diag(np.diag(own)))
    assert np.max(own) < 0.01
    own, cancelled, unknown = series(*found, constants="one one one two two two").own()
    assert not cancelled
    assert own[0, 2] == pytest.approx(0.25)
    assert own[0, 4] == 0.0
    assert own[5, 5] == pytest.approx(0.25, abs=0.01)


def test_a_calibration_of_unknown_error_is_told_where_it_is_not_the_same():
    part = (Systematic(CALIBRATED, None),)
    found = [number(10.0 + 0.1 * (n % 3), systematic=part) for n in range(6)]
    assert series(*found).own()[1:] == ((CALIBRATED,), ())
    two = series(*found, constants="one one one two two two")
    assert two.own()[1:] == ((), (CALIBRATED,))
    (told,) = judged(two)
    assert "not the same in all runs" in told.notes[0]


def test_an_error_of_each_evaluation_is_its_own():
    part = (Systematic("interpolation", 0.5),)
    own, cancelled, _ = series(*(number(10.0 + n, systematic=part) for n in range(4))).own()
    assert not cancelled
    assert np.diag(own) == pytest.approx(0.25, abs=0.01)
    assert own[0, 1] == 0.0


def test_what_is_the_same_in_all_runs_is_no_test():
    (told,) = judged(series(*(number(10.0, None) for _ in range(6))))
    assert told.verdict is Verdict.NOT_JUDGED
    assert "the same in all runs" in str(told.reason)


@pytest.mark.slow
def test_verdicts_are_of_all_numbers_together():
    """A p value that is declared alone is not among a hundred."""
    rng = np.random.default_rng(3)
    values = 10 + 0.015 * np.arange(8) + 0.01 * rng.standard_normal(8)
    weak = series(*(number(v, 0.02) for v in values))
    alone = judged(weak)[0]
    assert alone.verdict is not Verdict.NOT_SHOWN
    still = [
        series(*(number(v, 0.02) for v in 10 + 0.01 * rng.standard_normal(8))) for _ in range(60)
    ]
    among = judged(weak, *still)[0]
    assert among.p == alone.p
    assert among.verdict is Verdict.NOT_SHOWN
    assert among.detectable["trend"] > alone.detectable["trend"]


def test_a_change_within_every_single_interval_is_told_as_one():
    """A misfit that runs share moves with what does change: each run's interval knows of it."""
    rng = np.random.default_rng(4)
    values = 30 + 0.2 * np.arange(8) + 0.02 * rng.standard_normal(8)
    (wide,) = judged(series(*(number(v, 5.0) for v in values)))
    (narrow,) = judged(series(*(number(v, 0.05) for v in values)))
    assert wide.verdict is narrow.verdict is Verdict.DRIFTS
    assert wide.notes == (WITHIN,)
    assert not narrow.notes
    (still,) = judged(series(*(number(30 + 0.02 * n, 5.0) for n in (0, 2, 1, 0, 2, 1, 0, 2))))
    assert still.verdict is Verdict.NOT_SHOWN
    assert not still.notes, "of what was not declared nothing is said"
