"""The relative rate from sensors that count: slopes stay, nothing is delayed, counts are small."""

from __future__ import annotations

import numpy as np
import pytest

from campaign.estimation.relative_rate import (
    WORST_COUNT,
    RelativeRate,
    mean,
    relative_rate,
    slides_from,
    slope,
    window_for,
)

STEP = 1e-3
COUNT = np.deg2rad(0.0055)
TIME = np.arange(8000) * STEP
FREQUENCY = 0.25
AMPLITUDE = np.deg2rad(12.0)
RATE = AMPLITUDE * np.cos(2 * np.pi * FREQUENCY * TIME)
ANGLE = AMPLITUDE / (2 * np.pi * FREQUENCY) * np.sin(2 * np.pi * FREQUENCY * TIME)


def counted(angle: np.ndarray) -> np.ndarray:
    return COUNT * np.floor(angle / COUNT)


def inside(values: np.ndarray) -> np.ndarray:
    return values[np.isfinite(values)]


@pytest.mark.parametrize("span", [3, 21, 101])
def test_a_ramp_of_the_rate_keeps_its_slope_and_its_place(span: int) -> None:
    acceleration, rate = 0.3, -0.7
    angle = rate * TIME + 0.5 * acceleration * TIME**2
    found = slope(angle, STEP, span)
    known = np.isfinite(found)
    assert np.count_nonzero(~known) == span - 1
    np.testing.assert_allclose(found[known], (rate + acceleration * TIME)[known], atol=1e-9)


@pytest.mark.parametrize("span", [3, 21, 101])
def test_a_mean_of_a_ramp_is_the_ramp(span: int) -> None:
    found = mean(0.2 + 3.0 * TIME, span)
    known = np.isfinite(found)
    np.testing.assert_allclose(found[known], (0.2 + 3.0 * TIME)[known], rtol=1e-12)


@pytest.mark.parametrize("backwards", [slice(None), slice(None, None, -1)])
def test_it_is_the_same_backwards_in_time(backwards: slice) -> None:
    random = np.random.default_rng(531).standard_normal(500)
    forward, turned = slope(random, STEP, 41), slope(random[::-1], STEP, 41)
    np.testing.assert_allclose(forward[backwards], -turned[::-1][backwards], atol=1e-9)


def test_a_sine_of_counts_keeps_its_phase() -> None:
    """By least squares: 0.01 deg of a cycle is 0.1 ms; a difference of counts is late by half a
    sample, a low-pass of 5 ms by 0.45 deg."""
    found = slope(counted(ANGLE), STEP, 101)
    known = np.isfinite(found)
    omega = 2 * np.pi * FREQUENCY * TIME[known]
    design = np.column_stack([np.cos(omega), np.sin(omega), np.ones(len(omega))])
    cosine, sine, _ = np.linalg.lstsq(design, found[known], rcond=None)[0]
    assert abs(np.degrees(np.arctan2(sine, cosine))) < 0.01
    assert np.hypot(cosine, sine) == pytest.approx(AMPLITUDE, rel=2e-3)


@pytest.mark.parametrize("finest", np.deg2rad([0.5, 0.1]))
def test_the_window_makes_counts_as_fine_as_was_asked(finest: float) -> None:
    """The bound holds for every sample of a staircase, and a third of the window breaks it."""
    span = window_for(COUNT, 0.0, STEP, finest)
    assert span % 2 == 1
    motion = slope(ANGLE, STEP, span)
    error = np.max(np.abs(inside(slope(counted(ANGLE), STEP, span) - motion)))
    assert error <= finest
    third = span // 6 * 2 + 1
    error = np.max(np.abs(inside(slope(counted(ANGLE), STEP, third) - slope(ANGLE, STEP, third))))
    assert error > finest


def test_a_single_count_adds_what_is_said_at_most() -> None:
    step = np.where(TIME < 4.0, 0.0, COUNT)
    assert np.nanmax(slope(step, STEP, 101)) == pytest.approx(
        WORST_COUNT * COUNT / (101 * STEP), rel=1e-3
    )


def shown(angle: np.ndarray | None, gyro: np.ndarray | None, longest: float) -> RelativeRate:
    recorded = np.gradient(ANGLE if angle is None else angle, STEP)
    return relative_rate(recorded, angle, gyro, -RATE, STEP, np.deg2rad(0.1), longest)


def test_a_sensor_that_resolves_it_is_shown_as_recorded() -> None:
    found = shown(ANGLE, None, 0.1)
    assert (found.window, found.finest, found.sensor) == (0.0, 0.0, "encoder")
    np.testing.assert_array_equal(found.values, np.gradient(ANGLE, STEP))


def test_counts_are_filtered_over_the_window_that_is_told() -> None:
    found = shown(counted(ANGLE), None, 1.0)
    assert found.sensor == "encoder"
    assert found.window == pytest.approx(1.5 * 0.0055 / 0.1, abs=2 * STEP)
    assert found.blind == pytest.approx(COUNT)
    assert np.max(np.abs(inside(found.values - RATE))) < np.deg2rad(0.1)


def test_where_counts_are_too_coarse_the_rates_in_space_are_shown() -> None:
    noise = np.deg2rad(0.002) * np.random.default_rng(532).standard_normal(len(TIME))
    found = shown(counted(ANGLE), noise, 0.05)
    assert (found.sensor, found.window, found.blind) == ("gyro", 0.0, 0.0)
    np.testing.assert_allclose(found.values, noise + RATE)


def test_a_noisy_gyro_is_averaged() -> None:
    noise = np.deg2rad(0.2) * np.random.default_rng(533).standard_normal(len(TIME))
    found = shown(counted(ANGLE), noise, 0.05)
    assert found.sensor == "gyro"
    assert 0.01 < found.window <= 0.05
    assert np.std(inside(found.values - RATE)) < np.deg2rad(0.1)


def test_where_neither_is_fine_enough_it_says_how_fine_the_encoder_is() -> None:
    found = shown(counted(ANGLE), None, 0.02)
    assert found.sensor == "encoder"
    assert found.window <= 0.02
    assert found.finest == pytest.approx(1.5 * COUNT / found.window, rel=1e-9)
    assert found.finest > np.deg2rad(0.1)


def test_a_lost_sample_costs_its_window() -> None:
    angle = counted(ANGLE)
    angle[4000] = np.nan
    found = shown(angle, None, 1.0)
    lost = np.flatnonzero(~np.isfinite(found.values))
    half = round(found.window / STEP) // 2
    lost = lost[(lost >= half) & (lost < len(angle) - half)]
    assert (lost.min(), lost.max()) == (4000 - half, 4000 + half)


def test_a_short_recording_has_no_values() -> None:
    assert np.all(np.isnan(slope(np.arange(5.0), STEP, 9)))


def test_what_creeps_or_scatters_does_not_slide() -> None:
    """A spike that comes back counts for nothing; what stays to four times does."""
    rate = np.array([0.0, 1.5, 0.2, 1.1, 2.0, 3.0, 4.5, 0.0])
    assert slides_from(rate, 1.0) == (3, 7)
    assert slides_from(-rate[:6], 1.0) == (3, 6)
    assert slides_from(rate[:3], 1.0) is None
    assert slides_from(np.append(rate[:6], np.nan), 1.0) == (3, 7)
