"""A motion prepared for regression: zero-phase filter, derivatives, decimation.

A recording contains a position (or a rate). A regression needs rate and acceleration, with the same
filter on both sides. Source: Janot, Vandanjon, Gautier, "A generic instrumental variable approach
for industrial robot identification", IEEE Trans. Control Syst. Technol. 22 (2014), section II.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Self

import numpy as np

from campaign.arrays import Array, Flags

ORDER = 4
"""Order of the Butterworth low-pass, which runs forward and backward."""
DECIMATOR_ORDER, DECIMATOR_RIPPLE, DECIMATOR_BAND = 8, 0.05, 0.8
"""Chebyshev low-pass of the decimation: order, ripple (dB), share of the new Nyquist frequency."""
LOW_PASS, LOW_PASS_SHARE = 100.0, 0.2
"""Default corner: the smaller of a frequency (Hz) and a share of the sample rate."""
REGRESSION_RATE = 100.0
"""Default rate after decimation (Hz), approximately."""
FASTER = (2.0, 5.0)
"""Multiples of the slowest rate; omitting rows below them shows the effect of slow sliding."""


@dataclass(frozen=True)
class FilterSettings:
    """Settings of filter and decimation of a motion.

    Attributes:
        low_pass: corner of the position's (or the rate's) zero-phase low-pass (Hz).
        decimation: factor of the decimation, which has its own low-pass; 1: none.
        skip: number of samples omitted at the beginning, after differentiation.
        slowest: rate (rad/s, or m/s) below which rows count as standstill. They are omitted with
            their neighbors, because friction at standstill is equal to the force.
    """

    low_pass: float
    decimation: int = 1
    skip: int = 0
    slowest: float = 0.0

    @classmethod
    def for_rate(cls, sample_rate: float) -> Self:
        """Default settings for a sample rate (Hz)."""
        corner = min(LOW_PASS, LOW_PASS_SHARE * sample_rate)
        return cls(corner, max(1, round(sample_rate / REGRESSION_RATE)))

    @property
    def half_band(self) -> Self:
        """Settings with half the bandwidth of rows, for less noise."""
        return replace(self, decimation=2 * self.decimation)

    @property
    def faster(self) -> tuple[Self, ...]:
        """Settings that omit rows up to higher rates, to reduce the effect of slow sliding."""
        return tuple(replace(self, slowest=times * self.slowest) for times in FASTER)


@dataclass(frozen=True, eq=False)
class Motion:
    """An evenly sampled motion with its force, before decimation; arrays of shape (n,).

    Attributes:
        time: s.
        position: rad, or m of a linear axis.
        rate, acceleration: its derivatives, without phase shift.
        force: drive force or torque (N m, or N), as recorded.
        temperature: degC; None: not recorded.
    """

    time: Array
    position: Array
    rate: Array
    acceleration: Array
    force: Array
    temperature: Array | None = None

    @property
    def sample_rate(self) -> float:
        """Sample rate (Hz)."""
        return sample_rate_of(self.time)

    def part(self, which: slice) -> Motion:
        """Consecutive samples of the motion."""
        own = {name: values for name, values in vars(self).items() if values is not None}
        return Motion(**{name: values[which] for name, values in own.items()})


def motion_of_position(
    time: Array, position: Array, force: Array, low_pass: float, temperature: Array | None = None
) -> Motion:
    """Motion from a measured position, shape (n,): low-passed once, differentiated twice."""
    rate = sample_rate_of(time)
    smooth = zero_phase(position, low_pass, rate)
    first = np.gradient(smooth, 1.0 / rate)
    return Motion(time, smooth, first, np.gradient(first, 1.0 / rate), force, temperature)


def motion_of_rate(
    time: Array, rate: Array, force: Array, low_pass: float, temperature: Array | None = None
) -> Motion:
    """Motion from a measured rate, shape (n,); the position begins at 0 and drifts by its bias."""
    per_second = sample_rate_of(time)
    smooth = zero_phase(rate, low_pass, per_second)
    steps = 0.5 * (smooth[1:] + smooth[:-1]) / per_second
    position = np.concatenate([[0.0], np.cumsum(steps)])
    return Motion(time, position, smooth, np.gradient(smooth, 1.0 / per_second), force, temperature)


def sample_rate_of(time: Array) -> float:
    """Sample rate (Hz) of evenly spaced times (s), shape (n,)."""
    return float((len(time) - 1) / (time[-1] - time[0]))


def zero_phase(samples: Array, low_pass: float, sample_rate: float) -> Array:
    """Butterworth low-pass, forward and backward, shape (n,).

    A corner at or above half the sample rate: no filter. Raises ValueError for too few samples.
    """
    from scipy.signal import butter, filtfilt

    if low_pass >= 0.5 * sample_rate:
        return np.asarray(samples, dtype=float)
    b, a = butter(ORDER, low_pass / (0.5 * sample_rate))
    _refuse_short(len(samples), 3 * ORDER)
    return np.asarray(filtfilt(b, a, samples, padlen=3 * ORDER))


def decimated(columns: Array, factor: int) -> Array:
    """Every `factor`-th row of `columns`, shape (n, k), after a zero-phase Chebyshev low-pass.

    As in MATLAB's `decimate`, the last sample is always kept. Both sides of a regression have the
    same filter and thus the same weights. The gain is scaled to 1 at zero frequency, because a
    filter of even order has its ripple there.
    """
    return _smooth(columns, factor)[first_kept(len(columns), factor) :: factor]


def _smooth(columns: Array, factor: int) -> Array:
    """`columns`, shape (n, k), after the low-pass of a decimation by `factor`."""
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
    """Times (s) of the decimated rows of a motion."""
    time = motion.time[filtering.skip :]
    return time[first_kept(len(time), filtering.decimation) :: filtering.decimation]


def later(samples: Array, delay: float, sample_rate: float) -> Array:
    """Delay a signal (n,) by `delay` (s), with cubic interpolation; constant beyond the ends."""
    from scipy.interpolate import CubicSpline

    if delay == 0.0:
        return samples
    place = np.arange(len(samples), dtype=float)
    wanted = np.clip(place - delay * sample_rate, 0.0, len(samples) - 1.0)
    return np.asarray(CubicSpline(place, samples)(wanted))


@lru_cache(maxsize=16)
def _decimator(factor: int) -> Array:
    """Low-pass in sections of second order, shape (n, 6).

    One polynomial is inaccurate for a large factor. The result is cached, because the design takes
    longer than the filtering of a short motion.
    """
    from scipy.signal import cheby1

    ripple, band = DECIMATOR_RIPPLE, DECIMATOR_BAND / factor
    return np.asarray(cheby1(DECIMATOR_ORDER, ripple, band, output="sos"))


def late_rows(
    samples: Array, sample_rate: float, filtering: FilterSettings
) -> Callable[[float], Array]:
    """Decimated rows of a signal, shape (n,), as a function of its delay (s).

    Delay and low-pass commute: the signal is filtered once, and a delay needs only an
    interpolation. At the ends, rows differ from `decimated(later(...))`.
    """
    from scipy.interpolate import CubicSpline

    smooth = _smooth(samples[filtering.skip :, None], filtering.decimation)[:, 0]
    place = np.arange(len(smooth), dtype=float)
    kept = place[first_kept(len(smooth), filtering.decimation) :: filtering.decimation]
    between = CubicSpline(place, smooth)

    def rows(delay: float) -> Array:
        return np.asarray(between(np.clip(kept - delay * sample_rate, 0.0, place[-1])))

    return rows


def whole_pieces(good: Flags, fewest: int) -> Sequence[slice]:
    """Runs of at least `fewest` valid samples; good: mask, shape (n,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]]).astype(int)))
    runs = edges.reshape(-1, 2)
    return [slice(int(a), int(b)) for a, b in runs if b - a >= fewest]


def _refuse_short(count: int, padding: int) -> None:
    if count <= padding:
        raise ValueError(f"{count} samples are too few to be filtered; {padding + 1} are needed")
