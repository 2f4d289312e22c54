"""Times of rows as an even clock: rounding is nothing, all else is told with its rows."""

from __future__ import annotations

import numpy as np
import pytest

from campaign.importing.defects.clock import even_clock, ticks


def clock(times, repairs=()):
    times = np.asarray(times, dtype=float)
    return even_clock(lambda a, b: times[a:b], 0, len(times), repairs)


@pytest.mark.parametrize(("begin", "rows"), [(0.0, 5), (1.7e9, 1000)])
def test_an_even_clock_from_anywhere(begin, rows):
    found = clock(begin + np.arange(rows) / 250.0)
    assert found.rate == pytest.approx(250.0, rel=1e-6)
    assert (found.positions, found.samples) == (None, rows)


def test_rounded_times_are_even():
    """430 Hz in whole milliseconds: steps of 2 and 3 ms, and nothing to be repaired."""
    found = clock(np.round(np.arange(5000) / 430.0, 3))
    assert found.rate == pytest.approx(430.0, rel=1e-5)
    assert found.positions is None
    assert "0.2" in found.remarks[0]


@pytest.mark.parametrize("rate", [430.0, 333.0])
def test_rounded_times_with_a_gap_have_their_places(rate):
    kept = np.delete(np.arange(3000), range(1500, 1520))
    found = clock(np.round(kept / rate, 3), ["mark gaps"])
    assert found.rate == pytest.approx(rate, rel=1e-5)
    assert found.samples == 3000
    assert list(np.flatnonzero(np.isnan(found.positions))) == list(range(1500, 1520))


@pytest.mark.parametrize(
    ("times", "says"),
    [
        (np.round(np.arange(3000) / 1000 * 1.5, 3), r"0\.001 s, too coarse .* about 666\.7 Hz"),
        (np.floor(np.arange(3000) / 10) / 100, r"0\.01 s, too coarse .* about 1000 Hz"),
    ],
)
def test_times_coarser_than_their_steps_are_better_left_out(times, says):
    """Lines through samples that were even would put the rounding into them."""
    with pytest.raises(ValueError, match=says):
        clock(times)


def test_the_rate_is_that_of_all_rows_and_not_of_the_ends():
    times = np.arange(2000) / 1000.0
    times[0] -= 0.2e-3
    times[-1] += 0.2e-3
    assert clock(times).rate == pytest.approx(1000.0, rel=2e-6)  # by the ends: 2e-4 off


def test_gaps_are_named_and_marked_when_that_is_asked_for():
    times = np.delete(np.arange(1000) / 100.0, [300, 301, 700])
    with pytest.raises(ValueError, match=r"3 samples are missing, before row 301, 699.*mark gaps"):
        clock(times)
    found = clock(times, ["mark gaps"])
    assert found.samples == 1000
    assert list(np.flatnonzero(np.isnan(found.positions))) == [300, 301, 700]
    assert found.positions[302] == 300.0
    assert found.rate == pytest.approx(100.0)


def test_repeated_and_backward_rows_are_named_and_left_out_when_that_is_asked_for():
    times = np.insert(np.arange(100) / 10.0, [5, 50], [0.4, 4.9])
    with pytest.raises(ValueError, match=r"row 6, 52 is not after.*drop repeated"):
        clock(times)
    found = clock(times, ["drop repeated"])
    assert found.samples == 100
    assert found.rate == pytest.approx(10.0)
    assert "2 rows were left out" in found.remarks[0]


@pytest.mark.parametrize("seed", range(5))
def test_jitter_is_resampled_only_when_that_is_asked_for(seed):
    rng = np.random.default_rng(seed)
    times = np.arange(4000) / 500.0 + rng.uniform(-0.4, 0.4, 4000) / 500.0
    with pytest.raises(ValueError, match=r"no even clock: steps of .* vary by .* %.*resample"):
        clock(times)
    found = clock(times, ["resample"])
    assert found.rate == pytest.approx(500.0, rel=1e-3)
    signal = np.interp(found.positions, np.arange(4000), np.sin(2 * np.pi * 3.0 * times))
    at = times[0] + np.arange(found.samples) / found.rate
    # A line between samples dt apart is off a sine by (w dt)^2 / 8 at most.
    most = (2 * np.pi * 3 * 1.8 / 500) ** 2 / 8
    assert np.max(np.abs(signal - np.sin(2 * np.pi * 3.0 * at))) < most


def test_across_a_hole_no_line_is_put():
    rng = np.random.default_rng(3)
    times = np.arange(1000) / 100.0 + rng.uniform(-0.4, 0.4, 1000) / 100.0
    times = np.delete(times, np.arange(400, 420))
    found = clock(times, ["resample"])
    assert 18 <= np.isnan(found.positions).sum() <= 21


@pytest.mark.parametrize(
    ("times", "says"),
    [
        ([0.0], "no recording"),
        ([1.0, 1.0, 1.0], "all rows have one time"),
        ([0.0, np.nan, 0.2], "row 2 has no time"),
        (np.float32(1.7e9 + np.arange(5000) / 1000), "its times do not go on"),
    ],
)
def test_what_is_no_clock_at_all_is_told(times, says):
    with pytest.raises(ValueError, match=says):
        clock(times, ["drop repeated", "mark gaps", "resample"])


# The clock behind stamps: its step, its rounding, and what is missing

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
