"""Stretches of a recording with a steady rate, found in the data.

A recording is cut into short blocks. A stretch grows from block to block as long as each new mean
rate agrees with those it has, within a share of it and what noise explains; it is then cut off at
both ends by a share of its length, where the axis still settles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from campaign.arrays import Array

BLOCK, LONGEST_BLOCK = 0.02, 0.2
"""s of a block, or one sample where that is longer; noisy rates have longer ones."""
QUIET = 0.02
"""of the largest rate that the noise of a block's mean may be, where blocks can be that long."""
TELLS = 0.5
"""of a rate by which noise may move a block's mean: more, and standstill looks like it."""
AGREEMENT = 0.04
"""Share of its rate by which a block may be off the stretch it belongs to."""
NOISE = 4.0
"""Standard deviations of a block's mean by which noise may move it."""
TRIM = 0.15
"""Share of a stretch that is left out at each end ..."""
SETTLING = (0.15, 0.35, 0.55, 0.7)
"""... and shares that are left out at its beginning until it has no trend any more."""
RATE_TREND, TORQUE_TREND = 0.01, 0.1
"""of its mean by which rate and torque of a stretch may change from one end to the other."""
SHORTEST_TIME = 0.2
"""s of a stretch before it is cut, if nobody says: less is the turning point of an overshoot."""
FEWEST = 12
"""samples of a stretch after trimming, and ..."""
SHORTEST = 5
"""... blocks before it."""
SLOWEST = 0.03
"""of the largest rate: what is slower may be standstill, with a sensor's bias or a creep."""
SHORT = 0.3
"""of the longest stretch about as fast, that is ..."""
ALIKE = 0.3
"""... within this share of its rate: what is shorter was on its way there."""


@dataclass(frozen=True)
class SteadyStretch:
    """Samples [first, stop) during which the rate is steady, and its mean (signed)."""

    first: int
    stop: int
    rate: float


def steady_stretches(
    rate: Array,
    sample_rate: float,
    torque: Array | None = None,
    shortest: float = SHORTEST_TIME,
    *,
    driven: bool = True,
    slowest: float | None = None,
) -> tuple[SteadyStretch, ...]:
    """The stretches of steady motion, in order; none of standstill.

    Args:
        rate: shape (n,), any unit; NaN where a sample was lost, which ends a stretch.
        sample_rate: Hz.
        torque: what drives the axis, shape (n,), in the direction of the rate; None where nobody
            knows: then a creep before breakaway may be taken for sliding.
        shortest: of a stretch before it is cut (s).
        driven: whether the torque has to go with the rate, as it does unless something else, such
            as gravity, moves the axis as well.
        slowest: rate (in the unit of `rate`) up to which it stands still; None: 3 % of its fastest.
            What noise may be counts as standstill besides.
    """
    size = max(1, round(BLOCK * sample_rate))
    while True:
        means = _means(rate, size)
        finite = means[np.isfinite(means)]
        if len(means) < SHORTEST or not len(finite):
            return ()
        # The largest rate but for single wild samples: what counts as standstill hangs on it.
        largest, noise = float(np.quantile(np.abs(finite), 0.999)), _noise(means)
        if noise <= QUIET * largest or 2 * size > LONGEST_BLOCK * sample_rate:
            break
        size *= 2
    still = SLOWEST * largest if slowest is None else slowest
    slowest = max(still, NOISE * noise / TELLS)
    fewest = max(SHORTEST, int(np.ceil(shortest * sample_rate / size)))
    # What is left of a stretch that settles for long is as long as the shortest one after its cut.
    left = max(FEWEST, (fewest - 2 * max(1, round(TRIM * fewest))) * size)
    grown = [(a, b) for a, b in _grown(means, noise, slowest) if b - a >= fewest]
    level = None
    if torque is not None and not driven and grown:
        # Not of the whole recording: what accelerates an inertia may be many times friction.
        sliding = np.concatenate([torque[a * size : b * size] for a, b in grown])
        if np.isfinite(sliding).any():
            level = float(np.nanquantile(np.abs(sliding), 0.9))
    found = []
    for first, stop in _settled(grown, means):
        for share in SETTLING:
            begin = (first + max(1, round(share * (stop - first)))) * size
            end = (stop - max(1, round(TRIM * (stop - first)))) * size
            if end - begin < left:
                break
            part = slice(begin, end)
            if _is_steady(rate[part], None if torque is None else torque[part], level):
                mean = float(np.nanmean(rate[part]))
                if abs(mean) > slowest:
                    found.append(SteadyStretch(begin, end, mean))
                break
    return tuple(found)


def _means(rate: Array, size: int) -> Array:
    """Of blocks of so many samples, shape (n // size,); NaN where half of them were lost."""
    count = len(rate) // size
    blocks = rate[: count * size].reshape(count, size)
    there = np.isfinite(blocks)
    known = there.sum(axis=1)
    total = np.where(there, blocks, 0.0).sum(axis=1)
    means: Array = np.where(2 * known > size, total / np.maximum(known, 1), np.nan)
    # One or two lost samples of a slow recording end no stretch.
    lost = np.flatnonzero(~np.isfinite(means))
    for k in lost[(lost > 0) & (lost < count - 2)]:
        after = next((j for j in (k + 1, k + 2) if np.isfinite(means[j])), None)
        if after is not None and np.isfinite(means[k - 1]):
            means[k] = means[k - 1] + (means[after] - means[k - 1]) / (after - k + 1)
    return means


def _is_steady(rate: Array, torque: Array | None, level: float | None) -> bool:
    """Whether neither goes anywhere, beyond what its noise explains, and friction is overcome."""
    there = np.isfinite(rate) if torque is None else np.isfinite(rate) & np.isfinite(torque)
    if there.sum() < FEWEST or not _stays(rate[there], RATE_TREND):
        return False
    if torque is None:
        return True
    if level is None and not float(torque[there].mean()) * float(rate[there].mean()) > 0:
        return False
    return _stays(torque[there], TORQUE_TREND, level=level)


def _stays(values: Array, share: float, *, level: float | None = None) -> bool:
    """Whether neither a line nor an arc through them goes far: the top of a sine is not steady.

    How far noise alone may bend them follows from its second differences, as if it had ten times
    their correlation: what is left of a fit would count a curve as noise. `level` stands for the
    mean where that may be zero: a torque that holds against a load may be any.
    """
    place = np.linspace(-0.5, 0.5, len(values))
    arc = 4.0 * (place**2 - float(np.mean(place**2)))
    noise = np.sqrt(10.0) * _noise(values)
    mean = abs(float(values.mean())) if level is None else level
    for each in (place, arc):
        square = float(each @ each)
        if abs(float(each @ values)) / square > max(share * mean, 2.0 * noise / np.sqrt(square)):
            return False
    if level is not None:
        return True
    # What no line and no arc shows, such as a reversal in the middle.
    return bool(mean > 4.0 * noise / np.sqrt(len(values)))


def _grown(means: Array, noise: float, slowest: float) -> list[tuple[int, int]]:
    """Blocks [first, stop) whose means agree with each other."""
    found, first = [], 0
    while first < len(means):
        stop, total = first, 0.0
        while stop < len(means) and np.isfinite(means[stop]):
            mean = total / (stop - first) if stop > first else means[stop]
            allowed = AGREEMENT * abs(mean) + NOISE * noise * np.sqrt(1 + 1 / max(stop - first, 1))
            if abs(means[stop] - mean) > allowed:
                break
            total += means[stop]
            stop += 1
        if stop - first >= SHORTEST and abs(total / (stop - first)) > slowest:
            found.append((first, stop))
            first = stop
        else:  # it may begin a block later
            first += 1
    return found


def _settled(grown: Sequence[tuple[int, int]], means: Array) -> list[tuple[int, int]]:
    """Those that are not much shorter than others about as fast."""
    rates = [float(means[a:b].mean()) for a, b in grown]
    kept = []
    for (a, b), rate in zip(grown, rates, strict=True):
        alike = [
            d - c
            for (c, d), other in zip(grown, rates, strict=True)
            if abs(other - rate) <= ALIKE * abs(rate)
        ]
        if b - a >= SHORT * max(alike):
            kept.append((a, b))
    return kept


def _noise(means: Array) -> float:
    """Standard deviation of each value, from second differences: a slope is no noise."""
    bends = np.diff(means, 2)
    bends = bends[np.isfinite(bends)]
    return float(1.4826 * np.median(np.abs(bends)) / np.sqrt(6.0)) if len(bends) else 0.0
