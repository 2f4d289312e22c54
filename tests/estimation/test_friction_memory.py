"""The angle in which friction forgets a reversal, on records whose memory is known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from campaign.estimation.friction_memory import memory_angle

MEMORY = 0.004
STEADY = -12.0


def reversal(began: float, noise: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time, rate and torque of a load that sticks for a second and is then moved ever faster.

    F / Fs = 1 - (1 - began) exp(-x / m): `began` is its share at the turn, -1 behind a long slide.
    """
    time = np.arange(0.0, 20.0, 1e-3)
    rate = -np.clip(time - 1.0, 0.0, 4.0) * 5e-4
    moved = 2.5e-4 * np.clip(time - 1.0, 0.0, 4.0) ** 2 + 2e-3 * np.clip(time - 5.0, 0.0, None)
    torque = STEADY * (1.0 - (1.0 - began) * np.exp(-moved / MEMORY))
    chance = np.random.default_rng(7)
    return time, rate, torque + noise * abs(STEADY) * chance.standard_normal(len(time))


@pytest.mark.parametrize("began", [-1.0, -0.3, 0.2])
def test_it_is_the_length_of_the_exponential_wherever_it_began(began: float) -> None:
    assert memory_angle(*reversal(began), STEADY) == pytest.approx(MEMORY, rel=0.01)


def test_noise_of_a_tenth_does_not_pass_for_friction() -> None:
    assert memory_angle(*reversal(-1.0, noise=0.1), STEADY) == pytest.approx(MEMORY, rel=0.15)


@pytest.mark.parametrize("began", [0.6, 0.95])
def test_what_began_beyond_the_lower_level_tells_nothing(began: float) -> None:
    assert math.isnan(memory_angle(*reversal(began), STEADY))


def test_what_never_comes_to_the_upper_level_tells_nothing() -> None:
    time, rate, torque = reversal(-1.0)
    short = slice(0, 4000)
    assert math.isnan(memory_angle(time[short], rate[short], torque[short], STEADY))


def test_a_record_of_few_samples_is_not_binned() -> None:
    """As many as there are: 200 at 10 Hz."""
    coarse = [values[::100] for values in reversal(-1.0)]
    assert memory_angle(*coarse, STEADY) == pytest.approx(MEMORY, rel=0.05)
