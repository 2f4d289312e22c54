"""Windows of sliding in closed form: what is steady, what is not, and why."""

from __future__ import annotations

import numpy as np
import pytest

from campaign.estimation.steadiness import (
    RATE_DRIFTS,
    RATE_UNCERTAIN,
    RATE_VARIES,
    STICK_SLIP,
    TOO_FEW_COUNTS,
    TORQUE_DRIFTS,
    drifting,
    torque_drift,
    unsteady,
)
from campaign.estimation.steady_sliding import steady_sliding
from campaign.reason import Reason

STEP, SPEED = 1e-3, 0.02
TIME = np.arange(8000) * STEP
PERIOD = 0.5
PHASE = TIME / PERIOD % 1.0


def noise(size: float, seed: int = 1) -> np.ndarray:
    return size * np.random.default_rng(seed).normal(size=len(TIME))


def stick_slip(slips: float) -> np.ndarray:
    """Half waves in a share `slips` of each period, with a mean of SPEED."""
    wave = np.sin(np.pi * PHASE / slips)
    return 0.5 * np.pi * SPEED / slips * np.where(slips > PHASE, wave, 0.0)


def path(rate: np.ndarray) -> np.ndarray:
    return np.cumsum(rate) * STEP


def counted(angle: np.ndarray, count: float) -> np.ndarray:
    return np.round(angle / count) * count


def value(reason: Reason, name: str) -> float:
    return float(str(dict(reason.values)[name]))


@pytest.mark.parametrize("size", [0.0, 0.002, 0.02, 0.2])
def test_white_noise_of_the_sensor_is_steady(size: float) -> None:
    """Up to ten times the mean rate."""
    for seed in range(20):
        assert not unsteady(TIME, SPEED + noise(size, seed), None)


@pytest.mark.parametrize("slips", [0.2, 0.5])
@pytest.mark.parametrize("size", [0.0, 0.002])
def test_stick_slip_is_found_at_its_size(slips: float, size: float) -> None:
    """Half waves in a share s of the time deviate by sqrt(pi^2 / 8 s - 1) of their mean."""
    reason = unsteady(TIME, stick_slip(slips) + noise(size), None)
    assert reason in STICK_SLIP
    assert value(reason, "spread_percent") == pytest.approx(
        100 * np.sqrt(np.pi**2 / (8 * slips) - 1), rel=0.03
    )
    assert abs(value(reason, "least_percent")) < 10.0


def test_the_mean_over_a_rate_that_varies_little_is_that_of_its_mean() -> None:
    """Ten percent are the limit; friction at it is off by a hundredth of Ts - Tc at most."""
    swing = np.sqrt(2.0) * np.sin(2 * np.pi * PHASE)
    assert not unsteady(TIME, SPEED * (1.0 + 0.09 * swing), None)
    reason = unsteady(TIME, SPEED * (1.0 + 0.2 * swing), None)
    assert reason in RATE_VARIES
    assert value(reason, "spread_percent") == pytest.approx(20.0, rel=0.01)
    for exponent in (1.0, 2.0):
        for mean in np.geomspace(0.05, 5.0, 30):
            fall = np.exp(-((mean * (1.0 + 0.1 * swing)) ** exponent))
            assert abs(fall.mean() - np.exp(-(mean**exponent))) < 0.01


def test_counts_of_a_steady_motion_are_no_stick_slip() -> None:
    """One count per millisecond is 0.4 rad/s, twenty times the mean: zeros and spikes."""
    angle = counted(SPEED * TIME, 4e-4)
    rate = np.diff(angle, prepend=-4e-4) / STEP
    assert np.std(rate) > 2.0 * SPEED
    assert not unsteady(TIME, rate, angle, own_sensor=False)
    # A low-pass hides what a count is; the angle still says it.
    smooth = np.convolve(rate, np.exp(-np.arange(60) / 5.0) / 5.5, mode="same")
    assert not unsteady(TIME, smooth, angle, own_sensor=False)
    assert unsteady(TIME, smooth, angle) in STICK_SLIP


def test_stick_slip_shows_through_counts() -> None:
    angle = counted(path(stick_slip(0.3)), 1e-4)
    rate = np.diff(angle, prepend=angle[0]) / STEP
    assert unsteady(TIME, rate, angle, own_sensor=False) in STICK_SLIP


def test_a_window_of_few_counts_tells_no_rate() -> None:
    """0.16 rad are 8 counts of 0.02 rad, by the encoder and by a rate that is made of it."""
    angle = counted(SPEED * TIME, 0.02)
    rate = np.diff(angle, prepend=angle[0]) / STEP
    for seen in (angle, None):
        reason = unsteady(TIME, rate, seen, own_sensor=False)
        assert reason in TOO_FEW_COUNTS
        assert value(reason, "counts") == pytest.approx(8.0, rel=0.15)
    # A gyro does not need the encoder.
    assert not unsteady(TIME, SPEED + noise(0.001), angle)


def test_the_gyro_shows_what_the_encoder_needs_too_long_for() -> None:
    """At 5 % of the mean an encoder of 0.5 mrad needs 0.75 s, over which slips every 0.5 s are
    hardly seen.
    """
    rate = stick_slip(0.5)
    angle = counted(path(rate), 5e-4)
    assert unsteady(TIME, rate + noise(0.001), angle) in STICK_SLIP


def test_lost_samples_do_not_look_like_a_slip() -> None:
    kept = np.r_[0:2000, 2600:5000, 5001:8000]
    angle = counted(SPEED * TIME, 1e-5)
    assert not unsteady(TIME[kept], np.full(len(kept), SPEED), angle[kept], own_sensor=False)
    assert not unsteady(TIME[kept], (SPEED + noise(0.01))[kept], angle[kept])


def test_an_axis_that_rests_does_not_slide() -> None:
    assert unsteady(TIME, np.zeros_like(TIME), None) in RATE_UNCERTAIN


def test_a_rate_that_drifts_or_is_uncertain() -> None:
    assert drifting(0.03, 0.0, 0.1) in RATE_DRIFTS
    assert drifting(-0.03, 0.0, -0.1) in RATE_DRIFTS
    assert drifting(0.0, 0.03, -0.1) in RATE_UNCERTAIN
    assert not drifting(0.02, 0.02, 0.1)
    assert not drifting(0.0, np.nan, 0.1)


def test_a_torque_that_runs_in_is_reported_with_its_size() -> None:
    """A fall of 5 % beside noise of 10 %; the point stays one."""
    torque = -20.0 * (1.0 - 0.05 * TIME / TIME[-1]) + noise(2.0)
    reason = torque_drift(torque)
    assert reason in TORQUE_DRIFTS
    assert value(reason, "percent") == pytest.approx(-5.0, abs=1.5)
    found = steady_sliding(TIME, np.full_like(TIME, -SPEED), torque, None, 1.0)
    assert not found.unsteady
    assert found.drift == reason


def test_scatter_of_a_torque_is_no_trend() -> None:
    """At 99 % each: noise, and noise that lasts a twentieth of the window, of 10 %."""
    lasting = np.exp(-np.arange(2000) / 100.0)
    for size, shape in ((2.0, np.ones(1)), (0.3, lasting)):
        told = [
            bool(torque_drift(20.0 + np.convolve(noise(size, seed), shape, mode="same")))
            for seed in range(100)
        ]
        assert sum(told) <= 5
    assert not torque_drift(20.0 * (1.0 + 0.008 * TIME / TIME[-1]))


def test_the_ripple_of_a_torque_is_no_trend() -> None:
    """Of nine tenths of a period a line explains much, and a wave all of it."""
    wave = 0.9 * 2 * np.pi * TIME / TIME[-1]
    torque = 20.0 + 2.0 * np.sin(wave)
    columns = np.column_stack([np.cos(wave), np.sin(wave)])
    assert torque_drift(torque)
    assert not torque_drift(torque, columns - columns.mean(axis=0))
