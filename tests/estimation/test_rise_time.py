"""The rise time of one noisy step: its interval holds as often as it says."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.signal import lsim

from campaign.estimate import Estimate
from campaign.estimation.rise_time import FEWEST, HIDDEN_LEVEL, SHORT_STANDSTILL, rise_interval
from campaign.estimation.step_response import step_characteristics
from tests.estimation.coverage import autoregressive, holds, rejected

TIME = np.arange(-0.1, 1.0, 1e-3)
COMMAND = np.clip(TIME / 0.005, 0.0, 1.0)
SEEDS = 30


def second_order(omega: float, damping: float) -> np.ndarray:
    loop = ([omega**2], [1.0, 2 * damping * omega, omega**2])
    return np.asarray(lsim(loop, COMMAND, TIME - TIME[0])[1])


LOOPS = {
    "first order": np.asarray(lsim(([1.0], [0.05, 1.0]), COMMAND, TIME - TIME[0])[1]),
    "overshoots": second_order(30.0, 0.4),
    "well damped": second_order(60.0, 0.7),
    "aperiodic": second_order(20.0, 1.0),
}


def noise(seed: int, size: float, memory: float = 0.0) -> np.ndarray:
    """AR(1) with that coefficient; its standard deviation is `size`."""
    return size * autoregressive(np.random.default_rng(seed), len(TIME), memory)


def rise(response: np.ndarray, step: float = 1.0) -> Estimate | None:
    found = step_characteristics(TIME, response, 0.0, step)
    told = rise_interval(TIME, response, 0.0, step, found)
    return None if told is None else told[0]


def true_rise(loop: str) -> float:
    return step_characteristics(TIME, LOOPS[loop], 0.0, 1.0).rise_time


def test_intervals_hold_the_rise_of_a_response_that_bends() -> None:
    """Friction lets a response rise to 80 %, and creep from there: 8 of 20 hold by noise alone."""
    time = np.arange(-0.1, 1.0, 1e-4)
    creep = 1.0 - 0.2 * np.exp((0.1 - time) / 0.15)
    bent = np.where(time > 0.1, creep, np.interp(time, [0.0, 0.02, 0.1], [0.0, 0.02, 0.8]))
    true = step_characteristics(time, bent, 0.0, 1.0).rise_time
    held = []
    for seed in range(20):
        noisy = bent + 0.001 * np.random.default_rng(seed).standard_normal(len(time))
        told = rise_interval(time, noisy, 0.0, 1.0, step_characteristics(time, noisy, 0.0, 1.0))
        held.append(holds(told[0], true))
    assert sum(held) >= 16


@pytest.mark.slow
@pytest.mark.parametrize(("memory", "sizes"), [(0.0, (0.003, 0.03)), (0.7, (0.01,))])
def test_intervals_hold_as_often_as_they_say(memory: float, sizes: tuple[float, ...]) -> None:
    held: dict[str, list[bool]] = {}
    for loop, response in LOOPS.items():
        for size in sizes:
            case = held.setdefault(f"{loop}, {size:g}", [])
            for seed in range(SEEDS):
                found = rise(response + noise(seed, size, memory))
                if found is not None and found.has_interval:
                    case.append(holds(found, true_rise(loop)))
            assert len(case) > 0.9 * SEEDS or memory, (loop, size)
    assert not rejected(held, "less")


@pytest.mark.slow
def test_they_are_no_wider_than_the_scatter_asks_for() -> None:
    for loop, response in LOOPS.items():
        found = [rise(response + noise(seed, 0.02)) for seed in range(SEEDS)]
        values = [each.value for each in found if each is not None]
        halves = [0.5 * (each.high - each.low) for each in found if each is not None]
        assert np.mean(halves) < 2.0 * 1.96 * np.std(values), loop


def test_a_step_downwards_is_its_mirror_image() -> None:
    noisy = LOOPS["well damped"] + noise(1, 0.02)
    up, down = rise(noisy), rise(-3.0 * noisy, -3.0)
    assert (down.value, down.low, down.high) == pytest.approx((up.value, up.low, up.high))


def test_without_noise_there_is_nothing_to_tell_it_by() -> None:
    assert rise(LOOPS["well damped"]) is None


def test_a_standstill_of_a_few_samples_tells_no_noise() -> None:
    noisy = LOOPS["well damped"] + noise(1, 0.005)
    late = TIME >= -(FEWEST - 1) * 1e-3
    for more, determined in ((0.0, True), (0.02, False)):
        response = (noisy + noise(2, more))[late]
        found = step_characteristics(TIME[late], response, 0.0, 1.0)
        told = rise_interval(TIME[late], response, 0.0, 1.0, found)
        assert math.isfinite(told[0].value) is determined
        assert not told[0].has_interval
        assert told[0].reason == SHORT_STANDSTILL(samples=30)


def test_noise_that_hides_a_level_is_said_to() -> None:
    """A response that creeps towards 90 %: when it comes there nobody can tell."""
    slow = 0.9 * (1.0 - np.exp(-np.maximum(TIME, 0.0) / 0.02))
    noisy = slow + noise(4, 0.03)
    found = step_characteristics(TIME, noisy, 0.0, 1.0)
    told = rise_interval(TIME, noisy, 0.0, 1.0, found)
    assert math.isnan(told[0].value)
    assert told[0].reason in HIDDEN_LEVEL
    assert "hides when it reaches 90 %" in str(told[0].reason)
