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
    """Something that is wrong with a recording, or that its reader should know.

    Attributes:
        kind: a word of the field, such as `clipping`.
        channels: which it is about, first the one to correct.
        what: a sentence with its number.
        rows: the first and the last row, from 0.
        size: the number that tells how much: of lost samples, of a factor, s of a delay.
        noted: it is usable, and a reader should know; else it is refused unless it is accepted.
    """

    kind: str
    channels: tuple[str, ...]
    what: str
    rows: tuple[int, int]
    size: float
    noted: bool = False

    @property
    def remedy(self) -> str:
        """What a mapping can say about it."""
        does = _REMEDIES.get(self.kind, "")
        return f'{does}accept = ["{self.kind}"] takes it as it is'


BETTER = 0.25
"""of what is not explained without a long delay, at most, is not explained with it ..."""
AMISS = 0.15
"""... and this share of the channel at least without it: what repeats itself fits nearly as well
a period later, and friction is late at a reversal by an angle."""
LONGEST = 2.0
"""s by which a channel that is late is looked for, as far as a fifth of a recording holds it."""
NO_FILTER = 0.1
"""s from which on a delay is no filter's, and is refused unless somebody says it. Friction's own,
at the reversals of a slow sine, is some 0.05 s."""


def is_sure(left: float, now: float) -> bool:
    """Whether a delay of more than a filter is one.

    By what it leaves unexplained of a channel, and what is not explained without it; shares.
    """
    return left <= BETTER * now and now >= AMISS


def nearest_low(left: Array, at: int, slack: float) -> int:
    """Of the minima of `left`, shape (n,), that are nearly the lowest, the one nearest to `at`.

    What repeats itself fits as well a period later: the shortest delay counts. The lowest itself
    where it is at an end.
    """
    least = float(left.min())
    inner = left[1:-1]
    low = (inner <= left[:-2]) & (inner <= left[2:]) & (inner <= 1.2 * least + slack)
    places = np.flatnonzero(low) + 1
    if not len(places):
        return int(np.argmin(left))
    return int(places[np.argmin(np.abs(places - at))])


def runs(mask: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """First and last place of every run of true ones."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    for first, after in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        yield first, after - 1


def step_size(values: Array) -> float:
    """The step that all values are multiples of (from the lowest); 0 where there is none.

    A step is believed when values repeat: numbers that scatter freely have a smallest difference,
    too, but no second of it.
    """
    levels = np.unique(values[np.isfinite(values)])
    if len(levels) < 2:
        return 0.0
    span = float(levels[-1] - levels[0])
    noise = 1e-9 * span + 4 * float(np.spacing(np.abs(levels).max()))
    apart = np.diff(levels)
    apart = apart[apart > noise]  # levels that only arithmetic tells apart
    if not len(apart) or len(levels) > 0.9 * np.isfinite(values).sum():
        return 0.0
    step = float(apart.min())
    off = apart / step - np.round(apart / step)
    return step if np.abs(off).max() < 0.05 + noise / step else 0.0


def usual_step(values: Array) -> float:
    """The 99 % quantile of steps that are steps at all; 0 where there are none."""
    size = np.abs(np.diff(values))
    size = size[np.isfinite(size) & (size > 0)]
    return float(np.quantile(size, 0.99)) if len(size) else 0.0


def correlation(values: Array, part: Array) -> Array:
    """Sum of products of `part` with `values` from each place on that it fits in."""
    size = 1 << (len(values) - 1).bit_length()
    spectrum = np.fft.rfft(values, size) * np.conj(np.fft.rfft(part, size))
    found: Array = np.fft.irfft(spectrum, size)[: len(values) - len(part) + 1]
    return found


def rows_in_words(first: int, last: int) -> str:
    """Rows as people count them, from 1."""
    return f"row {first + 1}" if first == last else f"rows {first + 1} to {last + 1}"


def counted(count: int, noun: str) -> str:
    """`1 sample`, `2 samples`, `2 stretches`."""
    ending = "es" if noun.endswith("ch") else "s"
    return f"{count} {noun}" if count == 1 else f"{count} {noun}{ending}"
