"""Defects of one channel: lost samples, dropouts, wraparound, slow sampling.

A constant channel is no defect, however long: a stretch is judged by the samples before and after
it. A channel that is slower than its table is held or interpolated in between: it changes in every
p-th row only, always in the same phase, as no motion does.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from campaign.importing.defects.defect import Array, Defect, rows_in_words, runs, usual_step
from campaign.text import count

SPANS = (2 * math.pi, 360.0, 1.0, *(float(2**n) for n in range(8, 33)))
"""Scales at which angles wrap around: one turn in the usual units, and powers of 2."""
_LONGEST_DROPOUT = 0.05
"""Share of a recording; a larger share of zeros has another reason."""
_SPIKE = 5.0
"""Permitted deviation of a sample from its neighbors, in spans of the central 98 %."""
_ABRUPT = 8.0
"""Step, in usual steps, above which the motion before it does not explain it."""
FEWEST = 20
"""Minimum number of changes for a period."""
_REGULAR = 0.95
"""Least share of the changes that have the same phase."""
_MOST = 10
"""Maximum number of frozen stretches; more are a property of the channel, such as counts."""


def of_channel(name: str, values: Array, *, angle: bool = False) -> Iterator[Defect]:
    """Defects of a channel's samples, shape (n,), in any unit; NaN is a lost sample.

    Args:
        angle: whether the channel may wrap around.
    """
    known = np.isfinite(values)
    rows = (0, max(len(values) - 1, 0))
    if not known.any():
        what = f"{name} holds no number at all"
        yield Defect("lost", (name,), what, rows, float(len(values)))
        return
    lost = np.flatnonzero(~known)
    if len(lost):
        ends = (int(lost[0]), int(lost[-1]))
        what = f"{name} lacks {count(len(lost), 'sample')}, the first in row {lost[0] + 1}"
        yield Defect("lost", (name,), what, ends, float(len(lost)), noted=True)
    if len(values) < 2 or np.ptp(values[known]) == 0:  # a constant channel is no defect
        return
    turns = list(_wraparound(name, values)) if angle else []
    yield from turns
    if not turns:
        yield from _zeros(name, values)
        yield from _spikes(name, values)


def _wraparound(name: str, values: Array) -> Iterator[Defect]:
    """Jumps by nearly a whole scale, in agreement with the motion around them."""
    steps = np.diff(values)
    size = np.abs(steps)
    span = float(np.ptp(values[np.isfinite(values)]))
    for scale in SPANS:
        jumps = np.flatnonzero(size > 0.5 * scale)
        if not len(jumps) or span > scale * (1 + 1e-3) or span < 0.8 * scale:
            continue
        others = np.delete(size, jumps)
        others = others[np.isfinite(others)]
        usual = float(np.quantile(others, 0.99)) if len(others) else 0.0
        left = scale - size[jumps]
        if len(jumps) < 0.2 * len(values) and np.all(np.abs(left) <= max(5 * usual, 0.02 * scale)):
            what = (
                f"{name} begins anew {count(len(jumps), 'time')} at a scale of {scale:.6g}, "
                f"the first behind row {jumps[0] + 1}"
            )
            where = (int(jumps[0]), int(jumps[-1]) + 1)
            yield Defect("wraparound", (name,), what, where, scale)
            return


def continuous(values: Array, scale: float) -> Array:
    """An angle, shape (n,), without its wraparound jumps; lost samples stay lost."""
    known = np.isfinite(values)
    unwrapped = values.copy()
    unwrapped[known] = np.unwrap(values[known], period=scale)
    return unwrapped


def _zeros(name: str, values: Array) -> Iterator[Defect]:
    """Zeros with a jump to them and a jump back to the expected value."""
    zero = values == 0
    if not zero.any() or zero.mean() > _LONGEST_DROPOUT:
        return
    zeros = [(first, last) for first, last in runs(zero) if first > 0 and last < len(values) - 1]
    if not zeros:
        return
    inside = zero.copy()
    inside[1:] |= zero[:-1]
    usual = usual_step(np.where(inside, np.nan, values))
    firsts, lasts = (np.array(each) for each in zip(*zeros, strict=True))
    before, after = values[firsts - 1], values[lasts + 1]
    lengths = lasts - firsts + 1
    # The largest change that the motion explains in that time.
    reach = usual * (lengths + 1)
    abrupt = np.minimum(np.abs(before), np.abs(after)) > _ABRUPT * usual
    back = (np.abs(after - before) <= np.maximum(reach, 0.3 * np.abs(before))) & (
        np.sign(before) == np.sign(after)
    )
    yield from dropouts(
        name, list(zip(firsts[abrupt & back], lasts[abrupt & back], strict=True)), "is zero"
    )


def _spikes(name: str, values: Array) -> Iterator[Defect]:
    """Single samples far from both neighbors and from the range of the others."""
    known = values[np.isfinite(values)]
    low, high = np.quantile(known, (0.01, 0.99))
    span = max(float(high - low), usual_step(values))
    if len(known) < 100 or span == 0:
        return
    with np.errstate(over="ignore", invalid="ignore"):
        off = np.abs(values[1:-1] - 0.5 * values[:-2] - 0.5 * values[2:])
        is_spike = off > _SPIKE * span
        is_spike &= np.abs(values[2:] - values[:-2]) < 0.1 * off
    rows = np.flatnonzero(is_spike) + 1
    if len(rows):
        what = (
            f"{name} has {count(len(rows), 'single sample')} far beyond all others, the first in "
            f"row {rows[0] + 1}: {values[rows[0]]:.4g}, where most lie between {low:.4g} and "
            f"{high:.4g}"
        )
        ends = (int(rows[0]), int(rows[-1]))
        yield Defect("spike", (name,), what, ends, float(len(rows)))


def dropouts(name: str, found: list[tuple[int, int]], does: str) -> Iterator[Defect]:
    """One defect for all stretches."""
    if found:
        first, last = map(int, found[0])
        samples = int(sum(last - first + 1 for first, last in found))
        others = count(len(found) - 1, "further stretch", "further stretches")
        more = f" and in {others}" if len(found) > 1 else ""
        where = f"{rows_in_words(first, last)}{more} ({count(samples, 'sample')})"
        what = f"{name} {does} in the middle of motion, {where}"
        yield Defect("dropout", (name,), what, (first, int(found[-1][1])), float(samples))


def slower(name: str, values: Array) -> Iterator[Defect]:
    """Defect of a channel that is sampled in every p-th row only; `size` is p."""
    if not np.isfinite(values).all() or len(values) < 2 * FEWEST:
        return
    rows = (0, len(values) - 1)
    changes = np.flatnonzero(np.diff(values) != 0) + 1
    period = _rhythm(changes, len(values))
    if period:
        what = f"{name} is new in one of {period} rows only, and held in between"
        yield Defect("held", (name,), what, rows, float(period), noted=True)
        return
    bends = np.diff(values, 2)
    noise = 1e-6 * float(np.quantile(np.abs(np.diff(values)), 0.99)) + 1e-12 * np.abs(values).max()
    corners = np.flatnonzero(np.abs(bends) > noise) + 1
    period = _rhythm(corners, len(values))
    if period:
        what = f"{name} was measured in one of {period} rows, and drawn straight in between"
        yield Defect("filled", (name,), what, rows, float(period))


def _rhythm(places: NDArray[np.intp], length: int) -> int:
    """Period p > 1 of changes that occur in every p-th row; 0 without a period."""
    if len(places) < FEWEST or len(places) > 0.75 * length:
        return 0
    distances = np.diff(places)
    period = int(np.gcd.reduce(distances)) if len(distances) else 0
    if period < 2:
        usual, counts = np.unique(distances, return_counts=True)
        period = int(usual[np.argmax(counts)])
    if period < 2:
        return 0
    phases = np.bincount(places % period, minlength=period)
    # A channel at rest also has many rows without a change.
    happened = len(places) * period / length
    return period if phases.max() >= _REGULAR * len(places) and happened > 0.2 else 0


def frozen(name: str, values: Array) -> Iterator[Defect]:
    """Stretches in which a noisy channel is constant and then jumps: no data arrived.

    Noise seldom repeats a value; the whole channel gives the probability.
    """
    if len(values) < 100 or not np.isfinite(values).all():
        return
    size = np.abs(np.diff(values))
    same = size == 0
    share = float(same.mean())
    if share > 0.2:
        return
    usual = float(np.median(size[size > 0]))
    peak = float(np.abs(values).max())
    stretches = []
    for first, last in runs(same):
        length = last - first + 1
        # Expected number of such runs if repetitions are independent.
        chance = len(values) * max(share, 1.0 / len(values)) ** length
        leap = float(size[last + 1]) if last + 1 < len(size) else 0.0
        # A filter that has decayed rests near zero, not in the middle of motion.
        rests = abs(values[first]) <= 1e-6 * peak
        moved = first >= 4 and not same[first - 4 : first].any() and not rests
        if length >= 4 and moved and chance < 1e-6 and leap > 5 * usual:
            stretches.append((first + 1, last + 1))
    if len(stretches) <= _MOST:
        yield from dropouts(name, stretches, "stands still")
