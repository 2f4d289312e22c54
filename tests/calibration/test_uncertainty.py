"""Intervals and correlations against the closed form of a straight line, and by repetition."""

from __future__ import annotations

import numpy as np
import pytest

from campaign.calibration.uncertainty import strong, uncertainty

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


def test_no_intervals_without_spare_cells() -> None:
    found = uncertainty(100 * LINE[:2], np.zeros(2), CENTRE, "linear")
    assert np.isnan(found.half_width).all()
