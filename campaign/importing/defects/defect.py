"""Defects of a recording as data, and common parts of their detection."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_REMEDIES = {
    "factor": "correct its 'unit' or 'times', or ",
    "sign": "correct its 'sign', or ",
    "delay": "put it back by 'delay', or ",
    "wraparound": 'repair = ["unwrap"] makes it continuous, or ',
}


@dataclass(frozen=True)
class Defect:
    """An error or a peculiarity of a recording.

    Attributes:
        kind: a word of the field, such as `clipping`.
        channels: affected channels, first the one to correct.
        what: description, a sentence with the size.
        rows: the first and the last row, from 0.
        size: magnitude: number of lost samples, a factor, a delay (s).
        noted: the recording is usable with a remark; else it is refused until accepted.
    """

    kind: str
    channels: tuple[str, ...]
    what: str
    rows: tuple[int, int]
    size: float
    noted: bool = False

    @property
    def remedy(self) -> str:
        """Entries of a mapping that correct or accept it."""
        does = _REMEDIES.get(self.kind, "")
        return f'{does}accept = ["{self.kind}"] takes it as it is'


BETTER = 0.25
"""Largest ratio of the unexplained share with a long delay to that without it."""
AMISS = 0.15
"""Least unexplained share without the delay: a periodic signal fits nearly as well a period
later, and friction lags at a reversal by an angle."""
LONGEST = 2.0
"""Longest delay in the search (s); at most a fifth of the recording."""
NO_FILTER = 0.1
"""Delay (s) above which a filter is no explanation: refused unless the mapping states it. The lag
of friction at the reversals of a slow sine is about 0.05 s."""


def is_sure(left: float, now: float) -> bool:
    """Whether a delay longer than a filter's is significant.

    `left`, `now`: unexplained share of a channel with the delay and without it.
    """
    return left <= BETTER * now and now >= AMISS


def nearest_low(left: Array, at: int, slack: float) -> int:
    """Index of the minimum nearest to `at` among the nearly lowest minima of `left`, shape (n,).

    A periodic signal fits as well a period later: the shortest delay counts. Without such a
    minimum inside: the index of the lowest value.
    """
    least = float(left.min())
    inner = left[1:-1]
    low = (inner <= left[:-2]) & (inner <= left[2:]) & (inner <= 1.2 * least + slack)
    places = np.flatnonzero(low) + 1
    if not len(places):
        return int(np.argmin(left))
    return int(places[np.argmin(np.abs(places - at))])


def runs(mask: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """First and last index of every run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    for first, after in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        yield first, after - 1


def step_size(values: Array) -> float:
    """The quantization step of values; 0 if they are not quantized.

    Values must repeat for a step: continuous random numbers have a smallest difference, too, but
    each occurs once.
    """
    levels = np.unique(values[np.isfinite(values)])
    if len(levels) < 2:
        return 0.0
    span = float(levels[-1] - levels[0])
    noise = 1e-9 * span + 4 * float(np.spacing(np.abs(levels).max()))
    spacing = np.diff(levels)
    spacing = spacing[spacing > noise]  # others differ by rounding of the arithmetic only
    if not len(spacing) or len(levels) > 0.9 * np.isfinite(values).sum():
        return 0.0
    step = float(spacing.min())
    off = spacing / step - np.round(spacing / step)
    return step if np.abs(off).max() < 0.05 + noise / step else 0.0


def usual_step(values: Array) -> float:
    """The 99 % quantile of the sizes of nonzero steps; 0 if there are none."""
    size = np.abs(np.diff(values))
    size = size[np.isfinite(size) & (size > 0)]
    return float(np.quantile(size, 0.99)) if len(size) else 0.0


def correlation(values: Array, part: Array) -> Array:
    """Sum of products of `part` with `values` at each shift at which it fits."""
    size = 1 << (len(values) - 1).bit_length()
    spectrum = np.fft.rfft(values, size) * np.conj(np.fft.rfft(part, size))
    sums: Array = np.fft.irfft(spectrum, size)[: len(values) - len(part) + 1]
    return sums


def rows_in_words(first: int, last: int) -> str:
    """Row numbers from 1 as text."""
    return f"row {first + 1}" if first == last else f"rows {first + 1} to {last + 1}"
