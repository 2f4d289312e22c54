"""Signals as values: equal by their fields, and what they are made of after a copy."""

from __future__ import annotations

import numpy as np

from campaign.signals import Polyline


def test_a_polyline_that_was_sampled_equals_one_that_was_not() -> None:
    one, other = (Polyline(times=(0.0, 1.0), values=(0.0, 2.0)) for _ in range(2))
    assert one.sample(np.array([0.5, 3.0])).tolist() == [1.0, 2.0]
    assert other.sample(np.array([0.5])).tolist() == [1.0]
    assert one == other
    assert hash(one) == hash(other)


def test_a_changed_copy_is_sampled_anew() -> None:
    one = Polyline(times=(0.0, 1.0), values=(0.0, 2.0))
    one.sample(np.array([0.5]))
    changed = one.model_copy(update={"values": (4.0, 4.0)})
    assert changed.sample(np.array([0.5])).tolist() == [4.0]
    assert one.sample(np.array([0.5])).tolist() == [1.0]
