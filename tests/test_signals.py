"""Signals as values: what is equal, whatever has been done with it."""

from __future__ import annotations

import numpy as np

from campaign.signals import Polyline


def test_polylines_are_equal_by_their_points_before_and_after_they_are_sampled() -> None:
    one, other = (Polyline(times=(0.0, 1.0), values=(0.0, 2.0)) for _ in range(2))
    further = Polyline(times=(0.0, 1.0), values=(0.0, 3.0))
    for _ in range(2):
        assert one == other
        assert hash(one) == hash(other)
        assert one != further
        assert one != "polyline"
        for each in (one, other, further):
            each.sample(np.array([0.5]))
