"""One measured trial below breakaway as arrays, with known values of the axis."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from campaign.arrays import Array, Flags
from campaign.estimation.presliding_dynamics.plant import Appendage

FEWEST = 100
"""Samples of a record below which it says too little of its own noise."""
FEWEST_PER_PERIOD = 20
"""Samples of a period below which its errors are too few to say how they scatter."""
ALIKE = 0.9
"""Correlation with itself from which on a torque counts as one that repeats itself."""
MOST = 0.999
"""of the power of a torque: what lies beyond moves nothing."""


@dataclass(frozen=True)
class Record:
    """Torque and answer of one trial, evenly sampled from its beginning on.

    Attributes:
        step: between samples (s).
        torque: at the load (N m), shape (n,).
        rate: of the load, by a gyro (rad/s), shape (n,); NaN where a sample was lost; or None.
        angle: of the load, by an encoder (rad), shape (n,), likewise.
        at_rest: whether it begins at rest, so that the bristles hold the first torque; else
            bristles and rate at the beginning are free.
        doubt: columns that the torque may be off by (N m), shape (n, m), each times a factor that
            has a standard normal distribution and is the same in all records; None: it is known.
        period: of the torque (s), where it repeats itself; None: that is looked for. A quantised
            channel then errs alike in each period.
        label: what to call it.
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
        """For messages."""
        return self.label or "a record"

    @property
    def doubts(self) -> Array:
        """`doubt`, or no column, shape (n, m)."""
        return np.zeros((len(self.torque), 0)) if self.doubt is None else self.doubt

    def with_doubts(self, count: int) -> Record:
        """Likewise, with columns of 0 up to that many."""
        more = np.zeros((len(self.torque), count - self.doubts.shape[1]))
        return replace(self, doubt=np.column_stack([self.doubts, more]))

    @property
    def time(self) -> Array:
        """Of the samples (s), shape (n,)."""
        return np.asarray(self.step * np.arange(len(self.torque)))

    @property
    def amplitude(self) -> float:
        """Largest torque (N m)."""
        return float(np.max(np.abs(self.torque)))

    def highest_frequency(self) -> float:
        """Frequency (Hz) below which `MOST` of the torque that the load answers to lies.

        Told by the product of both spectra: noise of one alone, however wide, does not count.
        """
        answer = self.rate if self.rate is not None else np.gradient(np.asarray(self.angle))
        torque = np.fft.rfft(self.torque - np.mean(self.torque))
        product = np.abs(torque * np.fft.rfft(np.nan_to_num(answer))) ** 2
        product[0] = 0.0
        power = np.cumsum(product) / np.sum(product)
        index = int(np.searchsorted(power, MOST))
        return float(np.fft.rfftfreq(len(self.torque), self.step)[min(index, len(power) - 1)])

    def samples_per_period(self) -> int | None:
        """Of a torque that repeats itself at least twice; None of any other."""
        count = len(self.torque)
        if self.period is not None:
            found = round(self.period / self.step)
            return found if FEWEST_PER_PERIOD <= found <= count // 2 else None
        shape = self.torque - np.mean(self.torque)
        spectrum = np.fft.rfft(shape, 2 * count)
        alike = np.fft.irfft(np.abs(spectrum) ** 2)[: count // 2 + 1]
        alike /= alike[0] * (1.0 - np.arange(len(alike)) / count)
        apart = np.flatnonzero(alike < 0.0)
        again = np.flatnonzero(alike > ALIKE)
        again = again[again > apart[0]] if len(apart) else again[:0]
        if not len(again):
            return None
        # The first stretch of lags at which it is like itself again; its top.
        breaks = np.flatnonzero(np.diff(again) > 1)
        first = again[: breaks[0] + 1] if len(breaks) else again
        found = int(first[np.argmax(alike[first])])
        return found if found >= FEWEST_PER_PERIOD else None


def measured(record: Record) -> list[tuple[str, Array, Flags]]:
    """The channels of a record: name, samples with 0 for lost ones, and which are there."""
    found = []
    for name, values in (("rate", record.rate), ("angle", record.angle)):
        if values is not None:
            there = np.isfinite(values)
            found.append((name, np.where(there, values, 0.0), there))
    return found


def _says_something(values: Array) -> bool:
    there = values[np.isfinite(values)]
    return len(there) >= FEWEST and bool(np.ptp(there) > 0)


@dataclass(frozen=True)
class Assumptions:
    """What a fit begins with besides the records.

    Attributes:
        viscous: first guess of sigma2 (N m s/rad). Below breakaway sigma1 and sigma2 nearly add up,
            so that the sum is known well and either seldom.
        appendage: an elastic part, or a first guess of it.
        appendage_free: whether its frequency, inertia and damping are fitted, too.
    """

    viscous: float = 0.0
    appendage: Appendage | None = None
    appendage_free: bool = False
