"""Readings of a coarse sensor: what mean and deviation may be claimed."""

from __future__ import annotations

import pytest

from campaign.estimation.scatter import deviation_of_readings, mean_of_readings


def test_of_a_fine_sensor_they_are_the_textbook_s() -> None:
    """1, 2, 3, 4: mean 2.5 ± 3.182 · 1.291/2; deviation 1.118, s from 0.7314 to 4.814."""
    mean = mean_of_readings("mean", (1.0, 2.0, 3.0, 4.0), "N m")
    assert (mean.value, mean.half_width) == pytest.approx((2.5, 2.0542), rel=1e-3)
    found = deviation_of_readings("deviation", (1.0, 2.0, 3.0, 4.0), "N m")
    assert (found.value, found.low, found.high) == pytest.approx((1.1180, 0.7314, 4.8135), rel=1e-3)


def test_readings_on_one_count_are_known_to_half_of_it() -> None:
    mean = mean_of_readings("mean", (4.2, 4.2, 4.2), "N m", 1.4)
    assert mean.half_width == pytest.approx(1.96 * 1.4 / 12**0.5, rel=1e-3)
    assert mean.half_width > 0.7
    found = deviation_of_readings("deviation", (4.2, 4.2, 4.2), "N m", 1.4)
    assert (found.value, found.low) == (0.0, 0.0)
    # (2 Phi(q/2s) - 1)^3 = 0.05: Phi^-1(0.6842) = 0.4795
    assert found.high == pytest.approx(1.4 / 2 / 0.4795, rel=2e-3)


def test_readings_over_many_counts_average_the_rounding() -> None:
    readings = [float(k) for k in (3, 7, 1, 9, 5, 4, 8, 2)]
    found = mean_of_readings("mean", readings, "N m", 1.0)
    assert found.systematic_uncertainty == 0.0


def test_a_single_reading_has_no_deviation() -> None:
    assert deviation_of_readings("deviation", (4.2,), "N m", 1.4).reason
    assert mean_of_readings("mean", (4.2,), "N m", 1.4).reason
