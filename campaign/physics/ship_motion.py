"""Roll of a ship in irregular beam seas: wave spectrum and second-order response.

Long-crested deep-water waves reach a stationary ship from abeam. With f the frequency and w = 2 pi
f, the one-sided spectra per hertz are

    elevation      S(f)  = 5/16 Hs^2 fp^4 f^-5 exp(-5/4 (fp/f)^4)              (m^2/Hz)
    wave slope     Sa(f) = (w^2 / g)^2 S(f)                                    (rad^2/Hz)
    roll angle     Sr(f) = |H(f)|^2 Sa(f),
                   H(f)  = e wn^2 / (wn^2 - w^2 + 2 i zeta wn w)               (rad^2/Hz)
    acceleration   w^4 Sr(f)                                                   (rad^2/s^4/Hz)

The first is Bretschneider's spectrum, which the 15th ITTC (1978) adopted for the open sea, written
with significant height Hs and peak frequency fp. The second is Airy's dispersion k = w^2/g. The
third is linear roll, driven by the effective wave slope e times the slope at the hull. Both are
textbook: A. R. J. M. Lloyd, Seakeeping: Ship Behaviour in Rough Weather (1989), chapters 3 to 8.

Waves shorter than the beam lift and lower one hull at the same time, so the slope is cut off above
a frequency. Without this, the variance of the acceleration would grow without bound.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from campaign.signals import Array, MultiSine

GRAVITY = 9.80665
"""m/s^2."""
LOWEST = 0.4
"""Relative to the peak frequency; the spectrum below it has 1e-21 of the energy."""
FINE = 400
"""Points per component in the integral of the spectrum; a lightly damped roll is narrow."""


@dataclass(frozen=True)
class ShipRoll:
    """A sea and a ship, SI.

    Attributes:
        significant_height: Hs (m).
        peak_period: 1/fp (s).
        natural_period: of roll, 2 pi / wn (s).
        damping_ratio: zeta of roll.
        slope_coefficient: e, the effective wave slope over the slope at the surface.
        cutoff: frequency above which waves do not roll the ship (Hz).
    """

    significant_height: float
    peak_period: float
    natural_period: float
    damping_ratio: float
    slope_coefficient: float
    cutoff: float

    def elevation_spectrum(self, frequency: Array) -> Array:
        """S(f) in m^2/Hz at `frequency` (Hz), shape (n,)."""
        relative = 1.0 / (self.peak_period * frequency)
        fall = np.exp(-1.25 * relative**4)
        return np.asarray(0.3125 * self.significant_height**2 * relative**4 / frequency * fall)

    def roll_spectrum(self, frequency: Array) -> Array:
        """Sr(f) in rad^2/Hz at `frequency` (Hz), shape (n,); zero above the cut-off."""
        omega = 2 * np.pi * frequency
        natural = 2 * np.pi / self.natural_period
        damped = 2j * self.damping_ratio * natural * omega
        response = self.slope_coefficient * natural**2 / (natural**2 - omega**2 + damped)
        slope = (omega**2 / GRAVITY) ** 2 * self.elevation_spectrum(frequency)
        return np.where(frequency <= self.cutoff, np.abs(response) ** 2 * slope, 0.0)

    def acceleration_spectrum(self, frequency: Array) -> Array:
        """Spectrum of the roll acceleration in rad^2/s^4/Hz, shape (n,)."""
        return np.asarray((2 * np.pi * frequency) ** 4 * self.roll_spectrum(frequency))


def roll_acceleration(ship: ShipRoll, components: int, seed: int) -> MultiSine:
    """A realisation of the roll acceleration (rad/s^2): one sine per slice of the spectrum.

    Slices have equal widths. Each sine has the energy of its slice, so the variance is exactly that
    of the spectrum. Its frequency is random within the slice, so the motion does not repeat; its
    phase is random. Raises ValueError if the cut-off leaves no waves.
    """
    lowest = LOWEST / ship.peak_period
    if ship.cutoff <= lowest:
        raise ValueError(
            f"the cut-off of {ship.cutoff:.4g} Hz leaves no waves: with a peak period of "
            f"{ship.peak_period:.4g} s they begin at {lowest:.4g} Hz"
        )
    random = np.random.Generator(np.random.PCG64(seed))
    edges = np.linspace(lowest, ship.cutoff, components + 1)
    width = edges[1] - edges[0]
    middles = (np.arange(FINE) + 0.5) / FINE * width
    inside = edges[:-1, None] + middles
    energy = ship.acceleration_spectrum(inside).mean(axis=1) * width
    frequencies = edges[:-1] + random.random(components) * width
    phases = random.random(components) * 2 * np.pi
    return MultiSine(
        amplitudes=tuple(float(a) for a in np.sqrt(2 * energy)),
        frequencies=tuple(float(f) for f in frequencies),
        phases=tuple(float(p) for p in phases),
    )
