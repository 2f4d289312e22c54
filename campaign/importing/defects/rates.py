"""Channels that are slower than the table they stand in: held, or filled in between.

A held value changes in every p-th row only, and always in the same phase, as no motion does.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from campaign.importing.defects.defect import MOST, Array, Defect, Severity, runs
from campaign.importing.defects.samples import dropouts

FEWEST = 20
"""Changes by which a rhythm is believed."""
_REGULAR = 0.95
"""Share of the changes that keep to the rhythm."""


def slower(name: str, values: Array) -> Iterator[Defect]:
    """A channel whose value is new in every p-th row only; `size` is p."""
    if not np.isfinite(values).all() or len(values) < 2 * FEWEST:
        return
    rows = (0, len(values) - 1)
    changes = np.flatnonzero(np.diff(values) != 0) + 1
    period = _rhythm(changes, len(values))
    if period:
        what = f"{name} is new in every {_ordinal(period)} row only, and held in between"
        yield Defect("held", (name,), what, rows, float(period), Severity.NOTED)
        return
    bends = np.diff(values, 2)
    noise = 1e-6 * float(np.quantile(np.abs(np.diff(values)), 0.99)) + 1e-12 * np.abs(values).max()
    corners = np.flatnonzero(np.abs(bends) > noise) + 1
    period = _rhythm(corners, len(values))
    if period:
        what = f"{name} was measured in every {_ordinal(period)} row, and drawn straight in between"
        yield Defect("filled", (name,), what, rows, float(period), Severity.REPAIRABLE)


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
    # What happens all the time is how the channel is made: a rate from counts, say.
    if len(found) <= MOST:
        yield from dropouts(name, found, "stands still")


def _ordinal(number: int) -> str:
    ending = {1: "st", 2: "nd", 3: "rd"}.get(number % 10, "th")
    return f"{number}{'th' if 10 < number % 100 < 14 else ending}"
