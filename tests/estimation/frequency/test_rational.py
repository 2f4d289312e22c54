"""Functions with a delay through responses of drives and loops with closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from campaign.estimate import Origin
from campaign.estimation.frequency.measured_response import closed_from_open
from campaign.estimation.frequency.modes import chosen_modes, modes
from campaign.estimation.frequency.orders import chosen_order, order_of
from campaign.estimation.frequency.rational import LARGE_RESIDUALS, rational_fit
from campaign.estimation.frequency_response import open_loop
from campaign.estimation.intervals import MODEL_MISFIT
from tests.estimation.coverage import holds, rejected
from tests.estimation.frequency.drives import Drive, random_drive
from tests.estimation.frequency.measured import noisy, scatter_as_told

FREQUENCY = np.arange(0.5, 70.0, 0.5)
DRIVE = Drive(2.0, 1.0, 4000.0, 3.0, 9.0)


def delayed(truth: np.ndarray, delay: float, frequency: np.ndarray = FREQUENCY) -> np.ndarray:
    return truth * np.exp(-2j * np.pi * frequency * delay)


@pytest.mark.parametrize("delay", [0.0, 0.004, 0.03])
def test_without_noise_the_function_is_found(delay: float) -> None:
    truth = delayed(DRIVE.response(FREQUENCY, "motor"), delay)
    measured = noisy(FREQUENCY, truth, 1e-9 * np.abs(truth), np.random.default_rng(1))
    fit = rational_fit(measured, (2, 3))
    assert np.allclose(fit.value(FREQUENCY), truth, rtol=1e-6)
    assert fit.delay == pytest.approx(delay, abs=1e-8)
    assert np.allclose(np.sort_complex(fit.poles), np.sort_complex(np.linalg.eigvals(DRIVE.a)))
    zero = fit.zeros[np.argmax(fit.zeros.imag)]
    assert abs(zero) / 2 / np.pi == pytest.approx(DRIVE.antiresonance)


@pytest.mark.slow
def test_modes_and_delay_are_held_as_often_as_is_said() -> None:
    held: dict[str, list[bool]] = {"pole": [], "zero": [], "damping": [], "delay": []}
    orders = []
    for seed in range(20):
        random = np.random.default_rng(seed)
        drive, delay = random_drive(random), random.uniform(0, 0.005)
        truth = delayed(drive.response(FREQUENCY, "motor"), delay)
        level = 10 ** random.uniform(-3, -1.7) * np.median(np.abs(truth))
        chosen = chosen_order(noisy(FREQUENCY, truth, level, random))
        orders.append(order_of(chosen.fit))
        assert not chosen.fit.misfit
        found = chosen_modes(chosen)
        expected = abs(drive.pole) / 2 / np.pi
        pole = min(
            (each for each in found if not each.is_zero),
            key=lambda each: abs(each.frequency.value - expected),
        )
        zero = min(
            (each for each in found if each.is_zero),
            key=lambda each: abs(each.frequency.value - drive.antiresonance),
        )
        assert pole.frequency.value == pytest.approx(expected, rel=0.01)
        held["pole"].append(holds(pole.frequency, expected))
        held["zero"].append(holds(zero.frequency, drive.antiresonance))
        held["damping"].append(holds(pole.damping, -drive.pole.real / abs(drive.pole)))
        deviation = np.sqrt(chosen.fit.scatter[-1, -1])
        held["delay"].append(abs(chosen.fit.delay - delay) < 1.96 * deviation)
    assert not rejected(held)
    assert orders.count((2, 3)) >= 19


def test_errors_are_the_scatter_of_repeated_measurements() -> None:
    """Of 7 realisations: their variances are weights, and scatter themselves."""
    truth = delayed(DRIVE.response(FREQUENCY, "motor"), 0.002)
    level = 0.02 * np.median(np.abs(truth))
    fits = [
        rational_fit(noisy(FREQUENCY, truth, level, np.random.default_rng(seed)), (2, 3))
        for seed in range(100)
    ]
    delays = np.array([fit.delay for fit in fits])
    told = np.sqrt(np.mean([fit.scatter[-1, -1] for fit in fits]))
    assert np.std(delays, ddof=1) / told == pytest.approx(1, abs=0.2)
    resonances = [mode for fit in fits for mode in modes(fit) if not mode.is_zero]
    assert len(resonances) == 100
    for part in ("frequency", "damping"):
        ratio = scatter_as_told([getattr(mode, part) for mode in resonances])
        # What few lines tell is told less sharply than the weights' scatter over many allows for.
        assert ratio == pytest.approx(0.85, abs=0.25)


def test_what_no_function_of_that_order_gives_is_misfit() -> None:
    """A second mode that the order has no place for: values, but no interval."""
    truth = DRIVE.response(FREQUENCY, "motor")
    s = 2j * np.pi * FREQUENCY
    second = 1.0 + 0.5 * s**2 / (s**2 + 0.04 * 2 * np.pi * 50 * s + (2 * np.pi * 50) ** 2)
    measured = noisy(FREQUENCY, truth * second, 0.002 * np.abs(truth), np.random.default_rng(2))
    fit = rational_fit(measured, (2, 3))
    assert fit.misfit in LARGE_RESIDUALS
    assert all(not mode.frequency.has_interval for mode in modes(fit))
    assert all(mode.frequency.reason in MODEL_MISFIT for mode in modes(fit))
    chosen = chosen_order(measured)
    assert not chosen.fit.misfit
    assert order_of(chosen.fit) == (4, 5)


def test_a_mode_outside_of_the_band_is_not_determined() -> None:
    frequency = np.arange(0.5, 8.0, 0.05)
    truth = DRIVE.response(frequency, "motor")
    measured = noisy(frequency, truth, 1e-5 * np.abs(truth), np.random.default_rng(3))
    found = [mode for mode in modes(rational_fit(measured, (2, 3))) if not mode.is_zero]
    assert [mode.frequency.origin for mode in found] == [Origin.NOT_DETERMINED]


def test_an_unstable_pole_is_refused_where_it_is_sure() -> None:
    frequency = np.geomspace(0.1, 10, 60)
    s = 2j * np.pi * frequency
    truth = 1.0 / (s - 3.0)
    measured = noisy(frequency, truth, 1e-3 * np.abs(truth), np.random.default_rng(4))
    assert rational_fit(measured, (0, 1)).poles[0].real == pytest.approx(3.0, rel=0.01)
    with pytest.raises(ValueError, match="a pole is unstable"):
        chosen_order(measured, 1)


def test_variances_of_few_realisations_are_no_weights() -> None:
    truth = DRIVE.response(FREQUENCY, "motor")
    measured = noisy(FREQUENCY, truth, 1e-3 * np.abs(truth), np.random.default_rng(5), of=3)
    with pytest.raises(ValueError, match="not determined well enough"):
        rational_fit(measured, (2, 3))


def test_the_closed_loop_of_an_open_one_is_that_of_sines() -> None:
    s = 2j * np.pi * FREQUENCY
    truth = 30.0 / s / (1 + s / 200)
    measured = noisy(FREQUENCY, truth, 1e-2 * np.abs(truth), np.random.default_rng(6))
    closed = closed_from_open(measured)
    again = open_loop(closed.response)
    assert np.allclose(again.values, measured.values)
    assert np.allclose(again.error, measured.response.error)
    # Of T: |1 / (1 + L)²|² times as much variance.
    assert np.allclose(closed.variance, measured.variance / np.abs(1 + measured.values) ** 4)
