"""Preview of a long recording: few points that preserve every peak."""

from __future__ import annotations

import numpy as np

from campaign.recording import Array

PREVIEW_POINTS = 20_000
"""Largest number of points of a preview: viewers in a browser are slow above about 100 000."""


class Preview:
    """Minimum and maximum of segments of increasing length, in constant memory.

    Segments begin with one sample, and double when there are too many. So the result depends only
    on the samples and on `PREVIEW_POINTS`. Requires blocks whose length is a power of two, except
    the last block.
    """

    def __init__(self, points: int = PREVIEW_POINTS) -> None:
        self._most = points // 2
        self._stretch = 1
        self._extremes = np.empty((4, 0))  # time of minimum, minimum, time of maximum, maximum

    def add(self, time: Array, values: Array) -> None:
        """Add samples, both shape (n,)."""
        new = np.stack((time, values, time, values))
        halvings = self._stretch
        while halvings > 1 and new.shape[1] > 1:
            new = _merge_pairs(new)
            halvings //= 2
        self._extremes = np.concatenate((self._extremes, new), axis=1)
        while self._extremes.shape[1] > self._most:
            self._extremes = _merge_pairs(self._extremes)
            self._stretch *= 2

    def points(self) -> tuple[Array, Array]:
        """Times and values, in the order of time; shape (m,), m <= `PREVIEW_POINTS`."""
        low_time, low, high_time, high = self._extremes
        swap = low_time > high_time
        times = np.stack((np.where(swap, high_time, low_time), np.where(swap, low_time, high_time)))
        values = np.stack((np.where(swap, high, low), np.where(swap, low, high)))
        return times.T.ravel(), values.T.ravel()


def _merge_pairs(extremes: Array) -> Array:
    """Extremes of segments of double length; an odd last segment stays unchanged.

    If the left sample is NaN, the right one is used, so NaN hides no later peak.
    """
    count = extremes.shape[1]
    even = count - count % 2
    left, right = extremes[:, 0:even:2], extremes[:, 1:even:2]
    low_left = (left[1] <= right[1]) | np.isnan(right[1])
    high_left = (left[3] >= right[3]) | np.isnan(right[3])
    merged = np.concatenate(
        (np.where(low_left, left[:2], right[:2]), np.where(high_left, left[2:], right[2:]))
    )
    return np.concatenate((merged, extremes[:, even:]), axis=1)
