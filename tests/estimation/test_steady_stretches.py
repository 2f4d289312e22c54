"""Steady stretches are found where they are, and nowhere else; the line through them covers."""

from __future__ import annotations

import numpy as np
import pytest

from campaign.estimation.friction_line import friction_line, mean_of_stretches
from campaign.estimation.steady_stretches import steady_stretches
from tests.estimation.coverage import autoregressive


def moves(speeds, sample_rate=500.0, ramp=0.2, cruise=2.0, rest=0.5):
    """Rate of trapezoidal moves, shape (n,), and where each cruises (samples)."""
    parts, places, n = [], [], 0
    for speed in speeds:
        up = np.linspace(0.0, speed, round(ramp * sample_rate), endpoint=False)
        hold = np.full(round(cruise * sample_rate), speed)
        still = np.zeros(round(rest * sample_rate))
        places.append((n + len(still) + len(up), n + len(still) + len(up) + len(hold)))
        parts += [still, up, hold, up[::-1]]
        n += len(still) + 2 * len(up) + len(hold)
    return np.concatenate(parts), places


@pytest.mark.parametrize("noise", [0.0, 0.02])
@pytest.mark.parametrize("sample_rate", [66.7, 500.0])
def test_each_cruise_is_found_and_nothing_else(noise: float, sample_rate: float):
    speeds = [0.2, -0.2, 0.5, -0.5, 1.0, -1.0]
    rate, places = moves(speeds, sample_rate)
    rng = np.random.default_rng(4)
    found = steady_stretches(rate + noise * rng.normal(size=len(rate)), sample_rate)
    assert len(found) == len(speeds)
    for stretch, (first, stop), speed in zip(found, places, speeds, strict=True):
        slack = max(1, round(0.02 * sample_rate))
        assert first - slack <= stretch.first < stretch.stop <= stop + slack
        assert stretch.rate == pytest.approx(speed, abs=0.02)


@pytest.mark.parametrize("sample_rate", [66.7, 500.0])
def test_in_noise_only_what_stands_out_is_found(sample_rate: float):
    """A tenth of the fastest rate, per sample: the slow cruises may be missed, none is wrong."""
    speeds = [0.2, -0.2, 0.5, -0.5, 1.0, -1.0]
    rate, _ = moves(speeds, sample_rate)
    rng = np.random.default_rng(4)
    found = steady_stretches(rate + 0.1 * rng.normal(size=len(rate)), sample_rate)
    rates = [round(stretch.rate, 1) for stretch in found]
    assert set(rates) <= set(speeds)
    assert {1.0, -1.0} <= set(rates)


def test_a_sine_and_standstill_have_none():
    time = np.arange(5000) / 500.0
    rng = np.random.default_rng(5)
    for frequency in (0.2, 1.3, 7.0):
        assert steady_stretches(np.sin(2 * np.pi * frequency * time), 500.0) == ()
    assert steady_stretches(np.zeros(5000), 500.0) == ()
    assert steady_stretches(np.full(5, 1.0), 500.0) == ()
    assert steady_stretches(np.full(500, np.nan), 500.0) == ()
    slow_drift = np.linspace(0.1, 1.0, 5000) + 0.001 * rng.normal(size=5000)
    torque = np.ones(5000)
    for stretch in steady_stretches(slow_drift, 500.0, torque):
        part = slow_drift[stretch.first : stretch.stop]
        assert abs(part[-1] - part[0]) <= 0.02 * abs(part.mean())


@pytest.mark.parametrize("seed", [1, 6, 49])
def test_a_multisine_that_accelerates_a_large_inertia_has_none(seed: int):
    """Its turning points last 20 to 140 ms; a tenth of its torque is as large as its friction."""
    time = np.arange(24_000) / 1000.0
    for tones in (10, 20):
        phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, tones)
        speeds = 2 * np.pi * 0.125 * np.arange(1, tones + 1)
        angles = np.outer(time, speeds) + phases
        rate = np.cos(angles).sum(axis=1) / np.sqrt(tones)
        acceleration = -(speeds * np.sin(angles)).sum(axis=1) / np.sqrt(tones)
        torque = 69.0 * acceleration + 27.0 * np.sign(rate)
        assert steady_stretches(rate, 1000.0, torque, driven=False) == ()


def test_a_creep_before_breakaway_is_no_sliding():
    """The rate is steady there, but the torque rises; later it does not."""
    creep, slide = np.full(1000, 0.05), np.full(1000, 1.0)
    rate = np.concatenate([creep, slide])
    torque = np.concatenate([np.linspace(2.0, 30.0, 1000), np.full(1000, 25.0)])
    (found,) = steady_stretches(rate, 500.0, torque)
    assert found.first >= 1000


def test_a_torque_that_drives_backward_is_no_friction():
    rate = np.full(2000, 1.0)
    assert steady_stretches(rate, 500.0, np.full(2000, -3.0)) == ()
    assert len(steady_stretches(rate, 500.0, np.full(2000, 3.0))) == 1


def test_lost_samples_end_a_stretch():
    rate = np.full(2000, 1.0)
    rate[900:950] = np.nan
    first, second = steady_stretches(rate, 500.0)
    assert first.stop <= 900
    assert second.first >= 950


def test_the_lines_intervals_hold_the_truth():
    """Of 400 lines through eight stretches with scatter between them, both parameters."""
    rng = np.random.default_rng(6)
    speed = np.tile([0.1, 0.3, 0.6, 1.0], 2)
    held = np.zeros(2)
    for _ in range(400):
        torque = 20.0 + 5.0 * speed + 0.4 * rng.normal(size=len(speed))
        line = friction_line(speed, torque)
        for k, (found, true) in enumerate(((line.coulomb, 20.0), (line.viscous, 5.0))):
            held[k] += found.low <= true <= found.high
    assert np.all(np.abs(held / 400 - 0.95) < 3 * np.sqrt(0.95 * 0.05 / 400))


def test_no_line_is_told_of_one_speed_or_of_two_stretches():
    with pytest.raises(ValueError, match="three are the fewest"):
        friction_line(np.array([1.0, 2.0]), np.array([3.0, 4.0]))
    with pytest.raises(ValueError, match="about as fast"):
        friction_line(np.array([1.0, 1.01, 1.02, 1.0]), np.array([3.0, 4.0, 3.5, 3.4]))


@pytest.mark.parametrize(
    ("kinship", "count", "least"),
    [(0.0, 60, 0.93), (0.5, 60, 0.90), (0.8, 60, 0.90), (0.8, 20, 0.88)],
)
def test_the_mean_of_stretches_that_are_alike_holds_the_truth_nearly_as_often(
    kinship: float, count: int, least: float
):
    """Running-in: each is like the one before it. As if independent: 94, 73 and 44 % of 60."""
    rng = np.random.default_rng(9)
    held, runs = 0, 600
    for _ in range(runs):
        values = autoregressive(rng, count, kinship)
        found = mean_of_stretches("friction", 5.0 + values, "")
        held += found.low <= 5.0 <= found.high
    assert held / runs >= least
