"""A motion prepared for regression: zero-phase filter, derivatives, decimation.

What is measured is a position (or a rate); a regression needs rate and acceleration, and both sides
of it filtered alike. Source: Janot, Vandanjon, Gautier, "A generic instrumental variable approach
for industrial robot identification", IEEE Trans. Control Syst. Technol. 22 (2014), section II.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Self

import numpy as np

from campaign.arrays import Array, Flags

ORDER = 4
"""of the Butterworth low-pass, which runs forward and backward."""
DECIMATOR_ORDER, DECIMATOR_RIPPLE, DECIMATOR_BAND = 8, 0.05, 0.8
"""Chebyshev low-pass of the decimation: order, ripple (dB), share of the new Nyquist frequency."""
LOW_PASS, LOW_PASS_SHARE = 100.0, 0.2
"""Hz, and share of the sample rate: the smaller is the corner, where nobody says another."""
REGRESSION_RATE = 100.0
"""Hz; samples are decimated to about this where nobody says how far."""
FASTER = (2.0, 5.0)
"""times the slowest rate, below which rows are left out to see what sliding that sets in does."""
SHORTEST = 8
"""Decimated samples that a piece of a motion must have to be used."""


@dataclass(frozen=True)
class FilterSettings:
    """How a motion is made ready.

    Attributes:
        low_pass: corner of the position's (or the rate's) zero-phase low-pass (Hz).
        decimation: of how many samples one is kept, behind a low-pass of its own; 1 for all.
        skip: samples at the beginning that are left out, after differentiation.
        slowest: rate (rad/s, or m/s) below which rows count as standing still and are left out,
            with one beside them: there friction is whatever holds the axis.
    """

    low_pass: float
    decimation: int = 1
    skip: int = 0
    slowest: float = 0.0

    @classmethod
    def for_rate(cls, sample_rate: float) -> Self:
        """What is taken where nobody says anything, for samples at this rate (Hz)."""
        corner = min(LOW_PASS, LOW_PASS_SHARE * sample_rate)
        return cls(corner, max(1, round(sample_rate / REGRESSION_RATE)))

    @property
    def half_band(self) -> Self:
        """With half of the band that rows have: noise is less, and so is what bends."""
        return replace(self, decimation=2 * self.decimation)

    @property
    def faster(self) -> tuple[Self, ...]:
        """Without rows up to higher rates: what happens as sliding sets in counts for less."""
        return tuple(replace(self, slowest=times * self.slowest) for times in FASTER)


@dataclass(frozen=True, eq=False)
class Motion:
    """An evenly sampled motion and what drove it, before decimation; arrays of shape (n,).

    Attributes:
        time: s.
        position: rad, or m of a linear axis.
        rate, acceleration: its derivatives, without phase.
        force: what drives the axis (N m, or N), as recorded.
        temperature: K; None where nobody recorded it.
    """

    time: Array
    position: Array
    rate: Array
    acceleration: Array
    force: Array
    temperature: Array | None = None

    @property
    def sample_rate(self) -> float:
        """Hz."""
        return float((len(self.time) - 1) / (self.time[-1] - self.time[0]))

    def part(self, which: slice) -> Motion:
        """Samples of it that follow each other."""
        own = {name: values for name, values in vars(self).items() if values is not None}
        return Motion(**{name: values[which] for name, values in own.items()})


def motion_of_position(
    time: Array, position: Array, force: Array, low_pass: float, temperature: Array | None = None
) -> Motion:
    """From a measured position, shape (n,): low-passed once, differentiated twice."""
    rate = sample_rate_of(time)
    smooth = zero_phase(position, low_pass, rate)
    first = np.gradient(smooth, 1.0 / rate)
    return Motion(time, smooth, first, np.gradient(first, 1.0 / rate), force, temperature)


def motion_of_rate(
    time: Array, rate: Array, force: Array, low_pass: float, temperature: Array | None = None
) -> Motion:
    """From a measured rate, shape (n,); the position begins at zero, and drifts with its bias."""
    per_second = sample_rate_of(time)
    smooth = zero_phase(rate, low_pass, per_second)
    steps = 0.5 * (smooth[1:] + smooth[:-1]) / per_second
    position = np.concatenate([[0.0], np.cumsum(steps)])
    return Motion(time, position, smooth, np.gradient(smooth, 1.0 / per_second), force, temperature)


def sample_rate_of(time: Array) -> float:
    """Hz, of even times (s), shape (n,)."""
    return float((len(time) - 1) / (time[-1] - time[0]))


def zero_phase(samples: Array, low_pass: float, sample_rate: float) -> Array:
    """Butterworth low-pass, forward and backward, shape (n,); as it is where the corner is beyond
    what can be sampled.

    Raises ValueError for fewer samples than the filter needs to begin with.
    """
    from scipy.signal import butter, filtfilt

    if low_pass >= 0.5 * sample_rate:
        return np.asarray(samples, dtype=float)
    b, a = butter(ORDER, low_pass / (0.5 * sample_rate))
    _refuse_short(len(samples), 3 * ORDER)
    return np.asarray(filtfilt(b, a, samples, padlen=3 * ORDER))


def decimated(columns: Array, factor: int) -> Array:
    """Every `factor`-th row of `columns`, shape (n, k), behind a zero-phase Chebyshev low-pass.

    The phase is that of MATLAB's `decimate`: the last sample is always among those kept. Both sides
    of a regression pass the same filter, so that it weights them alike. What is constant passes as
    it is: a filter of even order would take its ripple from it.
    """
    return _smooth(columns, factor)[first_kept(len(columns), factor) :: factor]


def _smooth(columns: Array, factor: int) -> Array:
    """`columns`, shape (n, k), behind the low-pass of a decimation by `factor`."""
    from scipy.signal import sosfiltfilt

    if factor == 1:
        return columns
    _refuse_short(len(columns), 3 * DECIMATOR_ORDER)
    parts = _decimator(factor)
    gain = np.prod(parts[:, :3].sum(axis=1) / parts[:, 3:].sum(axis=1))
    return np.asarray(sosfiltfilt(parts, columns, axis=0, padlen=3 * DECIMATOR_ORDER) / gain**2)


def first_kept(count: int, factor: int) -> int:
    """Index of the first of `count` samples that decimation keeps."""
    return factor - 1 - (factor * -(-count // factor) - count)


def kept_times(motion: Motion, filtering: FilterSettings) -> Array:
    """Times (s) of the rows that are left of a motion."""
    time = motion.time[filtering.skip :]
    if filtering.decimation == 1:
        return time
    return time[first_kept(len(time), filtering.decimation) :: filtering.decimation]


def later(samples: Array, delay: float, sample_rate: float) -> Array:
    """What a signal of shape (n,) is `delay` (s) later, by cubic interpolation; ends are held."""
    from scipy.interpolate import CubicSpline

    if delay == 0.0:
        return samples
    place = np.arange(len(samples), dtype=float)
    wanted = np.clip(place - delay * sample_rate, 0.0, len(samples) - 1.0)
    return np.asarray(CubicSpline(place, samples)(wanted))


@lru_cache(maxsize=16)
def _decimator(factor: int) -> Array:
    """The low-pass in sections of second order, shape (n, 6).

    One polynomial is not exact where the factor is large. Kept: making it takes longer than to
    filter a short motion.
    """
    from scipy.signal import cheby1

    ripple, band = DECIMATOR_RIPPLE, DECIMATOR_BAND / factor
    return np.asarray(cheby1(DECIMATOR_ORDER, ripple, band, output="sos"))


class LateRows:
    """Decimated rows of a signal, for one delay after the other.

    A delay and a low-pass may be exchanged: the signal is filtered once, and each delay asks for
    the rows alone. The ends differ from those of `decimated(later(...))` by what is held there.
    """

    def __init__(self, samples: Array, sample_rate: float, filtering: FilterSettings) -> None:
        """samples: shape (n,), evenly spaced."""
        from scipy.interpolate import CubicSpline

        smooth = _smooth(samples[filtering.skip :, None], filtering.decimation)[:, 0]
        first = first_kept(len(smooth), filtering.decimation)
        place = np.arange(len(smooth), dtype=float)
        self._rate = sample_rate
        self._between = CubicSpline(place, smooth)
        self._kept = place[first :: filtering.decimation]
        self._last = place[-1]

    def at(self, delay: float) -> Array:
        """The rows of a signal that is `delay` (s) later, shape (rows,)."""
        wanted = np.clip(self._kept - delay * self._rate, 0.0, self._last)
        return np.asarray(self._between(wanted))


def whole_pieces(good: Flags, fewest: int) -> Sequence[slice]:
    """Runs of at least `fewest` samples that are all there; good: shape (n,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]]).astype(int)))
    runs = edges.reshape(-1, 2)
    return [slice(int(a), int(b)) for a, b in runs if b - a >= fewest]


def _refuse_short(count: int, padding: int) -> None:
    if count <= padding:
        raise ValueError(f"{count} samples are too few to be filtered; {padding + 1} are needed")
