"""Sines, steps and ramps are found as they were made, or it is said why not."""

from __future__ import annotations

import numpy as np
import pytest

from campaign.estimation.excitation_detection import found_ramp, found_sine, found_step

TIME = np.arange(4000) / 500.0


@pytest.mark.parametrize("frequency", [0.7, 3.0, 17.3, 90.0])
@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_a_sine(frequency: float, noise: float):
    rng = np.random.default_rng(1)
    signal = 0.4 + 1.5 * np.sin(2 * np.pi * frequency * TIME + 0.8)
    found = found_sine(signal + noise * rng.normal(size=len(TIME)), 500.0)
    # Cramer-Rao: 6^(1/2) sigma / (pi a T n^(1/2)), five of them.
    bound = 5 * np.sqrt(6.0) * max(noise, 1e-6) / (np.pi * 1.5 * 8.0 * np.sqrt(4000))
    assert found.frequency == pytest.approx(frequency, abs=bound)
    assert found.amplitude == pytest.approx(1.5, abs=0.02)
    assert found.phase == pytest.approx(0.8, abs=0.05)


def test_what_is_no_sine_is_told():
    rng = np.random.default_rng(2)
    two = np.sin(2 * np.pi * 3 * TIME) + np.sin(2 * np.pi * 11 * TIME)
    for signal in (rng.normal(size=4000), two, np.zeros(4000)):
        with pytest.raises(ValueError, match=r"a sine of .* explains|fewer than 2"):
            found_sine(signal, 500.0)
    with pytest.raises(ValueError, match="fewer than 2 cycles"):
        found_sine(np.sin(2 * np.pi * 0.1 * TIME), 500.0)
    with pytest.raises(ValueError, match="missing"):
        found_sine(np.where(TIME == 1.0, np.nan, two), 500.0)


@pytest.mark.parametrize("size", [2.0, -0.3])
@pytest.mark.parametrize("ramp", [0.0, 0.1])
def test_a_step(size: float, ramp: float):
    signal = 0.5 + size * (np.clip((TIME - 2.0) / ramp, 0, 1) if ramp else (TIME >= 2.0))
    found = found_step(TIME, signal)
    assert found.at == pytest.approx(2.0, abs=0.005)
    assert found.size == pytest.approx(size)
    assert found.ramp == pytest.approx(ramp, abs=0.01)


def test_a_noisy_step():
    rng = np.random.default_rng(3)
    found = found_step(TIME, (TIME >= 2.0) + 0.02 * rng.normal(size=4000))
    assert found.at == pytest.approx(2.0, abs=0.005)
    assert found.size == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize(
    "signal", [np.zeros(4000), np.sin(2 * np.pi * TIME), ((TIME > 1) & (TIME < 2)).astype(float)]
)
def test_what_is_no_step_is_told(signal):
    with pytest.raises(ValueError, match=r"no step|step in it"):
        found_step(TIME, signal)


@pytest.mark.parametrize("slope", [2.0, -0.5])
def test_a_ramp(slope: float):
    rng = np.random.default_rng(4)
    signal = 0.3 + slope * np.clip(TIME - 1.5, 0.0, None) + 0.01 * rng.normal(size=4000)
    found = found_ramp(TIME, signal, 6.0)
    assert found.slope == pytest.approx(slope, rel=0.01)
    assert found.start == pytest.approx(1.5, abs=0.05)


def test_a_jump_is_no_ramp():
    with pytest.raises(ValueError, match="no ramp"):
        found_ramp(TIME, (TIME > 1.0).astype(float), 3.0)
