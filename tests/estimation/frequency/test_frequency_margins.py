"""Margins of measured loops whose errors are known by few realisations: coverage, and bounds."""

from __future__ import annotations

import math
from collections import defaultdict

import numpy as np
import pytest

from campaign.estimate import Estimate
from campaign.estimation.frequency.measured_response import MeasuredResponse, closed_from_open
from campaign.estimation.servo import ServoCharacteristics, characteristics
from tests.estimation.coverage import holds, rejected
from tests.estimation.frequency.measured import noisy
from tests.estimation.loops import Truth, random_loop

NAMES = ("bandwidth", "phase_margin", "gain_margin")


def margins(loop: MeasuredResponse) -> ServoCharacteristics:
    return characteristics(closed_from_open(loop).response)


def is_held(told: Estimate, truth: float) -> bool:
    return told.value <= truth if told.kind == "at least" else holds(told, truth)


def half_turn(truth: Truth) -> float:
    """Where a loop's phase is -180 deg (Hz), above its gain crossover."""
    grid = truth.scale * np.geomspace(1, 100, 8000)
    phase = np.unwrap(np.angle(truth.loop(2j * np.pi * grid)))
    return float(grid[np.flatnonzero(phase < -np.pi)[0]])


@pytest.mark.slow
@pytest.mark.parametrize("count", [12, pytest.param(150, marks=pytest.mark.statistics)])
def test_margins_hold_the_truth_as_often_as_they_say(count: int) -> None:
    held: dict[str, list[bool]] = defaultdict(list)
    for seed in range(count):
        random = np.random.default_rng(seed)
        truth = random_loop(random)
        frequency = np.geomspace(truth.scale / 10, truth.scale * 12, 60)
        values = truth.loop(2j * np.pi * frequency)
        level = random.choice([0.003, 0.01, 0.03]) * np.abs(values)
        found = margins(noisy(frequency, values, level, random, of=8))
        for name in NAMES:
            held[name].append(is_held(getattr(found, name), getattr(truth, name)))
    assert not rejected(held, "less")


@pytest.mark.slow
@pytest.mark.parametrize("count", [36, pytest.param(400, marks=pytest.mark.statistics)])
def test_margins_near_the_last_frequency_hold_the_truth(count: int) -> None:
    """Loops with one crossing just before or behind it: intervals and bounds."""
    held: dict[str, list[bool]] = defaultdict(list)
    for seed in range(count):
        random = np.random.default_rng(7000 + seed)
        truth = random_loop(random)
        end = (half_turn(truth), truth.bandwidth, truth.scale)[seed % 3]
        last = end * random.uniform(0.95, 1.06)
        frequency = np.geomspace(truth.scale / 10, last, int(random.choice([24, 40, 60])))
        values = truth.loop(2j * np.pi * frequency)
        share, floor = 10 ** random.uniform(-2.5, -1), 10 ** random.uniform(-3, -1.3)
        level = np.hypot(share * np.abs(values), floor)
        found = margins(noisy(frequency, values, level, random, of=int(random.integers(7, 12))))
        for name in NAMES:
            told = getattr(found, name)
            if told.kind == "at least" or told.has_interval:
                held[name].append(is_held(told, getattr(truth, name)))
    assert not rejected(held, "less")
    assert min(map(len, held.values())) > 0.5 * count


def test_few_realisations_widen_the_intervals() -> None:
    """By Student's t: of as much scatter, known by four of them or by forty."""
    frequency = np.geomspace(0.5, 60.0, 80)
    s = 2j * np.pi * frequency
    values = 10.0 * math.pi / s * np.exp(-0.01 * s)
    widths = []
    for of in (4, 40):
        loop = noisy(frequency, values, 1e-2 * np.abs(values), np.random.default_rng(3), of=of)
        loop.variance[:] = np.mean(loop.variance / np.abs(values) ** 2) * np.abs(values) ** 2
        widths.append(margins(loop).phase_margin.standard_error)
    assert widths[0] > 1.1 * widths[1]
