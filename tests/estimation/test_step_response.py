"""Step characteristics against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from campaign.estimation.step_response import step_characteristics

TIME = np.arange(-0.1, 2.0, 1e-3)


def test_first_order() -> None:
    """1 - exp(-t/tau): rise tau ln 9, settling to 2 % tau ln 50, no overshoot."""
    tau, step = 0.08, 0.5
    response = np.where(TIME > 0, step * (1 - np.exp(-np.maximum(TIME, 0) / tau)), 0.0)
    found = step_characteristics(TIME, response, 0.0, step)
    assert found.rise_time == pytest.approx(tau * np.log(9), rel=1e-3)
    assert found.settling_time == pytest.approx(tau * np.log(50), rel=1e-3)
    assert found.overshoot == 0.0
    assert found.steady_state_error == pytest.approx(0.0, abs=1e-6)


def test_second_order_overshoots_by_its_damping() -> None:
    """The overshoot is exp(-pi z / sqrt(1 - z^2)); an offset before the step does not matter."""
    z, w = 0.5, 30.0
    damped = w * np.sqrt(1 - z**2)
    t = np.maximum(TIME, 0)
    swing = np.cos(damped * t) + z / np.sqrt(1 - z**2) * np.sin(damped * t)
    response = 3.0 + 2.0 * (1 - np.exp(-z * w * t) * swing)
    found = step_characteristics(TIME, response, 0.0, 2.0)
    assert found.overshoot == pytest.approx(np.exp(-np.pi * z / np.sqrt(1 - z**2)), rel=1e-3)


def test_an_error_that_stays_is_told_and_nothing_settles() -> None:
    response = np.where(TIME > 0, 0.85 * (1 - np.exp(-np.maximum(TIME, 0) / 0.05)), 0.0)
    found = step_characteristics(TIME, response, 0.0, 1.0)
    assert found.steady_state_error == pytest.approx(0.15, abs=1e-6)
    assert np.isnan(found.settling_time)
    assert np.isnan(found.rise_time)  # it never reaches 90 %
