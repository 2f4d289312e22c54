"""Defects of one channel: lost samples, dropouts, wraparound, slow sampling.

Standing still is no defect, however long: what only a motion would show is judged by how a channel
enters and leaves the stretch in question. A channel that is slower than its table is held, or
filled in between: it changes in every p-th row only, and always in the same phase, as no motion
does.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from campaign.importing.defects.defect import (
    Array,
    Defect,
    counted,
    rows_in_words,
    runs,
    usual_step,
)

SPANS = (2 * math.pi, 360.0, 1.0, *(float(2**n) for n in range(8, 33)))
"""Where angles begin anew: a turn, in the units that it is told in."""
_LONGEST_DROPOUT = 0.05
"""Share of a recording; what is zero for longer has another reason."""
_SPIKE = 5.0
"""Spans of nearly all samples by which a single one may be off its neighbours."""
_ABRUPT = 8.0
"""Usual steps, beyond which a step is none that the motion before it would lead to."""
FEWEST = 20
"""Changes by which a rhythm is believed."""
_REGULAR = 0.95
"""Share of the changes that keep to the rhythm."""
_MOST = 10
"""Stretches in which a channel stands still; with more that is how it is made: of counts, say."""


def of_channel(name: str, values: Array, *, angle: bool = False) -> Iterator[Defect]:
    """What is wrong with a channel's samples, shape (n,), in any unit; NaN is a lost sample.

    Args:
        angle: whether it may turn past the end of its scale.
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
        what = f"{name} lacks {counted(len(lost), 'sample')}, the first in row {lost[0] + 1}"
        yield Defect("lost", (name,), what, ends, float(len(lost)), noted=True)
    if len(values) < 2 or np.ptp(values[known]) == 0:  # standing still is no defect
        return
    turns = list(_wraparound(name, values)) if angle else []
    yield from turns
    if not turns:
        yield from _zeros(name, values)
        yield from _spikes(name, values)


def _wraparound(name: str, values: Array) -> Iterator[Defect]:
    """Jumps by nearly a whole scale, which end where the motion would have led."""
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
                f"{name} begins anew {counted(len(jumps), 'time')} at a scale of {scale:.6g}, "
                f"the first behind row {jumps[0] + 1}"
            )
            where = (int(jumps[0]), int(jumps[-1]) + 1)
            yield Defect("wraparound", (name,), what, where, scale)
            return


def continuous(values: Array, scale: float) -> Array:
    """An angle whose scale began anew, shape (n,), without its jumps; lost samples stay lost."""
    known = np.isfinite(values)
    made = values.copy()
    made[known] = np.unwrap(values[known], period=scale)
    return made


def _zeros(name: str, values: Array) -> Iterator[Defect]:
    """Zeros that a channel jumps to, and from there back to where it would be."""
    zero = values == 0
    if not zero.any() or zero.mean() > _LONGEST_DROPOUT:
        return
    found = [(first, last) for first, last in runs(zero) if first > 0 and last < len(values) - 1]
    if not found:
        return
    inside = zero.copy()
    inside[1:] |= zero[:-1]
    usual = usual_step(np.where(inside, np.nan, values))
    firsts, lasts = (np.array(each) for each in zip(*found, strict=True))
    before, after = values[firsts - 1], values[lasts + 1]
    lengths = lasts - firsts + 1
    # Where the motion can have led in that time.
    reach = usual * (lengths + 1)
    abrupt = np.minimum(np.abs(before), np.abs(after)) > _ABRUPT * usual
    back = (np.abs(after - before) <= np.maximum(reach, 0.3 * np.abs(before))) & (
        np.sign(before) == np.sign(after)
    )
    yield from dropouts(
        name, list(zip(firsts[abrupt & back], lasts[abrupt & back], strict=True)), "is zero"
    )


def _spikes(name: str, values: Array) -> Iterator[Defect]:
    """Single samples that no motion leads to or away from, far beyond all the others."""
    known = values[np.isfinite(values)]
    low, high = np.quantile(known, (0.01, 0.99))
    span = max(float(high - low), usual_step(values))
    if len(known) < 100 or span == 0:
        return
    with np.errstate(over="ignore", invalid="ignore"):
        off = np.abs(values[1:-1] - 0.5 * values[:-2] - 0.5 * values[2:])
        found = off > _SPIKE * span
        found &= np.abs(values[2:] - values[:-2]) < 0.1 * off
    rows = np.flatnonzero(found) + 1
    if len(rows):
        what = (
            f"{name} has {counted(len(rows), 'single sample')} far beyond all others, the first in "
            f"row {rows[0] + 1}: {values[rows[0]]:.4g}, where most lie between {low:.4g} and "
            f"{high:.4g}"
        )
        ends = (int(rows[0]), int(rows[-1]))
        yield Defect("spike", (name,), what, ends, float(len(rows)))


def dropouts(name: str, found: list[tuple[int, int]], does: str) -> Iterator[Defect]:
    """One defect for all stretches that there are."""
    if found:
        first, last = map(int, found[0])
        samples = int(sum(last - first + 1 for first, last in found))
        more = f" and in {counted(len(found) - 1, 'further stretch')}" if len(found) > 1 else ""
        where = f"{rows_in_words(first, last)}{more} ({counted(samples, 'sample')})"
        what = f"{name} {does} in the middle of motion, {where}"
        yield Defect("dropout", (name,), what, (first, int(found[-1][1])), float(samples))


def slower(name: str, values: Array) -> Iterator[Defect]:
    """A channel whose value is new in every p-th row only; `size` is p."""
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
    """Period of what happens in every p-th row, p > 1; 0 where it has none."""
    if len(places) < FEWEST or len(places) > 0.75 * length:
        return 0
    apart = np.diff(places)
    period = int(np.gcd.reduce(apart)) if len(apart) else 0
    if period < 2:
        usual, counts = np.unique(apart, return_counts=True)
        period = int(usual[np.argmax(counts)])
    if period < 2:
        return 0
    phases = np.bincount(places % period, minlength=period)
    # Rows in which nothing happened are many, too, where it stood still.
    happened = len(places) * period / length
    return period if phases.max() >= _REGULAR * len(places) and happened > 0.2 else 0


def frozen(name: str, values: Array) -> Iterator[Defect]:
    """Where a channel with noise stands still for a while, and then jumps: nothing came from it.

    Noise seldom repeats itself; how seldom, the rest of the channel tells.
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
    found = []
    for first, last in runs(same):
        length = last - first + 1
        # Chance of such a run anywhere, were repetitions independent of each other.
        chance = len(values) * max(share, 1.0 / len(values)) ** length
        leap = float(size[last + 1]) if last + 1 < len(size) else 0.0
        # A filter that has run out rests at next to nothing, and not in the middle of motion.
        rests = abs(values[first]) <= 1e-6 * peak
        moved = first >= 4 and not same[first - 4 : first].any() and not rests
        if length >= 4 and moved and chance < 1e-6 and leap > 5 * usual:
            found.append((first + 1, last + 1))
    if len(found) <= _MOST:
        yield from dropouts(name, found, "stands still")
