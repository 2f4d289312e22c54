"""The mean of a window: what it is less its acceleration, and how far it can be trusted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from campaign.estimation.ripple import Ripple, dominant_periods, harmonic, pooled, ripple_of_points
from campaign.estimation.scatter import ZERO_MEAN, deviation_limits, relative_scatter
from campaign.estimation.steady_sliding import steady_sliding
from tests.estimation.coverage import holds, rejected

TIME = np.arange(0.0, 4.0, 0.005)
SPEED = np.deg2rad(5.0)
J = 35.0


def test_the_residual_acceleration_is_no_friction() -> None:
    rate = SPEED + 0.01 * TIME
    torque = 20.0 + J * 0.01 + 0.0 * TIME
    found = steady_sliding(TIME, rate, torque, SPEED * TIME, J)
    assert found.torque.value == pytest.approx(20.0)
    assert found.acceleration == pytest.approx(0.01)
    assert found.first == pytest.approx(-0.5 * 0.005 * SPEED)
    assert found.last == pytest.approx(SPEED * (TIME[-1] + 0.5 * 0.005))


def test_a_ripple_that_the_window_averages_is_no_noise() -> None:
    """Two periods of 0.2 N m: without them 1 N m of white noise over 800 samples are left."""
    random = np.random.default_rng(1)
    angle = SPEED * TIME
    periods = 2.0 * np.pi * 2.0 / float(np.ptp(angle))
    torque = 20.0 + 5.0 * np.sin(periods * angle) + random.normal(size=len(TIME))
    blind = steady_sliding(TIME, np.full(len(TIME), SPEED), torque, angle, J)
    told = steady_sliding(TIME, np.full(len(TIME), SPEED), torque, angle, J, periods)
    assert told.torque.standard_error == pytest.approx(1.0 / np.sqrt(len(TIME)), rel=0.5)
    assert (blind.torque.standard_error or 0.0) > 5.0 * (told.torque.standard_error or 0.0)
    assert told.torque.value == blind.torque.value


def test_the_noise_of_the_rate_counts_by_its_slope() -> None:
    """J times the deviation of a slope: s sqrt(12 / n) / T for white noise."""
    random = np.random.default_rng(2)
    noise = 0.01
    rate = SPEED + noise * random.normal(size=len(TIME))
    found = steady_sliding(TIME, rate, np.full(len(TIME), 20.0), None, J)
    expected = J * noise * np.sqrt(12.0 / len(TIME)) / 4.0
    assert found.torque.standard_error == pytest.approx(expected, rel=0.1)
    assert np.isnan(found.first)


def test_a_window_with_few_samples_has_a_mean_and_no_interval() -> None:
    found = steady_sliding(TIME[:12], np.full(12, SPEED), np.full(12, 20.0), None, J)
    assert found.torque.value == pytest.approx(20.0)
    assert found.torque.low is None
    assert str(found.torque.reason) == "12 samples are too few for 10 batches"
    with pytest.raises(ValueError, match="2 samples"):
        steady_sliding(TIME[:2], np.full(2, SPEED), np.full(2, 20.0), None, J)


# Ripple


def run(speed: float, amplitude: complex, periods: float, noise: float = 0.0, seed: int = 3):
    """A run over 60 deg or 20 s whose loop gives way: the rate ripples, too; 20 N m dry."""
    random = np.random.default_rng(seed)
    time = np.arange(0.0, min(20.0, np.deg2rad(60.0) / abs(speed)), 0.01)
    angle = np.deg2rad(-30.0) * np.sign(speed) + speed * time
    friction = np.sign(speed) * 20.0 * (1.0 + np.real(amplitude * np.exp(1j * periods * angle)))
    wave = periods * speed
    swing = 0.02 * speed
    rate = speed + swing * np.sin(wave * time)
    torque = friction + J * swing * wave * np.cos(wave * time)
    return angle, rate, torque + noise * random.normal(size=len(time))


@pytest.mark.parametrize("speed", [0.05, -0.05])
def test_a_harmonic_is_that_of_the_friction_and_not_of_what_the_loop_leaves(speed: float) -> None:
    """Drive torque and rate both ripple; T - J dw/dt is 20 N m times the amplitude."""
    amplitude, periods = 0.005 * np.exp(0.7j), 67.0
    angle, rate, torque = run(speed, amplitude, periods)
    found = harmonic(angle, rate, torque, J, periods)
    seen = complex(found.cosine, -found.sine) * np.exp(-1j * periods * found.centre)
    assert seen / (np.sign(speed) * 20.0) == pytest.approx(amplitude, abs=2e-4)


def test_a_run_that_is_too_short_tells_no_harmonic() -> None:
    angle, rate, torque = run(0.003, 0.005, 67.0)  # 3.4 deg of 5.4
    with pytest.raises(ValueError, match="too short"):
        harmonic(angle, rate, torque, J, 67.0)


@pytest.mark.parametrize("periods", [31.4, 67.0, 90.0])
def test_the_period_is_found_where_nobody_tells_it(periods: float) -> None:
    angle, rate, torque = run(0.05, 0.005, periods, noise=0.05)
    assert dominant_periods(angle, rate, torque, J) == pytest.approx(periods, abs=0.3)


def test_noise_and_drift_are_no_ripple() -> None:
    """Of 200 runs of white noise none shows a harmonic five times the median one."""
    found = [dominant_periods(*run(0.05, 0.0, 67.0, 0.1, seed), J) for seed in range(200)]
    swings = [n for n in found if n is not None and abs(n - 67.0) > 1.0]
    assert swings == []
    angle = np.linspace(-0.5, 0.5, 2000)
    drift = 20.0 + 0.3 * np.exp(-3.0 * angle)
    assert dominant_periods(angle, np.full(2000, 0.05), drift, J) is None


def shown(speeds: list[float], periods: float, told: float | None = None):
    amplitude = 0.005 * np.exp(0.7j)
    runs = [run(v, amplitude, periods, 0.02, seed) for seed, v in enumerate(speeds)]
    return [
        harmonic(*each, J, told or dominant_periods(*each, J) or np.nan) for each in runs
    ], np.full(len(speeds), 20.0)


def test_runs_agree_on_a_ripple_and_on_where_it_is() -> None:
    harmonics, dry = shown([0.03, 0.04, 0.05, 0.06], 67.0)
    found = pooled(harmonics, dry)
    assert found.runs == 4
    assert found.periods == pytest.approx(67.0, abs=0.2)
    assert found.amplitude == pytest.approx(0.005 * np.exp(0.7j), abs=2e-4)


def test_two_runs_are_enough_only_where_the_period_was_told() -> None:
    assert pooled(*shown([0.03, 0.05], 67.0)) is None
    assert pooled(*shown([0.03, 0.05], 67.0, told=67.0)) is not None
    assert pooled(*shown([0.03], 67.0, told=67.0)) is None


def test_runs_that_disagree_share_no_ripple() -> None:
    harmonics, dry = shown([0.03, 0.04, 0.05, 0.06], 67.0)
    apart = [replace(each, periods=30.0 + 20.0 * i) for i, each in enumerate(harmonics)]
    assert pooled(apart, dry) is None
    taken, error, ripple = ripple_of_points(apart, dry, dry, dry)
    assert ripple is None
    assert not taken.any()
    assert not error.any()


def test_the_mean_over_a_window_is_that_of_its_samples() -> None:
    ripple = Ripple(67.0, 0.005 * np.exp(0.7j), 1e-4, 4)
    first, last = np.array([0.1, -0.3]), np.array([0.13, -0.2])
    mean, error = ripple.mean(first, last)
    for i in range(2):
        q = first[i] + (last[i] - first[i]) * (np.arange(100_000) + 0.5) / 100_000
        wave = 0.005 * np.cos(67.0 * q + 0.7)
        assert mean[i] == pytest.approx(float(np.mean(wave)), abs=1e-8)
    assert (error <= 1e-4).all()


# Scatter


def test_limits_of_a_deviation_are_those_of_tables() -> None:
    """Chi-square with 9: 2.700 and 19.023 (Fisher and Yates)."""
    low, high = deviation_limits(1.0, 9.0)
    assert low == pytest.approx(np.sqrt(9.0 / 19.023), rel=1e-4)
    assert high == pytest.approx(np.sqrt(9.0 / 2.700), rel=1e-4)


def test_a_single_set_scatters_by_nothing_that_is_known() -> None:
    told = relative_scatter("coulomb_torque", np.array([[25.3, 26.7]]))
    assert told.low is None
    assert str(told.reason) == "a single set: repeats would show how it scatters"


def test_what_is_zero_in_all_sets_has_no_relative_deviation() -> None:
    """A friction that ended at its bound in all maps was divided by its mean."""
    told = relative_scatter("viscous_friction", np.zeros((3, 2)))
    assert np.isnan(told.value)
    assert not told.has_interval
    assert told.reason in ZERO_MEAN


@pytest.mark.parametrize("apart", [0.0, 0.03])
@pytest.mark.parametrize("shared", [0.0, 0.9])
def test_the_interval_of_a_deviation_holds(apart: float, shared: float) -> None:
    """Six maps, two directions that differ by `apart` and share their day to a degree.

    One-sided: where directions do not share it, they tell more than a chi-square of m - 1 counts.
    """
    random = np.random.default_rng(44)
    size = 0.02
    truth = np.hypot(size, apart)
    held = []
    for _ in range(1000):
        day, one, other = random.normal(size=(3, 6))
        both = [np.sqrt(shared) * day + np.sqrt(1.0 - shared) * each for each in (one, other)]
        values = 1.0 + size * np.stack(both, axis=1) + apart * np.array([1.0, -1.0])
        told = relative_scatter("x", values)
        held.append(holds(told, truth))
    assert rejected({"scatter": held}, "less") == {}


def test_the_mean_is_that_over_the_way() -> None:
    """Where friction is large the load is slow: over time it is larger than over whole periods."""
    wave = 2.0 * np.pi * 5.0 * TIME / 4.0  # whole periods
    rate = SPEED * (1.0 - 0.1 * np.sin(wave))
    angle = SPEED * (TIME + 0.1 * 4.0 / (2.0 * np.pi * 5.0) * np.cos(wave))
    torque = 20.0 * (1.0 + 0.05 * np.sin(wave))
    assert np.mean(torque * rate) / np.mean(rate) == pytest.approx(20.0 * (1.0 - 0.0025))
    found = steady_sliding(TIME, rate, torque, angle, 0.0)
    assert found.torque.value == pytest.approx(20.0 * (1.0 - 0.0025), rel=2e-4)
