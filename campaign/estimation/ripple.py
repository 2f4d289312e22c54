"""Position-dependent ripple of friction: fitted to long runs, removed from short windows.

T = dry(v) (1 + Re(z exp(i N q))) + sigma2 v, with N periods per revolution of the angle q. A window
that is short against a period contains one place of the ripple, also if it is long in time;
repetitions at that place do not show it. Runs over many periods determine N and z. The ripple that
drives the load is F = T - J dω/dt: below the loop's bandwidth both T and ω follow it.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from campaign.arrays import Array
from campaign.estimation.intervals import BATCHES, of_series
from campaign.estimation.least_squares import straight_line

LEAST_PERIODS = 0.8
"""Fewest periods in a window that separate its cosine and sine from its mean."""
SEARCHED_PERIODS = 2.5
"""Fewest periods in a run for the search of N."""
FASTEST = 1.5
"""Highest frequency of the ripple (Hz) in the search: above it the loop does not follow."""
BINS = 512
"""Number of bins over a run for the search of N."""
STANDS_OUT = 5.0
"""Least ratio of the largest harmonic to the median one for a ripple."""
AGREEING = 3
"""Fewest runs with the same N, where N is not given."""
CERTAIN = 3.0
"""Least pooled amplitude, in standard errors."""


@dataclass(frozen=True)
class Harmonic:
    """Ripple of one run: F = cosine cos N(q - centre) + sine sin N(q - centre) (N m).

    Attributes:
        periods: N, per revolution.
        error: standard error of cosine and of sine (N m).
        travel: angle of the run (rad), positive.
    """

    periods: float
    cosine: float
    sine: float
    error: float
    centre: float
    travel: float


@dataclass(frozen=True)
class Ripple:
    """Ripple of a map, relative to dry friction: Re(amplitude exp(i periods q)).

    Attributes:
        periods: N, per revolution.
        error: standard error of the amplitude's real and imaginary part.
        runs: number of runs that it is estimated from.
    """

    periods: float
    amplitude: complex
    error: float
    runs: int

    def mean(self, first: Array, last: Array) -> tuple[Array, Array]:
        """Mean of the ripple between two angles, and its standard error; all of shape (n,)."""
        middle, half = 0.5 * (first + last), 0.5 * (last - first)
        seen = np.sinc(self.periods * half / np.pi)
        wave = np.exp(1j * self.periods * middle) * seen
        return np.real(self.amplitude * wave), self.error * np.abs(seen)


def window_noise(error: Array, ripple: Ripple, first: Array, last: Array, dry: Array) -> Array:
    """Standard errors of windows' means without the drift that a ripple causes in a short window.

    A window over most of a period has its own fit of cosine and sine. In a shorter one the ripple
    is a drift that batch means count as noise, so that a slow point has too little weight. At
    least a tenth of the standard error remains.

    Args:
        error: standard error from batch means (N m), shape (n,).
        first, last: angles of each window (rad), shape (n,).
        dry: signed friction torque without its viscous part (N m), shape (n,).
    """
    place = (np.arange(BATCHES) + 0.5) / BATCHES
    angle = first[:, None] + (last - first)[:, None] * place
    wave = np.real(ripple.amplitude * np.exp(1j * ripple.periods * angle))
    drift = np.abs(dry) * np.std(wave, axis=1, ddof=1) / math.sqrt(BATCHES)
    short = ripple.periods * np.abs(last - first) < 2.0 * math.pi * LEAST_PERIODS
    left = np.sqrt(np.maximum(error**2 - drift**2, (0.1 * error) ** 2))
    return np.where(short, left, error)


def harmonics_of(angle: Array, periods: float) -> Array:
    """Cos Nq and sin Nq, shape (n, 2)."""
    return np.stack([np.cos(periods * angle), np.sin(periods * angle)], axis=1)


def harmonic(angle: Array, rate: Array, torque: Array, inertia: float, periods: float) -> Harmonic:
    """Cosine and sine of F at N `periods` per revolution, in a run at constant speed; arrays (n,).

    Raises ValueError for a run shorter than `LEAST_PERIODS`.
    """
    steady = straight_line(angle)
    travel = abs(float(steady[-1] - steady[0]))
    if periods * travel < 2.0 * math.pi * LEAST_PERIODS:
        raise ValueError("the run is too short for a ripple of that period")
    centre = 0.5 * float(steady[0] + steady[-1])
    drift = np.linspace(-1.0, 1.0, len(angle))
    columns = np.column_stack(
        [np.ones_like(drift), drift, harmonics_of(steady - centre, periods)],
    )
    both, _, _, _ = np.linalg.lstsq(columns, np.stack([torque, rate], axis=1), rcond=None)
    speed = float(np.mean(rate))
    # With q = centre + v t, the cosine of dω/dt is N v times the sine of ω; its sine is -N v times
    # the cosine of ω.
    cosine = both[2, 0] - inertia * periods * speed * both[3, 1]
    sine = both[3, 0] + inertia * periods * speed * both[2, 1]
    noise = of_series("torque", torque - columns @ both[:, 0], "N m").standard_error
    error = math.sqrt(2.0) * (noise if noise is not None else float(np.std(torque)))
    return Harmonic(periods, float(cosine), float(sine), error, centre, travel)


def dominant_periods(angle: Array, rate: Array, torque: Array, inertia: float) -> float | None:
    """N of the dominant ripple in a run at constant speed; None without one.

    Searched from `SEARCHED_PERIODS` in the run's travel to a frequency of `FASTEST`. Arrays (n,).
    """
    count = min(BINS, len(angle) // 2)
    if count < 20:
        return None
    used = len(angle) // count * count
    parts = [np.asarray(x[:used]).reshape(count, -1).mean(axis=1) for x in (angle, rate, torque)]
    steady, speed = straight_line(parts[0]), float(np.mean(rate))
    travel = abs(float(steady[-1] - steady[0]))
    if travel == 0.0 or speed == 0.0:
        return None
    lowest = 2.0 * math.pi * SEARCHED_PERIODS / travel
    highest = min(2.0 * math.pi * FASTEST / abs(speed), 0.5 * math.pi * count / travel)
    if highest <= lowest:
        return None
    steady = steady - steady.mean()
    taper = np.hanning(count)
    rest = [(x - straight_line(x)) * taper for x in parts[1:]]

    def size(periods: Array, near: Array | float) -> Array:
        # The acceleration keeps the frequency of the ripple while other waves are tried:
        # otherwise the ripple of the rate would shift the peak.
        wave = np.exp(-1j * np.outer(periods, steady))
        of_rate, of_torque = wave @ rest[0], wave @ rest[1]
        return np.asarray(np.abs(of_torque - 1j * inertia * near * speed * of_rate))

    step = 0.5 * math.pi / travel
    grid = np.arange(lowest, highest, step)
    sizes = size(grid, grid)
    best = int(np.argmax(sizes))
    # A peak at an end of the grid is a drift, or lies beyond the grid.
    if best in (0, len(grid) - 1) or sizes[best] < STANDS_OUT * float(np.median(sizes)):
        return None
    peak = float(grid[best])
    for width in (step, 0.2 * step):
        fine = np.linspace(peak - width, peak + width, 41)
        peak = float(fine[int(np.argmax(size(fine, peak)))])
    return peak


def pooled(harmonics: Sequence[Harmonic], dry: Array) -> Ripple | None:
    """Common ripple of the runs in one direction; None without one.

    dry: signed friction torque without its viscous part (N m) of each run, shape (m,).
    """
    if len(harmonics) < 2:
        return None
    travel = np.array([each.travel for each in harmonics])
    counts = np.array([each.periods for each in harmonics])
    near = np.abs(counts - counts[:, None]) <= np.pi / np.minimum(travel, travel[:, None])
    chosen = near[int(np.argmax(near.sum(axis=1)))]
    known = bool(np.ptp(counts) == 0.0)
    if int(chosen.sum()) < (2 if known else AGREEING):
        return None
    periods = float(np.average(counts[chosen], weights=travel[chosen] ** 2))
    kept = [(each, d) for each, d, c in zip(harmonics, dry, chosen, strict=True) if c]
    seen = np.array(
        [
            complex(each.cosine, -each.sine) * cmath.exp(-1j * periods * each.centre) / d
            for each, d in kept
        ]
    )
    errors = np.array([each.error / abs(d) for each, d in kept])
    weights = 1.0 / (errors**2 + np.median(errors**2) + 1e-300)
    weights /= weights.sum()
    amplitude = complex(np.sum(weights * seen))
    apart = float(np.sum(weights**2 * np.abs(seen - amplitude) ** 2)) * len(kept) / (len(kept) - 1)
    error = math.sqrt(0.5 * apart)
    if abs(amplitude) < CERTAIN * error:
        return None
    return Ripple(periods, amplitude, error, len(kept))


def ripple_of_points(
    harmonics: Sequence[Harmonic | None], dry: Array, first: Array, last: Array
) -> tuple[Array, Array, Ripple | None]:
    """Ripple part of each torque of one direction (N m), its standard error, and the ripple.

    The ripple is common to the runs that are long enough to show it; each window has its mean
    between two angles. Zeros and None without a common ripple.

    Args:
        harmonics: of each run; None where it is too short or shows no ripple.
        dry: signed friction torque without its viscous part (N m), shape (n,).
        first, last: angles at the ends of each window (rad), shape (n,).
    """
    runs = [i for i, each in enumerate(harmonics) if each is not None]
    ripple = pooled([each for each in harmonics if each is not None], dry[runs])
    if ripple is None:
        return np.zeros_like(dry), np.zeros_like(dry), None
    share, error = ripple.mean(first, last)
    return share / (1.0 + share) * dry, np.abs(error * dry), ripple
