"""Covariances of sums whose terms know of their neighbours, against their definitions."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from campaign.estimation.long_run import bandwidth, long_run
from campaign.estimation.presliding_dynamics.record import Record
from tests.estimation.coverage import autoregressive

STEP = 0.005


def test_the_bandwidth_is_that_of_andrews_for_an_autoregression() -> None:
    """1.1447 (a n)^(1/3) with a = 4 r^2 / ((1 - r)^2 (1 + r)^2) for one column."""
    draw = np.random.default_rng(2)
    n, r = 100_000, 0.5
    series = autoregressive(draw, n, r)
    expected = 1.1447 * (4 * r**2 / ((1 - r) ** 2 * (1 + r) ** 2) * n) ** (1 / 3)
    assert bandwidth([series[:, None]]) == pytest.approx(expected, rel=0.03)


@pytest.mark.parametrize("lags", [0.5, 1.0, 1.4, 2.0, 7.3, 60.0, 133.7])
def test_sums_over_windows_are_bartletts_weights(lags: float) -> None:
    random = np.random.default_rng(2)
    scores = [random.standard_normal((count, 3)).cumsum(axis=0) for count in (500, 90, 300)]
    expected = sum((each.T @ each for each in scores), np.zeros((3, 3)))
    for lag in range(1, math.ceil(lags)):
        for each in scores:
            across = each[lag:].T @ each[:-lag]
            expected = expected + (1.0 - lag / lags) * (across + across.T)
    np.testing.assert_allclose(long_run(scores, lags), expected, rtol=1e-9)


def test_a_quantised_channel_errs_alike_in_each_period_of_the_torque() -> None:
    time = STEP * np.arange(4 * 533)
    torque = np.sin(2.0 * np.pi * time / (533 * STEP)) + np.cos(6.0 * np.pi * time / (533 * STEP))
    record = Record(STEP, torque, rate=torque)
    assert record.samples_per_period() == 533
    assert replace(record, period=1.0).samples_per_period() == 200
    chirp = np.sin(2.0 * np.pi * (0.2 + 0.5 * time) * time)
    assert Record(STEP, chirp, rate=chirp).samples_per_period() is None
