"""Time stuck: motions whose time stuck is known, seen by sensors that resolve it, or do not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from campaign.estimation.time_stuck import (
    NAME,
    THRESHOLD,
    UNRESOLVED,
    count_of,
    noise_of,
    over_recordings,
    time_stuck,
)
from tests.estimation.coverage import holds

STEP = 1e-3
CYCLES = 6
PERIOD = 4.0
LARGEST = 0.2  # rad/s
TIME = np.arange(round(CYCLES * PERIOD / STEP)) * STEP
BASE = LARGEST * np.cos(2 * np.pi * TIME / PERIOD)


def stuck_motion(share: float) -> tuple[np.ndarray, np.ndarray]:
    """Relative rate and angle of a load that is stuck around each reversal, `share` of the time."""
    phase = np.abs((TIME / PERIOD + 0.25) % 0.5 - 0.25) * 2  # 0 at maxima, 0.5 at reversals
    rate = np.where(phase > 0.5 - 0.5 * share, 0.0, -BASE)
    return rate, np.cumsum(rate) * STEP


def true_share(rate: np.ndarray) -> float:
    return float(np.mean(np.abs(rate) < THRESHOLD * LARGEST))


@pytest.mark.parametrize("share", [0.0, 0.05, 0.2])
@pytest.mark.parametrize(
    ("bits", "noise", "sensor"),
    [(24, 0.02, "the encoder"), (16, 3e-5, "the rates of load and hull")],
)
def test_the_sensor_that_resolves_it_finds_it(
    share: float, bits: int, noise: float, sensor: str
) -> None:
    """A load that never sticks passes zero all the same: (2/pi) asin(0.001) of the time."""
    rate, angle = stuck_motion(share)
    count = 2 * np.pi / 2**bits
    random = np.random.default_rng(520)
    encoder = np.round(angle / count) * count
    gyro = rate + BASE + noise * random.standard_normal(len(TIME))
    found = time_stuck(BASE, encoder, gyro, STEP, 2 * CYCLES)
    assert sensor in found.method
    truth = true_share(rate)
    assert truth == pytest.approx(share + (share == 0) * 2 / np.pi * np.arcsin(THRESHOLD), abs=6e-4)
    assert holds(found, truth)
    assert found.half_width < 0.01


@pytest.mark.parametrize("noise", [0.02, 1.5e-3])  # smoothed away in 40 s, in 11 % of a half cycle
def test_one_count_above_the_threshold_is_no_standstill(noise: float) -> None:
    """A 16-bit encoder stands still between two counts for longer than the load does."""
    rate, angle = stuck_motion(0.0)
    count = 2 * np.pi / 2**16
    encoder = np.round(angle / count) * count
    per_sample = np.abs(np.diff(encoder)) / STEP < THRESHOLD * LARGEST
    assert np.mean(per_sample) > 0.1  # what counting standstill would say: true are 0.06 %
    noisy = rate + BASE + noise * np.random.default_rng(521).standard_normal(len(TIME))
    found = time_stuck(BASE, encoder, noisy, STEP, 2 * CYCLES)
    assert (found.name, found.origin, found.reason) == (NAME, "not determined", UNRESOLVED())


def test_what_never_moves_has_no_count_and_a_hull_at_rest_no_threshold() -> None:
    still = np.zeros(1000)
    assert time_stuck(still, still, still, STEP, 2).reason in UNRESOLVED
    held = time_stuck(BASE, np.zeros(len(TIME)), BASE, STEP, 2 * CYCLES)
    assert held.value == 1.0
    assert "the rates of load and hull" in held.method  # the encoder alone would not tell


def test_counts_and_noise_of_samples() -> None:
    angle = np.sin(TIME)
    assert count_of(np.round(angle / 0.01) * 0.01) == pytest.approx(0.01)
    assert count_of(np.full(9, 3.0)) == 0.0
    noisy = angle + 1e-3 * np.random.default_rng(522).standard_normal(len(TIME))
    assert noise_of(noisy) == pytest.approx(1e-3, rel=0.05)
    assert noise_of(angle) < 1e-9


def test_shares_of_several_trials_are_averaged() -> None:
    rate, angle = stuck_motion(0.05)
    one = time_stuck(BASE, angle, rate + BASE, STEP, 2 * CYCLES)
    other = time_stuck(BASE, *_of(0.06), STEP, 2 * CYCLES)
    told = over_recordings([one, other])
    assert told.value == pytest.approx(0.5 * (one.value + other.value))
    assert told.low == 0.0  # of two: wide, and never below nothing
    assert (told.combined[0], told.systematic_uncertainty > 0) == (0.0, True)
    most = over_recordings(
        [replace(one, value=0.9, high=0.95), replace(other, value=1.0, high=1.0)]
    )
    assert (most.high, most.combined[1]) == (1.0, 1.0)
    assert over_recordings([]) is None
    assert over_recordings([one]) == one


def _of(share: float) -> tuple[np.ndarray, np.ndarray]:
    rate, angle = stuck_motion(share)
    return angle, rate + BASE
