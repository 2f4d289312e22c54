"""Fitting Equation 4.6: known parameters come back, with honest errors and honest doubts."""

from __future__ import annotations

import numpy as np
import pytest

from campaign.identification.velocity_map import PARAMETERS, fit_stribeck

SPEED = np.deg2rad(np.geomspace(0.05, 65.0, 80))
TRUE = {
    "viscous_friction": 4.14,
    "coulomb_torque": 30.2,
    "static_torque": 37.6,
    "stribeck_velocity": 0.03,
    "stribeck_exponent": 2.0,
}


def equation_4_6(speed: np.ndarray, **changed: float) -> np.ndarray:
    """Typed from the thesis, not taken from the program."""
    p = {**TRUE, **changed}
    fall = np.exp(-((speed / p["stribeck_velocity"]) ** p["stribeck_exponent"]))
    drop = p["static_torque"] - p["coulomb_torque"]
    return p["coulomb_torque"] + drop * fall + p["viscous_friction"] * speed


@pytest.mark.parametrize(
    "changed",
    [
        {},
        {"stribeck_exponent": 0.8},
        {"static_torque": 25.0},  # Fs < Fc: real axes do this, and no fit may force it away
        {"stribeck_velocity": 0.004, "viscous_friction": 0.5},
        # the motor's own side, in its own small numbers
        {"coulomb_torque": 0.03, "static_torque": 0.04, "viscous_friction": 0.001},
    ],
)
def test_exact_data_give_the_parameters_back(changed: dict[str, float]) -> None:
    found = fit_stribeck(SPEED, equation_4_6(SPEED, **changed))
    assert found.values == pytest.approx({**TRUE, **changed}, rel=1e-6)
    assert found.doubts == ()
    assert found.rms < 1e-9


def test_the_exponent_can_be_held() -> None:
    found = fit_stribeck(SPEED, equation_4_6(SPEED), 2.0)
    assert found.values == pytest.approx(TRUE, rel=1e-6)
    assert found.errors["stribeck_exponent"] == 0.0
    wrong = fit_stribeck(SPEED, equation_4_6(SPEED, stribeck_exponent=0.8), 2.0)
    assert wrong.values["stribeck_exponent"] == 2.0
    assert wrong.rms > 0.05


def test_standard_errors_cover_the_truth_as_often_as_they_claim() -> None:
    """100 maps with independent noise: deviations over standard errors have mean 0, deviation 1.

    The bounds are 4 standard errors of that mean (0.1) and of that deviation (0.07) for 100.
    """
    random = np.random.default_rng(20)
    exact = equation_4_6(SPEED)
    scores: dict[str, list[float]] = {name: [] for name in PARAMETERS}
    for _ in range(100):
        found = fit_stribeck(SPEED, exact + 0.05 * random.normal(size=len(SPEED)))
        assert found.doubts == ()
        for name in PARAMETERS:
            scores[name].append((found.values[name] - TRUE[name]) / found.errors[name])
    for name, score in scores.items():
        assert abs(np.mean(score)) < 0.40, name
        assert 0.72 < np.std(score) < 1.28, name
        assert 0.50 < np.mean(np.abs(score) < 1.0) < 0.87, name  # 68.3 % expected, 4 x 4.7 %


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_a_flat_map_says_that_it_shows_no_stribeck_effect(noise: float) -> None:
    random = np.random.default_rng(3)
    flat = equation_4_6(SPEED, static_torque=TRUE["coulomb_torque"])
    for exponent in (None, 2.0):
        found = fit_stribeck(SPEED, flat + noise * random.normal(size=len(SPEED)), exponent)
        assert any("stribeck_velocity" in doubt and "not" in doubt for doubt in found.doubts)


def test_a_map_without_slow_points_doubts_its_parameters() -> None:
    """From 0.5 rad/s on the fall is over: neither vs nor Ts are in such data."""
    random = np.random.default_rng(4)
    fast = np.linspace(0.5, 1.2, 30)
    found = fit_stribeck(fast, equation_4_6(fast) + 0.05 * random.normal(size=30))
    assert any("stribeck_velocity" in doubt for doubt in found.doubts)


def test_residuals_are_data_minus_model() -> None:
    torque = equation_4_6(SPEED)
    torque[40] += 1.0
    assert fit_stribeck(SPEED, torque).residuals[40] > 0.5


@pytest.mark.parametrize("count", [0, 1, 4])
def test_too_few_points_are_refused(count: int) -> None:
    with pytest.raises(ValueError, match=f"{count} points"):
        fit_stribeck(SPEED[:count], equation_4_6(SPEED)[:count])
