"""Zero passage of a periodic signal: a smooth start of a command."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from campaign.arrays import Array

BISECTIONS = 60
"""after which the interval is 1e-18 of the first one."""


def first_passage(course: Array, value: Callable[[float], float]) -> float:
    """Share of its period at which a signal first passes zero, to all digits.

    course: one period of it, evenly sampled, finely enough that its first change of sign between
    two samples is a single passage. value: the signal itself, at a share of its period.
    """
    index = int(np.flatnonzero(course * np.roll(course, -1) <= 0.0)[0])
    low, high = index / len(course), (index + 1) / len(course)
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        if value(low) * value(middle) <= 0.0:
            high = middle
        else:
            low = middle
    return 0.5 * (low + high)
