"""A family of differences: what is declared, what is not, and what is not judged at all."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from campaign.api.analysis import AnalysedTest
from campaign.api.quantity_words import condition_words
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.comparison.finding_pairs import pairs_of
from campaign.comparison.same_quantity import pair_tests
from campaign.comparison.tables import change_of
from campaign.estimate import Estimate
from campaign.estimation.family import RATE
from campaign.estimation.intervals import with_error
from campaign.experiments.interface import TestData
from campaign.physics.bench import Bench
from campaign.recording import Ending, Outcome
from campaign.references.verdict import Verdict, with_verdicts
from campaign.result import Finding, Result
from campaign.trial import Task, Trial
from tests.comparison.laboratory import analysed


def executed(trial: Trial) -> ArchivedTrial:
    """A completed trial without samples."""
    ending = Ending(Outcome.COMPLETED)
    return ArchivedTrial(trial, ending, "", "", Path(), "", samples=None)  # type: ignore[arg-type]


def made_up(
    findings: list[Finding], points: list[dict[str, object]], bench: Bench, **more: object
) -> AnalysedTest:
    task = Task(mode="rate", duration=1.0, window=(0.0, 1.0), sample_rate=10.0)
    trials = tuple(
        executed(
            Trial(
                number=n, test="t", kind="k", seed=1, task=task, point=point,  # type: ignore[arg-type]
                bench=bench.model_dump(mode="json"),
            )
        )
        for n, point in enumerate(points, start=1)
    )  # fmt: skip
    data = TestData("t", "k", {}, trials)
    return analysed(data, Result(findings=tuple(findings)), **more)


def found(value: float, error: float, place: float = 0.0, **more: object) -> Finding:
    estimate = with_error("torque", value, "N m", error, 10.0, "", **more)
    return Finding.of(estimate, {"position": place})


def pairs(before: list[Finding], after: list[Finding], bench: Bench, repeat: int = 3):
    points: list[dict[str, object]] = [
        {"position": each.conditions["position"]} for each in before for _ in range(repeat)
    ]
    tested = pair_tests([made_up(before, points, bench)], [made_up(after, points, bench)]).tests
    return list(pairs_of(tested[0]))


def step_up(p_values: list[float], rate: float) -> list[bool]:
    """Benjamini and Hochberg 1995, (1): reject the k smallest, k the largest with p <= k q / m."""
    order = sorted(range(len(p_values)), key=lambda i: p_values[i])
    largest = max(
        (k for k, i in enumerate(order, start=1) if p_values[i] <= k * rate / len(order)), default=0
    )
    return [i in order[:largest] for i in range(len(p_values))]


@pytest.mark.slow
def test_what_is_declared_is_what_the_step_up_procedure_rejects(platform: Bench):
    draw = np.random.default_rng(3)
    for _ in range(8):
        before = [found(10.0, 0.1, place) for place in range(1, 25)]
        after = [found(10.0 + draw.normal(0, 0.3), 0.1, place) for place in range(1, 25)]
        told = with_verdicts(pairs(before, after, platform))
        rejected = step_up([pair.found.p or 0.0 for pair in told], RATE)
        assert [pair.verdict is Verdict.DIFFERENT for pair in told] == rejected
        assert 0 < sum(rejected) < 24
        single = [(pair.found.p or 0.0) < 0.05 for pair in told]
        assert sum(single) >= sum(rejected)


def test_a_difference_that_would_stand_alone_may_not_in_a_family(platform: Bench):
    alone = [found(10.0, 0.1, 1)], [found(10.35, 0.1, 1)]
    assert with_verdicts(pairs(*alone, platform))[0].verdict is Verdict.DIFFERENT
    many = [found(10.0, 0.1, place) for place in range(1, 11)]
    among = with_verdicts(pairs(many, [*alone[1], *many[1:]], platform))
    assert [pair.verdict for pair in among] == [Verdict.NOT_SHOWN] * 10
    assert among[0].adjusted == pytest.approx(10 * (among[0].found.p or 0.0))


def test_a_number_of_one_trial_is_not_judged_however_small_its_error(platform: Bench):
    one = with_verdicts(pairs([found(10.0, 0.001)], [found(10.1, 0.001)], platform, repeat=1))[0]
    assert one.found.p < 1e-10
    assert one.verdict is Verdict.NOT_JUDGED
    assert "one trial each" in str(one.reason)
    assert one.found.difference.has_interval  # told all the same
    assert with_verdicts(pairs([found(10.0, 0.001)], [found(10.1, 0.001)], platform, repeat=2))[
        0
    ].testable


def test_one_side_of_one_trial_is_said_to_be_it(platform: Bench):
    several = made_up([found(10.0, 0.1)], [{"position": 0.0}] * 3, platform)
    single = made_up([found(10.0, 0.1)], [{"position": 0.0}], platform)
    (pair,) = pairs_of(pair_tests([several], [single]).tests[0])
    assert str(pair.reason).startswith("the other is of one trial")
    (pair,) = pairs_of(pair_tests([single], [several]).tests[0])
    assert str(pair.reason).startswith("the reference is of one trial")


def test_a_failed_trial_is_none_of_those_behind_a_number(platform: Bench):
    test = made_up([found(10.0, 0.1)], [{"position": 0.0}] * 2, platform)
    failed = replace(test.trials[1], ending=Ending(Outcome.LIMIT, "the rate limit"))
    cut = analysed(
        TestData("t", "k", {}, (test.trials[0], failed)),
        test.result,
    )
    (pair,) = pairs_of(pair_tests([test], [cut]).tests[0])
    assert "of one trial" in str(pair.reason)


def test_a_bound_that_excludes_equality_is_told_without_a_test(platform: Bench):
    least = Finding.of(Estimate("torque", 20.0, "N m", kind="at least"), {"position": 0.0})
    before, after = [found(10.0, 0.1), found(5.0, 0.1, 2)], [least, found(5.0, 0.1, 2)]
    told = with_verdicts(pairs(before, after, platform))
    assert [pair.verdict for pair in told] == [Verdict.BEYOND_BOUND, Verdict.NOT_SHOWN]
    assert told[0].adjusted is None
    below = [Finding.of(Estimate("torque", 9.0, "N m", kind="at least"), {"position": 0.0})]
    assert with_verdicts(pairs(before[:1], below, platform))[0].verdict is Verdict.NOT_JUDGED


def test_nothing_to_test_is_no_error(platform: Bench):
    bare = [Finding("torque", 10.0, "N m", {"position": 0.0})]
    told = with_verdicts(pairs(bare, bare, platform))
    assert [pair.verdict for pair in told] == [Verdict.NOT_JUDGED]
    assert "no interval" in str(told[0].reason)


def shares(platform: Bench, count: int) -> tuple[float, float]:
    """Mean share of false ones among the declared, and of the true ones that were declared."""
    draw = np.random.default_rng(90)
    false, power = [], []
    points: list[dict[str, object]] = [{"position": float(place // 2)} for place in range(2, 82)]
    test = made_up([], points, platform)
    for _ in range(count):
        before = [found(10.0 + draw.normal(0, 0.1), 0.1, place) for place in range(1, 41)]
        truth = [10.0 if place <= 30 else 10.6 for place in range(1, 41)]
        after = [
            found(value + draw.normal(0, 0.1), 0.1, place)
            for place, value in enumerate(truth, start=1)
        ]
        runs = [[replace(test, result=Result(findings=tuple(own)))] for own in (before, after)]
        told = with_verdicts(list(pairs_of(pair_tests(*runs).tests[0])))
        declared = [pair.verdict is Verdict.DIFFERENT for pair in told]
        false.append(sum(declared[:30]) / max(sum(declared), 1))
        power.append(sum(declared[30:]) / 10)
    return float(np.mean(false)), float(np.mean(power))


@pytest.mark.slow
@pytest.mark.parametrize(
    "count",
    [pytest.param(40, id="sample"), pytest.param(1000, id="all", marks=pytest.mark.statistics)],
)
def test_of_what_is_declared_at_most_5_percent_is_false(platform: Bench, count: int):
    """30 of 40 pairs are alike, 10 differ by 6 standard errors of one of them."""
    false, power = shares(platform, count)
    # The share of one family is at most 1: Hoeffding's bound is loose, its own scatter is 0.06.
    assert false <= RATE + stats.norm.ppf(0.99) * 0.07 / count**0.5
    assert power > 0.8


def test_what_follows_from_other_numbers_is_not_of_the_family_and_leads_no_list(platform: Bench):
    def both(value: float) -> list[Finding]:
        ratio = with_error("error_reduction", 2 * value, "", 0.01, 10.0, "")
        return [found(value, 0.1), Finding.of(ratio, {"position": 0.0})]

    base, derived = with_verdicts(pairs(both(10.0), both(20.0), platform))
    assert base.verdict is Verdict.DIFFERENT
    assert base.adjusted == base.found.p  # a family of one
    assert derived.verdict is Verdict.NOT_JUDGED
    assert "follows from other numbers" in str(derived.reason)
    least = Finding.of(Estimate("error_growth", 90.0, "", kind="at least"), {"position": 0.0})
    known = Finding.of(with_error("error_growth", 2.0, "", 0.1, 9.0, ""), {"position": 0.0})
    assert with_verdicts(pairs([known], [least], platform))[0].verdict is Verdict.NOT_JUDGED


def test_a_number_that_changes_its_sign_is_told_in_its_unit_not_in_percent(platform: Bench):
    (pair,) = with_verdicts(pairs([found(1.0, 0.1)], [found(-2.81, 0.1)], platform))
    assert np.isnan(pair.found.change.value)
    assert pair.found.change.reason.text == "its sign changes"
    assert "%" not in change_of(pair)
    assert change_of(pair).startswith("−3.81")
    assert change_of(pair).endswith("N·m")


def test_a_condition_that_is_no_option_has_its_unit(platform: Bench):
    test = made_up([], [{}], platform)
    assert condition_words(test, {"average_friction": 33.0}) == "average friction 33 N·m"
