"""One measured trial below breakaway as arrays, with known values of the axis."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from campaign.arrays import Array, Flags
from campaign.estimation.presliding_dynamics.plant import Appendage

FEWEST = 100
"""Fewest samples of a record for an estimate of its noise."""
FEWEST_PER_PERIOD = 20
"""Fewest samples per period for an estimate of the scatter of periodic errors."""
ALIKE = 0.9
"""Autocorrelation above which a torque counts as periodic."""
MOST = 0.999
"""Share of the power up to the highest frequency; higher frequencies are negligible."""


@dataclass(frozen=True)
class Record:
    """Torque and motion of one trial, evenly sampled from its start.

    Attributes:
        step: between samples (s).
        torque: at the load (N m), shape (n,).
        rate: of the load, by a gyro (rad/s), shape (n,); NaN for a missing sample; or None.
        angle: of the load, by an encoder (rad), likewise.
        at_rest: whether it begins at rest, where the bristles carry the first torque; otherwise
            initial bristle torque and rate are free.
        doubt: columns of torque errors (N m), shape (n, m), each with a standard normal factor that
            is common to all records; None: no error.
        period: of the torque (s); None: detected. Errors of a quantized channel repeat in it.
        label: name in messages.
    """

    step: float
    torque: Array
    rate: Array | None = None
    angle: Array | None = None
    at_rest: bool = True
    doubt: Array | None = None
    period: float | None = None
    label: str = ""

    def __post_init__(self) -> None:
        if self.rate is None and self.angle is None:
            raise ValueError(f"{self.named}: neither rate nor angle was recorded")
        if not self.step > 0 or len(self.torque) < FEWEST or not np.all(np.isfinite(self.torque)):
            raise ValueError(
                f"{self.named}: at least {FEWEST} finite samples of the torque are needed"
            )
        for values in (self.rate, self.angle):
            if values is not None and values.shape != self.torque.shape:
                raise ValueError(f"{self.named}: its channels differ in length")
            if values is not None and not _says_something(values):
                raise ValueError(f"{self.named}: a channel of its motion holds nothing")
        if not np.ptp(self.torque) > 0:
            raise ValueError(f"{self.named}: its torque never changes")

    @property
    def named(self) -> str:
        """Name in messages."""
        return self.label or "a record"

    @property
    def doubts(self) -> Array:
        """Columns of torque errors, possibly none, shape (n, m)."""
        return np.zeros((len(self.torque), 0)) if self.doubt is None else self.doubt

    def with_doubts(self, count: int) -> Record:
        """Record with columns of 0 added, up to `count` columns."""
        more = np.zeros((len(self.torque), count - self.doubts.shape[1]))
        return replace(self, doubt=np.column_stack([self.doubts, more]))

    @property
    def time(self) -> Array:
        """Times of the samples (s), shape (n,)."""
        return np.asarray(self.step * np.arange(len(self.torque)))

    @property
    def amplitude(self) -> float:
        """Largest torque (N m)."""
        return float(np.max(np.abs(self.torque)))

    def highest_frequency(self) -> float:
        """Frequency (Hz) below which the share `MOST` of the effective torque lies.

        The product of the spectra of torque and motion excludes noise of either.
        """
        answer = self.rate if self.rate is not None else np.gradient(np.asarray(self.angle))
        torque = np.fft.rfft(self.torque - np.mean(self.torque))
        product = np.abs(torque * np.fft.rfft(np.nan_to_num(answer))) ** 2
        product[0] = 0.0
        power = np.cumsum(product) / np.sum(product)
        index = int(np.searchsorted(power, MOST))
        return float(np.fft.rfftfreq(len(self.torque), self.step)[min(index, len(power) - 1)])

    def samples_per_period(self) -> int | None:
        """Samples per period of a torque with at least two periods; None for other torques."""
        count = len(self.torque)
        if self.period is not None:
            period = round(self.period / self.step)
            return period if FEWEST_PER_PERIOD <= period <= count // 2 else None
        shape = self.torque - np.mean(self.torque)
        spectrum = np.fft.rfft(shape, 2 * count)
        alike = np.fft.irfft(np.abs(spectrum) ** 2)[: count // 2 + 1]
        alike /= alike[0] * (1.0 - np.arange(len(alike)) / count)
        apart = np.flatnonzero(alike < 0.0)
        again = np.flatnonzero(alike > ALIKE)
        again = again[again > apart[0]] if len(apart) else again[:0]
        if not len(again):
            return None
        # The period is the maximum in the first range of lags with a large autocorrelation.
        breaks = np.flatnonzero(np.diff(again) > 1)
        first = again[: breaks[0] + 1] if len(breaks) else again
        period = int(first[np.argmax(alike[first])])
        return period if period >= FEWEST_PER_PERIOD else None


def measured(record: Record) -> list[tuple[str, Array, Flags]]:
    """Channels of a record: name, samples with 0 for missing ones, mask of the valid ones."""
    channels = []
    for name, values in (("rate", record.rate), ("angle", record.angle)):
        if values is not None:
            valid = np.isfinite(values)
            channels.append((name, np.where(valid, values, 0.0), valid))
    return channels


def _says_something(values: Array) -> bool:
    valid = values[np.isfinite(values)]
    return len(valid) >= FEWEST and bool(np.ptp(valid) > 0)


@dataclass(frozen=True)
class Assumptions:
    """Inputs of a fit besides the records.

    Attributes:
        viscous: start value of sigma2 (N m s/rad). Below breakaway almost only the sum of sigma1
            and sigma2 has an effect; the records seldom determine each alone.
        appendage: an elastic part; with `appendage_free` its start values.
        appendage_free: whether its frequency, inertia and damping are also fitted.
    """

    viscous: float = 0.0
    appendage: Appendage | None = None
    appendage_free: bool = False
