"""Covariances of sums whose terms know of their neighbours, against their definitions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from campaign.estimation.presliding_dynamics.long_run import bandwidth, long_run_covariance
from campaign.estimation.presliding_dynamics.record import Record

STEP = 0.005


def test_the_covariance_of_a_sum_is_that_of_the_weighted_lags() -> None:
    series = np.cumsum(np.random.default_rng(3).standard_normal((300, 3)), axis=0)
    for width in (1.0, 7.3, 40.0):
        expected = series.T @ series
        for lag in range(1, 300):
            product = series[lag:].T @ series[:-lag]
            expected += max(0.0, 1.0 - lag / width) * (product + product.T)
        (found,) = long_run_covariance(series, width)
        assert found == pytest.approx(expected, rel=1e-9)


def test_the_bandwidth_follows_the_correlation() -> None:
    rng = np.random.default_rng(1)
    white = rng.standard_normal((2000, 1))
    coloured = lfilter([1.0], [1.0, -0.8], white, axis=0)
    # Andrews (1991), equation 6.4, by hand for a coefficient of 0.8.
    by_hand = 1.1447 * (4.0 * 0.64 / (0.2 * 1.8) ** 2 * 2000) ** (1.0 / 3.0)
    assert bandwidth(coloured) == pytest.approx(by_hand, rel=0.15)
    assert bandwidth(white) < 0.3 * bandwidth(coloured)


def test_a_quantised_channel_errs_alike_in_each_period_of_the_torque() -> None:
    time = STEP * np.arange(4 * 533)
    torque = np.sin(2.0 * np.pi * time / (533 * STEP)) + np.cos(6.0 * np.pi * time / (533 * STEP))
    record = Record(STEP, torque, rate=torque)
    assert record.samples_per_period() == 533
    assert replace(record, period=1.0).samples_per_period() == 200
    chirp = np.sin(2.0 * np.pi * (0.2 + 0.5 * time) * time)
    assert Record(STEP, chirp, rate=chirp).samples_per_period() is None
