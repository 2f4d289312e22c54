"""What a newcomer is told of a bench: numbers by hand, and a word for each."""

from __future__ import annotations

import math

import numpy as np
import pytest

from campaign.physics.bench_facts import Fact, current_bandwidth, facts_of
from tests.physics.benches import KIC, KPC, L, R, Tree, bench


def small_servo(tree: Tree) -> None:
    """A 12-bit encoder, 2 kHz, no filter: one count in one sample is 175.8 deg/s."""
    tree["controller"]["sample_rate"] = "2 kHz"
    tree["limits"]["rate"] = "150 deg/s"
    tree["sensors"] = {
        "encoder": {"resolution": f"{360 / 4096} deg"},
        "resolver": {"resolution": f"{360 / 4096} deg"},
        "gyro": {"resolution": "0.5 deg/s"},
    }


def fact(facts: tuple[Fact, ...], *words: str) -> Fact:
    (found,) = [one for one in facts if all(word in one.subject for word in words)]
    return found


def test_one_count_judged_sample_by_sample_can_be_more_than_the_rate_limit() -> None:
    def at_once(tree: Tree) -> None:
        small_servo(tree)
        tree["limits"]["rate_time"] = "0.5 ms"

    count = fact(facts_of(bench(at_once)), "encoder over limits.rate_time", "rate limit")
    assert count.value == pytest.approx(math.radians(360 / 4096 * 2000))
    assert count.share == pytest.approx(175.78 / 150, rel=1e-4)
    assert count.verdict == "too coarse"
    assert "rate_time" in count.advice


def test_over_the_judging_time_it_is_a_fraction_of_that() -> None:
    """10 ms at most, and not more than 1 % of 90 deg at 150 deg/s: 6 ms, 12 samples."""
    count = fact(facts_of(bench(small_servo)), "encoder over limits.rate_time", "rate limit")
    assert count.value == pytest.approx(math.radians(360 / 4096 * 2000 / 12))


def test_presliding_is_counted_in_the_encoder_whose_angle_is_analysed() -> None:
    """32 N m / 18 000 N m/rad = 0.1019 deg; the resolver's finer counts help no analysis."""
    found = fact(facts_of(bench(small_servo)), "presliding", "'load'")
    assert "encoder" in found.subject
    assert found.against == pytest.approx(32 / 18000)
    assert found.share == pytest.approx(360 / 4096 / math.degrees(32 / 18000))
    assert found.verdict == "too coarse"

    def finer(tree: Tree) -> None:
        small_servo(tree)
        tree["sensors"]["encoder"]["resolution"] = "0.001 deg"

    assert fact(facts_of(bench(finer)), "presliding", "'load'").verdict == "fine"


def test_static_friction_against_what_drives() -> None:
    """32 + N 0.04 N m against 40 N m; 12.14 N m/A times 4 A is 48.6 N m."""

    def weak(tree: Tree) -> None:
        tree["limits"] |= {"torque": "40 N m", "current": "4 A"}
        tree["controller"]["rate"]["proportional"] = "0.02 A s/deg"

    facts = facts_of(bench(weak))
    static = 32 + 141.176 * 0.04
    assert fact(facts, "torque limit").share == pytest.approx(static / 40, rel=1e-6)
    assert fact(facts, "torque limit").verdict == "too small"
    assert fact(facts, "current limit").verdict == "tight"
    error = static / (141.176 * 0.086 * 0.02)  # deg/s
    assert fact(facts, "breaks away").share == pytest.approx(error / 90, rel=1e-6)
    assert fact(facts, "breaks away").verdict == "too weak"


@pytest.mark.parametrize("integral", [KIC, 0.0])
def test_the_current_loop_is_as_wide_as_its_transfer_function(integral: float) -> None:
    on = bench(lambda t: t["controller"]["current"].update(integral=f"{integral} V/(A s)"))
    s = 1j * current_bandwidth(on)
    gain = (KPC * s + integral) / (L * s**2 + (R + KPC) * s + integral)
    at_rest = 1.0 if integral else KPC / (R + KPC)
    assert abs(gain) == pytest.approx(at_rest / math.sqrt(2), rel=1e-9)


def test_a_slow_controller_is_told_from_its_crossover() -> None:
    def slow(tree: Tree) -> None:
        tree["controller"]["sample_rate"] = "100 Hz"

    facts = facts_of(bench(slow))
    assert fact(facts, "sample rate").verdict == "slow"
    assert fact(facts, "current loop").verdict == "fine"


def test_what_a_bench_does_not_have_is_left_out() -> None:
    subjects = [one.subject for one in facts_of(bench(lambda tree: tree.update(friction={})))]
    assert not [subject for subject in subjects if "friction" in subject or "count" in subject]
    assert all(np.isfinite(one.share) for one in facts_of(bench()))
