"""Ship motion: spectra against closed forms and quadrature, realisations against spectra."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from campaign.physics.base_motion import base_rate
from campaign.physics.ship_motion import ShipRoll, roll_acceleration

SHIP = ShipRoll(2.5, 8.8, 8.0, 0.1, 0.75, 0.35)


def test_the_sea_has_its_significant_height() -> None:
    """The variance of the elevation is (Hs / 4)^2, and the spectrum peaks at 1 / Tp."""
    variance, _ = quad(lambda f: SHIP.elevation_spectrum(np.array([f]))[0], 0.02, 20, limit=400)
    assert 4 * np.sqrt(variance) == pytest.approx(2.5, rel=1e-4)
    frequency = np.linspace(0.05, 0.5, 100_001)
    peak = frequency[np.argmax(SHIP.elevation_spectrum(frequency))]
    assert peak == pytest.approx(1 / 8.8, rel=1e-3)


def test_a_stiff_ship_follows_the_wave_slope() -> None:
    """Far below its natural frequency the roll is e times the slope: e^2 (w^2/g)^2 S."""
    stiff = ShipRoll(2.5, 8.8, 0.5, 0.1, 0.6, 0.35)
    frequency = np.array([0.08, 0.12])
    slope = ((2 * np.pi * frequency) ** 2 / 9.80665) ** 2 * stiff.elevation_spectrum(frequency)
    np.testing.assert_allclose(stiff.roll_spectrum(frequency), 0.36 * slope, rtol=1e-2)


def test_a_lightly_damped_roll_is_all_resonance() -> None:
    """Its variance is that of white noise through a resonance: e^2 Sa(fn) pi fn / (4 zeta)."""
    light = ShipRoll(2.5, 8.8, 8.0, 0.002, 0.75, 0.35)
    natural = np.array([1 / 8.0])
    slope = ((2 * np.pi * natural) ** 2 / 9.80665) ** 2 * light.elevation_spectrum(natural)
    expected = float(0.75**2 * slope[0] * np.pi * natural[0] / (4 * 0.002))
    motion = roll_acceleration(light, 500, 1)
    omega = 2 * np.pi * np.array(motion.frequencies)
    variance = np.sum((np.array(motion.amplitudes) / omega**2) ** 2) / 2
    assert variance == pytest.approx(expected, rel=0.03)


@pytest.mark.parametrize(("components", "seed"), [(10, 1), (60, 2), (200, 3)])
def test_a_realisation_has_the_variance_of_its_spectrum(components: int, seed: int) -> None:
    def spectrum(f: float) -> float:
        """As in the module's equations, written once more."""
        omega, natural = 2 * np.pi * f, 2 * np.pi / 8.0
        elevation = 5 / 16 * 2.5**2 / 8.8**4 * f**-5 * np.exp(-1.25 / (8.8 * f) ** 4)
        slope = omega**4 / 9.80665**2 * elevation
        gain = 0.75 * natural**2 / np.hypot(natural**2 - omega**2, 0.2 * natural * omega)
        return gain**2 * slope * omega**4

    expected, _ = quad(spectrum, 0.02, 0.35, limit=400)
    motion = roll_acceleration(SHIP, components, seed)
    assert len(motion.amplitudes) == components
    assert np.sum(np.square(motion.amplitudes)) / 2 == pytest.approx(expected, rel=1e-5)
    assert max(motion.frequencies) <= 0.35
    assert np.all(np.diff(motion.frequencies) > 0)  # one in each slice

    time = np.arange(0.0, 20_000.0, 0.25)
    assert np.var(motion.sample(time)) == pytest.approx(expected, rel=0.05)
    assert np.mean(base_rate(motion, time)) == pytest.approx(0.0, abs=1e-4)


def test_the_seed_is_the_sea() -> None:
    assert roll_acceleration(SHIP, 60, 1) == roll_acceleration(SHIP, 60, 1)
    one, other = roll_acceleration(SHIP, 60, 1), roll_acceleration(SHIP, 60, 2)
    assert one.amplitudes == other.amplitudes
    time = np.arange(0.0, 2000.0, 0.5)
    assert abs(np.corrcoef(one.sample(time), other.sample(time))[0, 1]) < 0.3


def test_a_cutoff_below_the_sea_is_refused() -> None:
    with pytest.raises(ValueError, match="leaves no waves"):
        roll_acceleration(ShipRoll(2.5, 8.8, 8.0, 0.1, 0.75, 0.04), 60, 1)
