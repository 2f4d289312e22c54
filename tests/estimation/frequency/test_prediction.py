"""Fits held against responses and outputs that they have not seen."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from campaign.estimation.frequency.measured_response import MeasuredResponse
from campaign.estimation.frequency.output_error import output_error, simulated_output
from campaign.estimation.frequency.prediction import HeldAgainst, held_against
from campaign.estimation.frequency.rational import rational_fit
from campaign.estimation.frequency.two_mass import two_mass, two_mass_fit
from campaign.estimation.frequency.two_mass_model import Side, model, model_jacobian
from tests.estimation.coverage import holds
from tests.estimation.frequency.drives import Drive
from tests.estimation.frequency.measured import noisy

FREQUENCY = np.arange(0.5, 70.0, 0.5)
DRIVE = Drive(2.0, 1.0, 4000.0, 3.0, 9.0)
STIFFER = Drive(2.0, 1.0, 4080.0, 3.0, 9.0)


def measured(drive: Drive, seed: int, of: int = 7) -> MeasuredResponse:
    truth = drive.response(FREQUENCY, "motor")
    level = 0.02 * np.median(np.abs(truth))
    return noisy(FREQUENCY, truth, level, np.random.default_rng(seed), of)


def held(fitted: MeasuredResponse, unseen: MeasuredResponse) -> HeldAgainst:
    fit = rational_fit(fitted, (2, 3))
    at = unseen.frequency
    return held_against(
        unseen, fit.value(at), fit.value(at)[:, None] * fit.log_jacobian(at), fit.scatter
    )


def test_a_right_model_is_off_by_its_deviation() -> None:
    """The square is 1 in the mean, and hardly ever beyond what it says; a tenth is the fit's."""
    found = [held(measured(DRIVE, 2 * k), measured(DRIVE, 2 * k + 1)) for k in range(40)]
    assert np.mean([each.square for each in found]) == pytest.approx(1.0, abs=0.06)
    assert sum(each.square > each.most for each in found) <= 1
    sizes = np.concatenate([each.in_deviations for each in found])
    assert np.mean(sizes**2) < 1.6  # of few realisations a deviation is often too small
    assert np.mean(np.concatenate([e.in_deviations for e in found[:20]]) > 3.0) < 0.02


@pytest.mark.slow
def test_what_the_fit_does_not_know_is_part_of_the_deviation() -> None:
    """A fit of poor data against good ones: without its own scatter it would be far off."""
    squares, alone = [], []
    for k in range(15):
        truth = DRIVE.response(FREQUENCY, "motor")
        level = np.median(np.abs(truth))
        random = np.random.default_rng(k)
        poor = noisy(FREQUENCY, truth, 0.1 * level, random, of=20)
        good = noisy(FREQUENCY, truth, 0.01 * level, random, of=20)
        fit = two_mass_fit({"motor": poor}, False)
        said, by = fit.value(FREQUENCY, "motor"), fit.jacobian(FREQUENCY, "motor")
        squares.append(held_against(good, said, by, fit.covariance).square)
        alone.append(held_against(good, said, by, 0.0 * fit.covariance).square)
    assert np.mean(squares) == pytest.approx(1.0, abs=0.1)
    assert np.mean(alone) > 2.0


def test_another_drive_is_told() -> None:
    found = held(measured(DRIVE, 1), measured(STIFFER, 2))
    assert found.square > found.most
    assert "times the square" in found.verdict
    same = held(measured(DRIVE, 1), measured(DRIVE, 2))
    assert same.verdict == "as closely as scatter allows"
    assert same.relative < found.relative


def test_without_a_variance_there_is_a_difference_and_no_deviation() -> None:
    found = held(measured(DRIVE, 1), measured(DRIVE, 2, of=3))
    assert math.isnan(found.square)
    assert "too few realisations" in found.verdict
    assert found.relative < 0.2


@pytest.mark.parametrize("side", ["motor", "load"])
def test_jacobian_and_polynomials_are_those_of_the_model(side: Side) -> None:
    point = np.array([0.7, -0.5, 8.3, 3.0, 9.0, 0.4, 50.0, 0.001, 0.002])
    sides: tuple[Side, ...] = ("motor", "load")
    delay = 7 + sides.index(side)
    found = model_jacobian(FREQUENCY, point, sides, side)
    for k in range(len(point)):
        step = np.zeros(len(point))
        step[k] = 1e-6 * max(1.0, abs(point[k]))
        ends = [model(FREQUENCY, p, side, float(p[delay])) for p in (point + step, point - step)]
        slope = (ends[0] - ends[1]) / (2.0 * step[k])
        assert np.allclose(found[:, k], slope, rtol=1e-4, atol=1e-8 * np.abs(found).max()), k


@pytest.mark.parametrize("side", ["motor", "load"])
def test_a_drive_gives_its_polynomials(side: Side) -> None:
    truth = DRIVE.response(FREQUENCY, side)
    random = np.random.default_rng(3)
    fit = two_mass({side: noisy(FREQUENCY, truth, 1e-4 * np.median(np.abs(truth)), random)})
    up, down = fit.polynomials(side)
    s = 2j * np.pi * FREQUENCY
    value = np.polynomial.polynomial.polyval(s, up) / np.polynomial.polynomial.polyval(s, down)
    assert np.allclose(value * np.exp(-s * fit.delay(side)), fit.value(FREQUENCY, side))


FINE, RATE, LOWEST, HIGHEST = 4096, 256, 0.5, 40.0


def recorded(
    seconds: float = 30.0, seed: int = 0, drive: Drive = DRIVE
) -> tuple[np.ndarray, np.ndarray]:
    """A torque within 40 Hz and the motor's rate, from rest, with an offset of the sensor."""
    random = np.random.default_rng(seed)
    band = butter(4, HIGHEST, fs=FINE, output="sos")
    torque = sosfiltfilt(band, random.standard_normal(round(seconds * FINE)))
    every = FINE // RATE
    return torque[::every], drive.rates(torque, FINE)[0][::every] + 3.0


def error_of(drive: Drive, torque: np.ndarray, rate: np.ndarray) -> float:
    poles = np.linalg.eigvals(drive.a)
    return simulated_output(
        torque, rate, RATE, lambda f: drive.response(f, "motor"), poles, LOWEST, HIGHEST
    ).relative


def test_the_output_of_the_right_drive_is_that_which_was_recorded() -> None:
    torque, rate = recorded()
    assert error_of(DRIVE, torque, rate) < 1e-3
    assert error_of(STIFFER, torque, rate) > 0.02


def test_what_went_before_a_recording_is_a_free_motion() -> None:
    """Begun in the midst of a motion of a mode that rings for longer than the recording."""
    ringing = replace(DRIVE, damping=0.01, motor_friction=0.05)
    torque, rate = recorded(drive=ringing)
    for part in (slice(1000, None), slice(0, 6000)):
        assert error_of(ringing, torque[part], rate[part]) < 2e-3


def test_noise_is_the_error_of_the_right_drive() -> None:
    torque, rate = recorded()
    random = np.random.default_rng(1)
    white = random.standard_normal(len(rate))
    band = butter(3, (LOWEST, HIGHEST), "bandpass", fs=RATE, output="sos")
    level = 0.1 * np.std(sosfiltfilt(band, rate - 3.0)) / np.std(sosfiltfilt(band, white))
    poles = np.linalg.eigvals(DRIVE.a)
    found = [
        simulated_output(
            torque, rate + level * white, RATE, lambda f: DRIVE.response(f, "motor"), poles,
            LOWEST, HIGHEST,
        )
    ]  # fmt: skip
    told = output_error("error", found, LOWEST)
    assert holds(told, 0.1)
    assert told.value == pytest.approx(0.1, rel=0.2)


def test_a_recording_too_short_is_refused() -> None:
    torque, rate = recorded(8.0)
    with pytest.raises(ValueError, match="shorter than 6 periods"):
        error_of(DRIVE, torque, rate)
