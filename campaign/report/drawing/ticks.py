"""Ticks at decades or 1-2-5 steps, whole numbers, angles."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from campaign.report.drawing.curves import scale_of
from campaign.result import Axis
from campaign.text import number

if TYPE_CHECKING:
    from matplotlib.axis import Axis as DrawnAxis

Array = NDArray[np.float64]

FEWEST = 3
"""Minimum number of labelled ticks of a logarithmic axis at decades or 1-2-5 steps."""
MOST_DECADES = 8
TURN = (5.0, 10.0, 15.0, 30.0, 45.0, 90.0, 180.0, 360.0)
"""Steps of an axis in degrees: parts of a turn, and usual smaller ones ..."""
MOST_STEPS = 7
"""... of which the smallest is used that results in at most so many steps."""
WIDE_ANGLE = 20.0
"""Minimum span of an axis with these steps (deg); a shorter axis has plain steps."""


def set_ticks(drawn: DrawnAxis, axis: Axis, values: Sequence[Array], decades: int) -> None:
    """Set the ticks of an axis; call it after its limits are set.

    values: all drawn values along this axis, in display units.
    decades: maximum number of labels of a logarithmic axis.
    """
    from matplotlib.ticker import (
        AutoMinorLocator,
        FixedLocator,
        FuncFormatter,
        MaxNLocator,
        MultipleLocator,
    )

    if axis.places:
        drawn.set_ticks([place * scale_of(axis) for place, _ in axis.places])
        drawn.set_ticklabels([name for _, name in axis.places])
        drawn.set_minor_locator(FixedLocator([]))
        return
    low, high = sorted(float(end) for end in drawn.get_view_interval())
    if drawn.get_scale() == "log":
        places = logarithmic(low, high, min(decades, MOST_DECADES))
        drawn.set_major_locator(FixedLocator(places))
        drawn.set_major_formatter(FuncFormatter(_plain))
        drawn.set_minor_locator(FixedLocator(_nines(low, high)))
        drawn.set_minor_formatter(FuncFormatter(_none))
        return
    if _counts(axis, values):
        drawn.set_major_locator(MaxNLocator(nbins=10, integer=True))
        drawn.set_minor_locator(AutoMinorLocator(1))
    elif axis.shown_unit == "deg" and high - low >= WIDE_ANGLE:
        steps = [step for step in TURN if high - low <= MOST_STEPS * step]
        drawn.set_major_locator(MultipleLocator(steps[0]) if steps else MaxNLocator(nbins=8))


def thin_out(drawn: DrawnAxis, most: Callable[[int], int]) -> None:
    """Reduce the ticks of a linear axis with plain steps if its labels would touch.

    most: function from letters per label to the maximum number of labels.
    """
    from matplotlib.ticker import AutoLocator, MaxNLocator

    low, high = sorted(drawn.get_view_interval())
    places = [place for place in drawn.get_majorticklocs() if low <= place <= high]
    labels = drawn.get_major_formatter().format_ticks(places)
    room = max(2, most(max(map(len, labels), default=0)))
    if type(drawn.get_major_locator()) is AutoLocator and len(labels) > room:
        drawn.set_major_locator(MaxNLocator(nbins=room - 1))


def logarithmic(low: float, high: float, most: int = MOST_DECADES) -> list[float]:
    """Labelled places of a logarithmic axis from `low` to `high`, both positive.

    Decades if there are enough, else 1-2-5 steps, else equal steps.
    """
    from matplotlib.ticker import MaxNLocator

    if not 0 < low < high or not math.isfinite(high):
        return []
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    every = range(first, last + 1)

    def within(shares: Sequence[int], exponents: Sequence[int]) -> list[float]:
        places = [share * 10.0**e for e in exponents for share in shares]
        return [place for place in places if low * (1 - 1e-9) <= place <= high * (1 + 1e-9)]

    for places in (within((1,), every), within((1, 2, 5), every)):
        if len(places) >= FEWEST:
            return places[:: math.ceil(len(places) / max(2, most))]
    steps = MaxNLocator(nbins=5).tick_values(low, high)
    return [float(place) for place in steps if low <= place <= high and place > 0]


def decade_letters(ends: tuple[float, float]) -> int:
    """Number of letters of the longest label at a decade of a logarithmic axis."""
    within = (10.0 ** math.floor(math.log10(end)) for end in ends if 0 < end < math.inf)
    return max((len(number(each)) for each in within), default=0)


def _nines(low: float, high: float) -> list[float]:
    """Unlabelled ticks: 2 to 9 of each decade; none for more than `MOST_DECADES`."""
    if not 0 < low < high or math.log10(high / low) > MOST_DECADES:
        return []
    exponents = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    every = (share * 10.0**e for e in exponents for share in range(2, 10))
    return [place for place in every if low <= place <= high]


def _counts(axis: Axis, values: Sequence[Array]) -> bool:
    """Whether an axis without a unit shows only whole numbers, e.g. numbers of readings."""
    shown = [each[np.isfinite(each)] for each in values]
    total = sum(each.size for each in shown)
    whole = all(bool(np.all(each == np.round(each))) for each in shown)
    return not axis.shown_unit and total > 0 and whole


def _plain(value: float, position: Any) -> str:
    return number(value)


def _none(value: float, position: Any) -> str:
    return ""
