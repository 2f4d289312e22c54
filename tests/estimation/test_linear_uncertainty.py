"""Intervals and correlations against the closed form of a straight line, and by repetition."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from campaign.arrays import Array
from campaign.estimate import Origin
from campaign.estimation.intervals import NO_FREEDOM
from campaign.estimation.linear_uncertainty import (
    NO_LIMIT,
    NOT_DETERMINED,
    Uncertainty,
    estimate_of,
    strong,
    uncertainty,
)
from campaign.estimation.losses import weights
from campaign.estimation.unknowns import Unknown
from campaign.reason import Cause

from .coverage import rejected

RANDOM = np.random.Generator(np.random.PCG64(5))
X = np.linspace(0.0, 1.0, 12)
LINE = np.stack([np.ones_like(X), X], axis=1)
CENTRE = np.array([0.5, 0.5])


def test_correlation_of_a_straight_line() -> None:
    """Intercept and slope: -mean(x) / sqrt(mean(x^2))."""
    found = uncertainty(LINE, 0.1 * np.ones(12), CENTRE, "linear")
    expected = -X.mean() / np.sqrt(np.mean(X**2))
    assert found.correlation[0, 1] == pytest.approx(expected, rel=1e-12)
    assert strong(found.correlation, ["a", "b"], 0.8) == [("a", "b", pytest.approx(expected))]


@pytest.mark.parametrize("noise", [1.0, 3.0])
def test_intervals_cover_in_95_of_100(noise: float) -> None:
    """Also where cells scatter by three times what was stated."""
    steep = 100.0 * LINE  # so that intervals are small parts of the ranges
    inverse = np.linalg.pinv(steep)
    covered = []
    for _ in range(1000):
        deviations = noise * RANDOM.standard_normal(12)
        off = inverse @ deviations
        found = uncertainty(steep, deviations - steep @ off, CENTRE + off, "linear")
        covered.append(np.abs(off) < found.half_width)
    assert np.all(np.mean(covered, axis=0) > 0.93)
    assert np.mean(covered) < 0.99


def test_good_luck_does_not_narrow_an_interval() -> None:
    """Stated deviations stand where the cells agree better: student's t times sigma / sqrt(n)."""
    found = uncertainty(np.full((4, 1), 50.0), np.zeros(4), CENTRE[:1], "linear")
    assert found.half_width[0] == pytest.approx(3.182446 / (50 * 2), rel=1e-6)
    assert found.scatter == 1.0


def test_parameters_told_only_together_are_open() -> None:
    column = RANDOM.standard_normal((12, 1)) * 100
    other = RANDOM.standard_normal((12, 1)) * 100
    found = uncertainty(
        np.hstack([column, 2 * column, other]), np.zeros(12), np.full(3, 0.5), "linear"
    )
    assert found.open == (True, True, False)
    assert np.isnan(found.half_width[:2]).all()
    assert found.half_width[2] == pytest.approx(2.2281 / np.linalg.norm(other), rel=0.1)


def test_an_interval_wider_than_the_range_is_open() -> None:
    found = uncertainty(0.1 * LINE, np.zeros(12), CENTRE, "linear")
    assert found.open == (True, True)


def test_a_parameter_at_its_bound_is_held() -> None:
    """The other one's interval is that of a constant alone."""
    found = uncertainty(100 * LINE, np.zeros(12), np.array([0.5, 1.0]), "linear")
    assert found.bound == ("", "upper")
    assert np.isnan(found.half_width[1])
    assert found.half_width[0] == pytest.approx(2.200985 / (100 * np.sqrt(12)), rel=1e-6)


def test_what_the_loss_curbs_counts_less() -> None:
    """A constant of three residuals, one of them 10: soft_l1 weighs it by 1 / sqrt(101)."""
    residuals = np.array([0.0, 0.0, 10.0])
    found = uncertainty(np.full((3, 1), 50.0), residuals, CENTRE[:1], "soft_l1")
    weight = 1 / np.sqrt(101)
    scatter = np.sqrt(100 * weight / 2)
    assert found.scatter == pytest.approx(scatter, rel=1e-12)
    expected = 4.302653 * scatter / (50 * np.sqrt(2 + weight))
    assert found.half_width[0] == pytest.approx(expected, rel=1e-6)


# At a bound: one-sided, by the profile of the linearised problem


def test_the_limit_among_many_is_that_of_another_solver() -> None:
    """Eight parameters that know of each other, four at a bound; scipy's bounded solver."""
    random = np.random.default_rng(2)
    shares = np.array([0.0, 0.0, 1.0, 0.0, 0.3, 0.5, 0.6, 0.9])
    a = 20.0 * random.standard_normal((14, 8)) @ (np.eye(8) + 0.5 * random.standard_normal((8, 8)))
    residuals = 2.0 * random.standard_normal(14)
    found = uncertainty(a, residuals, shares, "linear")
    rise = (2.228139 * found.scatter) ** 2  # t(14 - 4)

    def cost(index: int, share: float) -> float:
        others = np.arange(8) != index
        moved = residuals + (share - shares[index]) * a[:, index]
        ends = -shares[others], 1.0 - shares[others]
        return 2.0 * float(lsq_linear(a[:, others], -moved, ends, tol=1e-13, max_iter=500).cost)

    for index in range(4):
        rose = cost(index, float(found.limit[index])) - cost(index, shares[index])
        assert rose == pytest.approx(rise, rel=1e-4), index


def test_no_limit_before_the_other_bound() -> None:
    """2.8 standard errors are more than the range; nor does a column of zeros give one."""
    for column in (1.0, 0.0):
        found = uncertainty(np.full((4, 1), column), np.zeros(4), np.zeros(1), "linear")
        assert np.isnan(found.limit[0])


def test_the_limit_follows_the_loss() -> None:
    """As for one parameter, each residual weighted by the slope of its loss."""
    c, r = 20.0, np.array([0.3, 0.3, 0.3, 6.0])
    found = uncertainty(np.full((4, 1), c), r, np.zeros(1), "cauchy")
    w = weights("cauchy", r)
    s, g = c * c * w.sum(), c * (w @ r)
    rise = (2.776445 * found.scatter) ** 2
    assert found.limit[0] == pytest.approx((-g + np.sqrt(g * g + s * rise)) / s, rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("stated", [True, False])
def test_intervals_near_a_bound_hold_whichever_side_the_data_choose(stated: bool) -> None:
    """Slope and offset of 12 points; the slope's truth is 0 to 2 standard errors from its bound.

    One-sided with the quantile for one side, the interval would hold 1.7 in 93 %. The offset's
    would hold 1.0 in 90 % if it took the slope as known wherever it is at its bound.
    """
    steep = 100.0 * LINE
    inverse = np.linalg.inv(steep.T @ steep)
    error = float(np.sqrt(inverse[1, 1]))
    constant = steep[:, 0] @ steep[:, 0]
    random = np.random.default_rng(11)
    held: dict[str, list[bool]] = {}
    for distance in (0.0, 1.0, 1.7, 2.0):
        truth = np.array([0.5, distance * error])
        for _ in range(1200):
            data = steep @ truth + random.standard_normal(12)
            found = inverse @ steep.T @ data
            if found[1] < 0:
                found = np.array([steep[:, 0] @ data / constant, 0.0])
            told = uncertainty(steep, steep @ found - data, found, "linear", stated=stated)
            end = told.limit[1] if told.bound[1] else told.high[1]
            inside = truth[1] <= end and not truth[1] < told.low[1]
            held.setdefault(f"slope at {distance}", []).append(bool(inside))
            inside = told.low[0] <= truth[0] <= told.high[0]
            held.setdefault(f"offset at {distance}", []).append(bool(inside))
    assert rejected(held, "less") == {}


def test_the_others_move_as_far_as_those_at_a_bound_may() -> None:
    """A constant follows the slope by minus its mean x; without a limit as far as the range."""
    for size in (100.0, 1.0):
        found = uncertainty(size * LINE, np.zeros(12), np.array([0.5, 0.0]), "linear")
        reach = found.limit[1] if size > 1 else 1.0
        half = 2.200985 / (size * np.sqrt(12))
        assert found.high[0] == pytest.approx(0.5 + half, rel=1e-6)
        assert found.low[0] == pytest.approx(0.5 - half - X.mean() * reach, rel=1e-6)
        assert np.isnan(found.low[1])
        assert np.isnan(found.high[1])
    assert np.isnan(found.limit[1])
    upper = uncertainty(100 * LINE, np.zeros(12), np.array([0.5, 1.0]), "linear")
    assert upper.low[0] == pytest.approx(0.5 - upper.half_width[0], rel=1e-9)
    assert upper.high[0] > 0.5 + 1.5 * upper.half_width[0]


def test_without_bounds_the_ends_are_those_of_the_half_width() -> None:
    found = uncertainty(100 * LINE, 0.1 * np.ones(12), CENTRE, "linear")
    np.testing.assert_array_equal(found.low, CENTRE - found.half_width)
    np.testing.assert_array_equal(found.high, CENTRE + found.half_width)


# As estimates


DECADES = Unknown("stiffness", 1e2, 1e6, 1e3, logarithmic=True)


def known(**changes: object) -> Uncertainty:
    facts = {
        "half_width": np.array([0.1]),
        "low": np.array([0.4]),
        "high": np.array([0.6]),
        "bound": ("",),
        "limit": np.array([np.nan]),
        "open": (False,),
        "correlation": np.ones((1, 1)),
        "scatter": 1.0,
        "freedom": 4,
    }
    return Uncertainty(**(facts | changes))  # type: ignore[arg-type]


def none() -> Array:
    return np.array([np.nan])


def test_an_estimate_has_the_interval_in_its_own_scale() -> None:
    """A tenth of four decades either way; the error is ln(1e4) x / t(4) of it."""
    told = estimate_of(DECADES, 0.5, known(), 0, "N m/rad")
    assert (told.value, told.low, told.high) == pytest.approx((1e4, 10**3.6, 10**4.4))
    assert told.standard_error == pytest.approx(0.1 * 1e4 * np.log(1e4) / 2.776445, rel=1e-6)
    assert (told.freedom, told.unit, told.level, told.name) == (4, "N m/rad", 0.95, "stiffness")
    assert told.origin is Origin.MEASURED


def test_beside_one_at_its_bound_an_interval_has_its_own_ends_and_no_standard_error() -> None:
    beside = known(
        half_width=np.array([0.1, np.nan]),
        bound=("", "lower"),
        low=np.array([0.25, np.nan]),
        high=np.array([0.6, np.nan]),
        limit=np.array([np.nan, 0.1]),
        open=(False, False),
    )
    told = estimate_of(DECADES, 0.5, beside, 0, "N m/rad")
    assert (told.low, told.high) == pytest.approx((1e3, 10**4.4))
    assert told.standard_error is None
    assert "those at a bound anywhere up to their limits" in told.method


@pytest.mark.parametrize(
    ("share", "side", "limit", "low", "high"),
    [(0.0, "lower", 0.25, None, 1e3), (1.0, "upper", 0.75, 1e5, None)],
)
def test_an_estimate_at_its_bound_is_open_beyond_it(
    share: float, side: str, limit: float, low: float | None, high: float | None
) -> None:
    at = {"bound": (side,), "half_width": none()}
    told = estimate_of(DECADES, share, known(limit=np.array([limit]), **at), 0, "")
    assert (told.low, told.high) == (pytest.approx(low), pytest.approx(high))
    assert told.origin is Origin.AT_BOUND
    bare = estimate_of(DECADES, share, known(**at), 0, "")
    assert not bare.has_interval
    assert bare.reason == NO_LIMIT(side=side)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"open": (True,), "half_width": none()}, NOT_DETERMINED),
        ({"open": (True,)}, NOT_DETERMINED),
        ({"half_width": none(), "freedom": 0}, NO_FREEDOM),
    ],
)
def test_an_estimate_without_an_interval_says_why(
    changes: dict[str, object], reason: Cause
) -> None:
    told = estimate_of(DECADES, 0.5, known(**changes), 0, "")
    assert told.origin is Origin.NOT_DETERMINED
    assert told.value == pytest.approx(1e4)
    assert not told.has_interval
    assert told.reason in reason
