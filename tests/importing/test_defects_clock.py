"""Times: what was done to them is found, where it was done and how large."""

from __future__ import annotations

import numpy as np
import pytest

from campaign.importing.defects import Defect, Severity
from campaign.importing.defects.clock import drift_between, of_time, ticks

RATE = 1000.0
EVEN = np.arange(5000) / RATE
SEEDS = range(5)


def found(time: np.ndarray, kind: str, rate: float | None = None) -> list[Defect]:
    return [each for each in of_time(time, rate) if each.kind == kind]


def kinds(time: np.ndarray) -> set[str]:
    return {each.kind for each in of_time(time)}


def test_an_even_clock_has_nothing_wrong():
    assert kinds(EVEN) == set()
    assert kinds(EVEN + 1.7e9) == set()  # seconds since 1970, in doubles
    assert kinds(EVEN[:5]) == set()


@pytest.mark.parametrize("jitter", [0.0, 0.02, 0.2])
def test_missing_samples_are_counted_where_they_are_missing(jitter):
    chance = np.random.default_rng(3)
    time = EVEN + chance.uniform(-jitter, jitter, len(EVEN)) / RATE
    time = np.delete(time, [1000, *range(3000, 3007)])
    first, second = found(time, "gap")
    assert (first.rows, first.size) == ((999, 1000), 1)
    assert (second.rows, second.size) == ((2998, 2999), 7)
    assert "7 samples missing behind row 2999" in second.what
    assert {first.severity, second.severity} == {Severity.REPAIRABLE}


def test_many_gaps_are_told_together():
    time = np.delete(EVEN, np.arange(100, 5000, 200))
    gaps = found(time, "gap")
    assert len(gaps) == 11
    assert sum(each.size for each in gaps) == 25


def test_a_late_stamp_is_no_gap():
    late = EVEN.copy()
    late[2000] += 0.9 / RATE
    assert found(late, "gap") == []


@pytest.mark.parametrize("rate", [430.0, 333.0, 1000 / 1.5])
def test_stamps_in_whole_milliseconds_are_rounded_and_not_jittered(rate):
    time = np.round(np.arange(3000) / rate, 3)
    (rounded,) = found(time, "rounded")
    assert rounded.size == pytest.approx(1e-3, rel=1e-4)
    assert kinds(time) == {"rounded"}
    short = np.delete(np.arange(3000), range(1500, 1520)) / rate
    (gap,) = found(np.round(short, 3), "gap")
    assert (gap.size, gap.rows) == (20, (1499, 1500))


def test_a_clock_coarser_than_the_sampling_repeats_itself():
    time = np.floor(EVEN * 100) / 100
    (duplicate,) = found(time, "duplicate")
    assert (duplicate.size, duplicate.repair) == (4500, "sample_rate")
    assert found(time, "gap") == []


def test_seconds_since_1970_in_single_precision_are_no_clock():
    time = (EVEN + 1.7e9).astype(np.float32).astype(float)
    (only,) = of_time(time)
    assert (only.kind, only.severity) == ("no clock", Severity.REFUSED)


def test_repetitions_and_steps_back_are_found():
    time = np.concatenate([EVEN[:100], EVEN[99:200], EVEN[150:]])
    (duplicate,), (back,) = found(time, "duplicate"), found(time, "backward")
    assert (duplicate.rows, duplicate.size) == ((100, 100), 1)
    assert (back.rows, back.size) == ((201, 201), 1)
    lost = EVEN.copy()
    lost[7] = np.nan
    assert found(lost, "lost time")[0].rows == (7, 7)


@pytest.mark.parametrize("seed", SEEDS)
def test_jitter_is_a_share_of_the_step(seed):
    chance = np.random.default_rng(seed)
    time = EVEN + chance.normal(0, 0.1, len(EVEN)) / RATE
    (jitter,) = found(time, "jitter")
    assert jitter.size == pytest.approx(0.1 * np.sqrt(2), rel=0.05)
    assert found(time, "gap") == []
    assert found(EVEN + chance.normal(0, 0.01, len(EVEN)) / RATE, "jitter") == []


@pytest.mark.parametrize("seed", SEEDS)
def test_steps_that_are_drawn_by_lot_have_no_gaps(seed):
    """A host that reads when it has time: 1 to 4 ms, stamped to the millisecond."""
    chance = np.random.default_rng(seed)
    time = np.round(np.cumsum(chance.uniform(1e-3, 4e-3, 3000)), 3)
    assert found(time, "gap") == []
    assert found(time, "jitter")


def test_a_clock_is_held_against_the_stated_rate():
    assert found(EVEN, "stated rate", 1000.0) == []
    (off,) = found(EVEN * 1.004, "stated rate", 1000.0)
    assert off.size == pytest.approx(1000 / 1.004 - 1000)
    assert "996.016 Hz where 1000 Hz" in off.what


def test_a_clock_that_changes_its_rate_drifts():
    time = EVEN + 2e-3 * EVEN**2
    (drift,) = found(time, "drift")
    assert drift.size == pytest.approx(2e-3 * 5**2 / 4, rel=0.02)  # of a parabola in the middle


def test_two_clocks_are_held_against_each_other():
    assert list(drift_between(EVEN, 4.0 + EVEN)) == []
    (drift,) = drift_between(EVEN, 4.0 + EVEN * (1 + 80e-6))
    assert drift.size == pytest.approx(80e-6, rel=1e-3)
    assert drift.severity is Severity.NOTED  # 0.4 ms in all: less than a sample
    (drift,) = drift_between(EVEN, 4.0 + EVEN * 1.01)
    assert drift.severity is Severity.REPAIRABLE


def test_the_step_of_a_clock_is_what_most_samples_have():
    time = np.concatenate([EVEN, EVEN[-1] + 30 + np.arange(1, 100) / RATE])
    assert ticks(time).step == pytest.approx(1e-3)
