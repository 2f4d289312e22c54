"""Trends and jumps of few points: closed forms, coverage over seeds, false alarms, bad input."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from campaign.estimation.family import RATE, adjusted, level_of
from campaign.estimation.intervals import student
from campaign.estimation.trends import scatter
from campaign.estimation.trends.changes import change, detectable, jumps_of, steps_of
from campaign.estimation.trends.own_errors import moderated
from campaign.estimation.trends.scatter import Mixture, fits


def series(rng: np.random.Generator, n: int, rho: float, own: float) -> tuple:
    """Scatter of unit size, correlated by `rho`, and own errors; their covariance."""
    between = np.empty(n)
    between[0] = rng.standard_normal()
    for k in range(1, n):
        between[k] = rho * between[k - 1] + np.sqrt(1 - rho**2) * rng.standard_normal()
    errors = own * np.exp(0.4 * rng.standard_normal(n))
    return between + errors * rng.standard_normal(n), np.diag(errors**2)


@pytest.fixture
def independent(monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs that are known to know nothing of each other."""
    monkeypatch.setattr(scatter, "RHOS", 1)
    monkeypatch.setattr(scatter, "_nodes", lambda: (np.zeros(1), np.ones(1)))


@pytest.mark.parametrize("n", [3, 5, 30])
def test_of_independent_points_without_errors_of_their_own_it_is_ordinary_least_squares(
    n: int, independent: None
):
    rng = np.random.default_rng(n)
    x, y = rng.uniform(0, 400, n), 30 + rng.standard_normal(n)
    found = change(x, y, np.zeros((n, n)), jumps=False).trend
    line = stats.linregress(x, y)
    half = student(n - 2) * line.stderr
    assert found.slope.value == pytest.approx(line.slope, abs=1e-3 * half)
    assert found.slope.interval(0.95) == pytest.approx(
        (line.slope - half, line.slope + half), abs=0.01 * half
    )
    assert found.p == pytest.approx(line.pvalue, rel=0.01)
    middle = found.at(float(np.mean(x)))
    rest = y - line.intercept - line.slope * x
    error = np.sqrt(rest @ rest / (n - 2) / n)
    assert middle.value == pytest.approx(np.mean(y))
    low, high = middle.interval(0.95)
    assert high - low == pytest.approx(2 * student(n - 2) * error, rel=0.01)


def test_known_errors_of_many_points_weigh_as_in_weighted_least_squares(independent: None):
    rng = np.random.default_rng(4)
    n = 150
    errors = np.where(np.arange(n) % 3, 0.2, 2.0)
    x = rng.uniform(0, 10, n)
    y = 3 + 0.7 * x + errors * rng.standard_normal(n)
    slope = change(x, y, np.diag(errors**2), jumps=False).trend.slope
    w = errors**-2
    centred = x - np.average(x, weights=w)
    variance = 1 / (w @ centred**2)
    low, high = slope.interval(0.95)
    assert slope.value == pytest.approx(variance * (w @ (centred * y)), abs=0.3 * variance**0.5)
    assert high - low == pytest.approx(2 * 1.96 * variance**0.5, rel=0.25)


def test_units_and_origins_change_nothing():
    rng = np.random.default_rng(1)
    y, own = series(rng, 9, 0.5, 0.4)
    x = np.sort(rng.uniform(0, 200, 9))
    one = change(x, y, own)
    other = change(1e3 * x - 7e4, 2e-5 * y + 3.0, 4e-10 * own)
    assert other.trend.p == pytest.approx(one.trend.p, rel=1e-5)
    assert other.jump.p == pytest.approx(one.jump.p, rel=1e-5)
    assert other.trend.slope.interval(0.95) == pytest.approx(
        tuple(2e-8 * end for end in one.trend.slope.interval(0.95)), rel=1e-4
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("n", "rho", "count"),
    [(5, 0.0, 40), (5, 0.5, 40), (10, 0.0, 40), (10, 0.5, 40), (30, 0.5, 40)]
    + [
        pytest.param(n, rho, 1000, marks=pytest.mark.statistics)
        for n in (5, 10, 30)
        for rho in (0.0, 0.5)
    ],
)
@pytest.mark.parametrize("own", [0.0, 0.5])
def test_intervals_hold_the_slope_and_jumps_are_not_made_up(
    n: int, rho: float, count: int, own: float
):
    rng = np.random.default_rng([n, round(10 * rho), round(10 * own)])
    held = alarms = 0
    for _ in range(count):
        y, covariance = series(rng, n, rho, own)
        found = change(np.arange(n) * 1.0, 5 + 0.3 * np.arange(n) + y, covariance)
        low, high = found.trend.slope.interval(0.95)
        held += low < 0.3 < high
        alarms += change(None, 5 + y, covariance).jump.p < 0.05
    assert stats.binomtest(held, count, 0.95, alternative="less").pvalue > 1e-3
    assert stats.binomtest(alarms, count, 0.05, alternative="greater").pvalue > 1e-3


def test_ordinary_least_squares_fails_the_same_trial():
    """So that the coverage above is no property of any method."""
    rng = np.random.default_rng(3)
    held = 0
    for _ in range(200):
        y, _ = series(rng, 30, 0.5, 0.0)
        held += stats.linregress(np.arange(30), y).pvalue > 0.05
    assert stats.binomtest(held, 200, 0.95, alternative="less").pvalue < 1e-6


@pytest.mark.parametrize("rho", [0.0, 0.5])
def test_of_a_hundred_quantities_without_a_trend_about_none_is_declared(rho: float):
    rng = np.random.default_rng([8, round(10 * rho)])
    p = []
    for _ in range(100):
        y, own = series(rng, 8, rho, 0.5)
        found = change(np.arange(8) * 1.0, y, own)
        p += [found.trend.p, found.jump.p]
    assert sum(each <= RATE for each in adjusted(p)) <= 1


def test_a_jump_is_found_where_it_is_with_its_size():
    rng = np.random.default_rng(6)
    placed, held = 0, []
    for _ in range(40):
        y, own = series(rng, 12, 0.3, 0.3)
        k = int(rng.integers(2, 11))
        found = change(np.arange(12) * 1.0, y + 10.0 * (np.arange(12) >= k), own)
        assert found.shape == "jump"
        placed += found.jump.between[0] <= k <= found.jump.between[1]
        low, high = found.jump.size.interval(0.95)
        held.append(low < 10.0 < high)
        assert found.jump.p < 0.05
        assert found.jump.size.value == pytest.approx(10, abs=4)
    assert placed >= 38
    assert stats.binomtest(sum(held), 40, 0.95, alternative="less").pvalue > 1e-3


def test_two_jumps_are_found_and_a_drift_is_none():
    rng = np.random.default_rng(2)
    steps = np.repeat([0.0, 4.0, 9.0], 7)
    y = steps + 0.3 * rng.standard_normal(21)
    found = jumps_of(y, np.zeros((21, 21)), 0.05)
    assert [jump.place for jump in found] == [7, 14]
    assert [jump.size.value for jump in found] == pytest.approx([4.0, 5.0], abs=0.4)
    drift = change(np.arange(21) * 1.0, 0.5 * np.arange(21) + 0.3 * rng.standard_normal(21),
                   np.zeros((21, 21)))  # fmt: skip
    assert drift.shape == "line"
    assert drift.trend.p < 1e-6


@pytest.mark.parametrize("place", [0, 4, 9])
def test_one_outlier_declares_nothing(place: int):
    rng = np.random.default_rng(place)
    y = rng.standard_normal(10)
    y[place] += 50.0
    found = change(np.arange(10) * 1.0, y, np.zeros((10, 10)))
    assert found.trend.p > 0.05
    assert found.jump.p > 0.05


def test_a_trend_of_the_detectable_size_is_declared_four_times_in_five():
    rng = np.random.default_rng(5)
    x = np.arange(10) * 1.0
    seen = 0
    for _ in range(100):
        y, own = series(rng, 10, 0.0, 0.3)
        size = detectable(change(x, y, own, jumps=False).trend.slope, 0.05)
        seen += change(x, y + size * x, own, jumps=False).trend.p <= 0.05
    assert 0.7 < seen / 100 < 0.93


def test_errors_of_two_calibrations_make_a_jump_between_them_uncertain():
    """What all runs before and all behind have in common is in no scatter."""
    rng = np.random.default_rng(7)
    y = np.repeat([10.0, 10.5], 6) + 0.02 * rng.standard_normal(12)
    own = 1e-4 * np.eye(12)
    assert change(None, y, own).jump.p < 0.01
    alike = np.equal.outer(np.arange(12) // 6, np.arange(12) // 6)
    found = change(None, y, own + 0.3**2 * alike).jump
    assert found.p > 0.05
    low, high = found.size.interval(0.95)
    assert high - low > 2 * 1.96 * 0.3 * 2**0.5 * 0.9


def test_errors_that_runs_have_in_common_without_saying_so_hide_no_drift():
    """One model's misfit makes each run's interval wide, and no difference of two of them."""
    rng = np.random.default_rng(8)
    x = np.arange(8) * 1.0
    y = 30.0 + 0.2 * x + 0.05 * rng.standard_normal(8)
    found = change(x, y, 2.7**2 * np.eye(8)).trend
    low, high = found.slope.interval(0.95)
    assert found.p < 0.01
    assert 0.1 < low < 0.2 < high < 0.3


def test_what_nothing_can_be_said_of_is_refused():
    flat = np.ones(6)
    x = np.arange(6) * 1.0
    with pytest.raises(ValueError, match="do not differ"):
        change(x, flat, np.zeros((6, 6)))
    with pytest.raises(ValueError, match="does not vary"):
        change(flat, x, np.zeros((6, 6)))
    with pytest.raises(ValueError, match="finite"):
        change(x, np.where(x == 2, np.nan, x), np.zeros((6, 6)))
    with pytest.raises(ValueError, match="three are the least"):
        change(x[:2], x[:2], np.zeros((2, 2)))
    with pytest.raises(ValueError, match="too few for a jump"):
        change(None, x[:4], np.zeros((4, 4)))
    assert change(x[:4], np.array([1.0, 3, 2, 4]), np.zeros((4, 4))).jump is None
    assert jumps_of(flat, np.zeros((6, 6)), 0.05) == ()


def test_an_exact_line_is_a_trend_without_doubt():
    x = np.arange(6) * 1.0
    found = change(x, 3 + 2 * x, np.zeros((6, 6)))
    assert found.trend.p < 1e-6
    assert found.trend.slope.value == pytest.approx(2.0)
    assert found.shape == "line"


def test_steps_leave_two_points_on_each_side():
    steps = steps_of(5)
    assert steps.shape == (5, 2)
    assert steps.sum(axis=0).tolist() == [3, 2]


def test_quantiles_of_a_mixture_are_those_of_its_shares():
    mixture = Mixture(np.array([0.5, 0.5]), np.array([-3.0, 3.0]), np.array([0.1, 2.0]))
    for share in (1e-6, 0.025, 0.3, 0.975, 1 - 1e-6):
        assert mixture.below(mixture.quantile(share)) == pytest.approx(share, rel=1e-4)
    assert Mixture(np.ones(1), np.array([1.96]), np.ones(1)).p == pytest.approx(0.05, rel=1e-3)


def test_the_level_of_a_family_is_where_one_more_would_be_declared():
    assert level_of([]) == RATE
    assert level_of([0.5] * 10) == pytest.approx(0.005)
    assert level_of([1e-9, 1e-9] + [0.5] * 8) == pytest.approx(0.015)
    p = [1e-9, 0.014, *[0.5] * 3]
    assert [each <= RATE for each in adjusted(p)] == [True, True, False, False, False]
    assert adjusted([]) == []


def test_errors_of_few_repeats_are_drawn_to_what_they_have_in_common():
    rng = np.random.default_rng(9)
    seen = np.sqrt(rng.chisquare(3, 40) / 3)
    found = moderated(seen, np.full(40, 3.0))
    assert np.std(np.log(found)) < 0.3 * np.std(np.log(seen))
    assert np.mean(found) == pytest.approx(1.0, abs=0.2)


def test_errors_that_are_known_to_differ_stay_as_they_are():
    true = np.repeat([0.01, 1.0, 3.0], 5)
    assert moderated(true, np.full(15, np.inf)) == pytest.approx(true, rel=0.02)
    rng = np.random.default_rng(1)
    found = moderated(true * np.sqrt(rng.chisquare(20, 15) / 20), np.full(15, 20.0))
    assert found == pytest.approx(true, rel=0.5)


def test_two_hundred_points_are_few_enough():
    rng = np.random.default_rng(0)
    y, own = series(rng, 200, 0.5, 0.5)
    found = fits(y, np.column_stack([np.arange(200), steps_of(200)]), own)
    assert found.value.shape == (scatter.RHOS * scatter.OWNS * scatter.FINE, 198)
    assert 0.2 < found.expected(found.rho) < 0.8
