"""A level of odd distortion holds what another draw of detection lines would have said."""

from __future__ import annotations

import numpy as np

from campaign.identification.frequency.distortion import Distortion, Level, total
from tests.identification.coverage import holds

LINES, GROUP, REALISATIONS = 60, 3, 7


def level(power: np.ndarray, share: float) -> Level:
    noise = np.full(power.shape[1], 1e-12)
    return Level(np.arange(1.0, power.shape[1] + 1.0), power, noise, 1000.0, 1.0, share)


def drawn(random: np.random.Generator, spectrum: np.ndarray) -> Distortion:
    """One of every group of lines, each with little scatter over realisations."""
    chosen = np.arange(0, LINES, GROUP) + random.integers(GROUP, size=LINES // GROUP)
    power = spectrum[chosen] * random.gamma(20.0, 1.0 / 20.0, (REALISATIONS, len(chosen)))
    even = level(np.full((REALISATIONS, 4), 1e-6), 1.0)
    excited = np.full(LINES, 1.0)
    return Distortion(even, level(power, 1.0 / GROUP), np.ones(REALISATIONS), excited)


def test_lines_that_differ_are_in_the_interval() -> None:
    random = np.random.default_rng(4)
    spectrum = 1e-3 * random.gamma(1.0, 1.0, LINES)  # products of lines add up, or do not
    truth = float(np.sqrt(np.sum(spectrum)))
    held = [holds(total(drawn(random, spectrum), "odd"), truth) for _ in range(200)]
    assert np.mean(held) > 0.9


def test_lines_that_are_alike_widen_nothing() -> None:
    found = drawn(np.random.default_rng(5), np.full(LINES, 1e-3))
    one = total(found, "odd")
    assert holds(one, float(np.sqrt(LINES * 1e-3)))
    assert one.half_width < 0.1 * one.value


def test_all_lines_are_no_draw() -> None:
    found = drawn(np.random.default_rng(6), np.full(LINES, 1e-3))
    spread = 1e-3 * np.array([1.0, 9.0, 1.0, 9.0])
    whole = level(spread * np.random.default_rng(7).gamma(20.0, 1.0 / 20.0, (REALISATIONS, 4)), 1.0)
    even = total(Distortion(whole, found.odd, found.output, found.excited), "even")
    assert even.half_width < 0.15 * even.value
