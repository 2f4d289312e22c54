"""A trial that cannot be measured costs itself: it is counted with the reason, and left out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from campaign.channels import LOAD_RATE
from campaign.errors import ArchiveError
from campaign.estimate import Estimate, Origin
from campaign.estimation.intervals import SPANS_DECADES
from campaign.estimation.presliding import Presliding
from campaign.estimation.presliding_curve import Interface
from campaign.experiments import experiments
from campaign.experiments.analysis import result_of
from campaign.experiments.breakaway import experiment as breakaway
from campaign.experiments.interface import Experiment, TestData, TrialData, metrics
from campaign.experiments.post_processing.recording_checks import NOT_MEASURED
from campaign.result import Column, Finding, Result, Table
from tests.experiments.laboratory import Done, analyse, execute, finding, trials
from tests.experiments.test_breakaway import TWO, load_only
from tests.physics.benches import bench

COUNT, BAD = 20, 7
PULLS = [{"pull_rate": f"{0.1 + 0.01 * number:.2f} rad/s"} for number in range(COUNT)]
SHORT = {"stiffness": "200 N m/rad", "duration": "0.2 s", "sample_rate": "1 kHz"}
Measure = Callable[[TrialData], Sequence[Estimate]]


def top_rate(measure: Measure) -> Experiment:
    """A plug-in's kind, which handles no exception: the largest rate of each pull."""
    pull = experiments()["stick_slip"]

    def analyse(data: TestData) -> Result:
        found = [(item, metrics(item, measure)["top"]) for item in data.completed()]
        return Result(
            findings=tuple(Finding.of(top, {"trial": item.trial.number}) for item, top in found)
        )

    return Experiment("top_rate", "", pull.options, pull.trials, analyse, measure)


def failing(error: BaseException, calls: Counter[int], bad: Sequence[int] = (BAD,)) -> Measure:
    def measure(data: TrialData) -> Sequence[Estimate]:
        calls[data.trial.number] += 1
        if data.trial.number in bad:
            raise error
        return [Estimate("top", float(np.max(data.recording()[LOAD_RATE])), "rad/s")]

    return measure


@pytest.fixture(scope="module")
def pulls() -> tuple[Done, ...]:
    return execute(trials("stick_slip", bench(), SHORT, PULLS))


def of(kind: Experiment, done: Sequence[Done]) -> Result:
    return result_of(kind, TestData("pulls", kind.name, {}, tuple(done)))


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (RuntimeError("no such window\nsecond line"), "RuntimeError: no such window"),
        (OverflowError("math range error"), "OverflowError: math range error"),
        (ValueError("the load never moved"), "the load never moved"),
        (SystemExit(0), "SystemExit: 0"),
    ],
)
def test_one_bad_trial_costs_that_trial(
    pulls: tuple[Done, ...], error: BaseException, told: str
) -> None:
    calls: Counter[int] = Counter()
    result = of(top_rate(failing(error, calls)), pulls)
    good = [number for number in range(1, COUNT + 1) if number != BAD]
    assert [each.conditions["trial"] for each in result.findings] == good
    (left_out,) = result.left_out
    assert (left_out.number, left_out.label) == (BAD, pulls[BAD - 1].trial.label)
    assert left_out.reason in NOT_MEASURED
    assert left_out.reason.text == told
    assert result.notes == (
        f"{left_out.label} (trial {BAD}): {told}; not analysed (1 of {COUNT} trials).",
    )
    assert max(calls.values()) == 1


def test_all_bad_trials_leave_nothing_but_the_account(pulls: tuple[Done, ...]) -> None:
    everyone = range(1, COUNT + 1)
    result = of(top_rate(failing(RuntimeError("no"), Counter(), everyone)), pulls)
    assert result.is_empty
    assert [each.number for each in result.left_out] == list(everyone)
    assert f"and {COUNT - 1} more trials: RuntimeError: no" in result.notes[0]


def test_a_fault_of_the_whole_analysis_stays_one(pulls: tuple[Done, ...]) -> None:
    def analyse(data: TestData) -> Result:
        raise KeyError("a bug")

    for bad in ((), (BAD,)):
        kind = replace(top_rate(failing(RuntimeError("no"), Counter(), bad)), analyse=analyse)
        with pytest.raises(KeyError):
            of(kind, pulls)


def test_a_damaged_recording_is_told_as_such(pulls: tuple[Done, ...]) -> None:
    with pytest.raises(ArchiveError):
        of(top_rate(failing(ArchiveError("checksum"), Counter())), pulls)


def test_a_ramp_whose_numbers_overflow_costs_that_ramp(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = breakaway.curve_of

    def curve_of(data: TrialData, torque: float) -> Presliding:
        if data.trial.number == 1:
            raise OverflowError("math range error")
        return whole(data, torque)

    monkeypatch.setattr(breakaway, "curve_of", curve_of)
    done = execute(trials("breakaway", bench(load_only), TWO))
    result = analyse("breakaway", done)
    assert [each.number for each in result.left_out] == [1]
    assert finding(result, "bristle_stiffness", statistic="mean").value == pytest.approx(
        18000.0, rel=0.02
    )


def test_a_stiffness_at_rest_over_decades_is_left_to_the_other_ramps() -> None:
    """Its value is anything: in the mean of all ramps it would decide."""
    known = Estimate("bristle_stiffness", 100.0, "N m/rad", 90.0, 110.0, 0.95)
    lost = Estimate.without_interval(
        "stiffness_at_rest", 7e10, "N m/rad", SPANS_DECADES(), origin=Origin.NOT_DETERMINED
    )
    curve = Presliding(
        known, lost, (Interface(100.0, 20.0),), 0.0, (0.0, 16.0), 90.0, {}, (0.0, 0.0)
    )
    on = bench()
    options = breakaway.BreakawayOptions()
    found = {each.name for each in breakaway._of_curve(curve, options, on)}
    assert "bristle_stiffness" in found
    assert "stiffness_at_rest" not in found


def test_a_table_without_rows_is_no_result() -> None:
    empty = Table("points", "Points", (Column("a", "A"),), ())
    assert Result((empty,)).is_empty
    assert not Result((replace(empty, rows=({"a": 1.0},)),)).is_empty
