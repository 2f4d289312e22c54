"""The clock behind stamps: its step, its rounding, and what is missing."""

from __future__ import annotations

import numpy as np
import pytest

from campaign.importing.defects.clock import ticks

RATE = 1000.0
EVEN = np.arange(5000) / RATE
SEEDS = range(5)


@pytest.mark.parametrize("jitter", [0.0, 0.02, 0.2])
def test_missing_samples_are_counted_where_they_are_missing(jitter):
    chance = np.random.default_rng(3)
    time = EVEN + chance.uniform(-jitter, jitter, len(EVEN)) / RATE
    time = np.delete(time, [1000, *range(3000, 3007)])
    assert ticks(time).gaps == (999, 2998)


def test_a_late_stamp_is_no_gap():
    late = EVEN.copy()
    late[2000] += 0.9 / RATE
    assert ticks(late).gaps == ()


@pytest.mark.parametrize("rate", [430.0, 333.0, 1000 / 1.5])
def test_stamps_in_whole_milliseconds_are_rounded_and_not_jittered(rate):
    clock = ticks(np.round(np.arange(3000) / rate, 3))
    assert clock.resolution == pytest.approx(1e-3, rel=1e-4)
    assert (clock.gaps, clock.scatter) == ((), 0.0)
    short = np.delete(np.arange(3000), range(1500, 1520)) / rate
    clock = ticks(np.round(short, 3))
    assert clock.gaps == (1499,)


def test_a_clock_coarser_than_the_sampling_has_no_gaps():
    assert ticks(np.floor(EVEN * 100) / 100).gaps == ()


@pytest.mark.parametrize("seed", SEEDS)
def test_jitter_is_the_scatter_of_the_steps(seed):
    chance = np.random.default_rng(seed)
    clock = ticks(EVEN + chance.normal(0, 0.1, len(EVEN)) / RATE)
    assert clock.scatter * RATE == pytest.approx(0.1 * np.sqrt(2), rel=0.05)
    assert clock.gaps == ()


@pytest.mark.parametrize("seed", SEEDS)
def test_steps_that_are_drawn_by_lot_have_no_gaps(seed):
    """A host that reads when it has time: 1 to 4 ms, stamped to the millisecond."""
    chance = np.random.default_rng(seed)
    time = np.round(np.cumsum(chance.uniform(1e-3, 4e-3, 3000)), 3)
    assert ticks(time).gaps == ()


def test_the_step_of_a_clock_is_what_most_samples_have():
    time = np.concatenate([EVEN, EVEN[-1] + 30 + np.arange(1, 100) / RATE])
    assert ticks(time).step == pytest.approx(1e-3)
