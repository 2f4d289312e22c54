"""Segments (stretches) of a recording with a steady rate, detected in the data.

A recording is divided into short blocks. A stretch grows block by block while each new mean rate
agrees with its mean, within a share of it and noise. Then a share of its length is cut off at both
ends, where the axis still settles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from campaign.arrays import Array

BLOCK, LONGEST_BLOCK = 0.02, 0.2
"""Length of a block (s), at least one sample; noisy rates have longer blocks."""
QUIET = 0.02
"""Noise of a block's mean over the largest rate, above which blocks become longer."""
TELLS = 0.5
"""Largest share of a rate by which noise may change a block's mean: above it, standstill looks
like motion."""
AGREEMENT = 0.04
"""Largest relative deviation of a block from the rate of its stretch."""
NOISE = 4.0
"""Largest deviation of a block's mean by noise, in standard deviations."""
TRIM = 0.15
"""Share of a stretch that is cut off at its end."""
SETTLING = (0.15, 0.35, 0.55, 0.7)
"""Shares that are cut off at its beginning, in this order, until it has no trend."""
RATE_TREND, TORQUE_TREND = 0.01, 0.1
"""Largest relative change of rate and torque from one end of a stretch to the other."""
SHORTEST_TIME = 0.2
"""Default shortest stretch before the cut (s): less is the turning point of an overshoot."""
FEWEST = 12
"""Fewest samples of a stretch after the cut."""
SHORTEST = 5
"""Fewest blocks of a stretch before the cut."""
SLOWEST = 0.03
"""Share of the largest rate below which motion may be standstill with a sensor bias, or creep."""
SHORT = 0.3
"""Least length of a stretch over the longest one of a similar rate; shorter ones are transients."""
ALIKE = 0.3
"""Largest relative difference of similar rates."""


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
    """Stretches of steady motion, in order, without standstill.

    Args:
        rate: shape (n,), any unit; NaN: missing. More than two missing blocks end a stretch.
        sample_rate: Hz.
        torque: drive torque, shape (n,), in the direction of the rate; None: unknown, then creep
            before breakaway may count as sliding.
        shortest: shortest stretch before the cut (s).
        driven: whether the torque must have the sign of the rate: true unless another load, such as
            gravity, also moves the axis.
        slowest: rate (in the unit of `rate`) up to which the axis is at standstill; None: 3 % of
            the largest. A rate within noise also counts as standstill.
    """
    size = max(1, round(BLOCK * sample_rate))
    while True:
        means = _means(rate, size)
        finite = means[np.isfinite(means)]
        if len(means) < SHORTEST or not len(finite):
            return ()
        # A quantile excludes single outliers: the limit of standstill depends on the largest rate.
        largest, noise = float(np.quantile(np.abs(finite), 0.999)), _noise(means)
        if noise <= QUIET * largest or 2 * size > LONGEST_BLOCK * sample_rate:
            break
        size *= 2
    still = SLOWEST * largest if slowest is None else slowest
    slowest = max(still, NOISE * noise / TELLS)
    fewest = max(SHORTEST, int(np.ceil(shortest * sample_rate / size)))
    # A stretch that settles slowly must remain as long as the shortest one after its cut.
    left = max(FEWEST, (fewest - 2 * max(1, round(TRIM * fewest))) * size)
    grown = [(a, b) for a, b in _grown(means, noise, slowest) if b - a >= fewest]
    level = None
    if torque is not None and not driven and grown:
        # Without the rest of the recording: inertial torque may be many times friction.
        sliding = np.concatenate([torque[a * size : b * size] for a, b in grown])
        if np.isfinite(sliding).any():
            level = float(np.nanquantile(np.abs(sliding), 0.9))
    stretches = []
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
                    stretches.append(SteadyStretch(begin, end, mean))
                break
    return tuple(stretches)


def _means(rate: Array, size: int) -> Array:
    """Means of blocks of `size` samples, shape (n // size,); NaN if half of them are missing."""
    count = len(rate) // size
    blocks = rate[: count * size].reshape(count, size)
    finite = np.isfinite(blocks)
    known = finite.sum(axis=1)
    total = np.where(finite, blocks, 0.0).sum(axis=1)
    means: Array = np.where(2 * known > size, total / np.maximum(known, 1), np.nan)
    # One or two missing blocks, as in a slow recording, do not end a stretch.
    lost = np.flatnonzero(~np.isfinite(means))
    for k in lost[(lost > 0) & (lost < count - 2)]:
        after = next((j for j in (k + 1, k + 2) if np.isfinite(means[j])), None)
        if after is not None and np.isfinite(means[k - 1]):
            means[k] = means[k - 1] + (means[after] - means[k - 1]) / (after - k + 1)
    return means


def _is_steady(rate: Array, torque: Array | None, level: float | None) -> bool:
    """Whether rate and torque have no trend beyond noise, and the torque overcomes friction."""
    known = np.isfinite(rate) if torque is None else np.isfinite(rate) & np.isfinite(torque)
    if known.sum() < FEWEST or not _stays(rate[known], RATE_TREND):
        return False
    if torque is None:
        return True
    if level is None and not float(torque[known].mean()) * float(rate[known].mean()) > 0:
        return False
    return _stays(torque[known], TORQUE_TREND, level=level)


def _stays(values: Array, share: float, *, level: float | None = None) -> bool:
    """Whether neither a line nor an arc through the values is significant.

    The arc excludes the top of a sine. The noise level is from second differences, with a factor
    of ten in variance for correlation; residuals of a fit would include a curve. `level` replaces
    the mean where that may be zero, as of a torque against an external load.
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
    # Excludes motions without a line or an arc, such as a reversal in the middle.
    return bool(mean > 4.0 * noise / np.sqrt(len(values)))


def _grown(means: Array, noise: float, slowest: float) -> list[tuple[int, int]]:
    """Ranges [first, stop) of blocks with means that agree."""
    ranges, first = [], 0
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
            ranges.append((first, stop))
            first = stop
        else:  # it may begin a block later
            first += 1
    return ranges


def _settled(grown: Sequence[tuple[int, int]], means: Array) -> list[tuple[int, int]]:
    """Ranges that are not much shorter than others of a similar rate."""
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
    """Standard deviation of each value, from second differences, which exclude a slope."""
    bends = np.diff(means, 2)
    bends = bends[np.isfinite(bends)]
    return float(1.4826 * np.median(np.abs(bends)) / np.sqrt(6.0)) if len(bends) else 0.0
