"""Passings of a level: what noise may not make, and what it may not hide."""

from __future__ import annotations

import numpy as np
import pytest

from campaign.estimation.crossings import passings


def test_without_noise_every_change_of_sign_is_a_passing() -> None:
    curve = np.array([3.0, 1.0, -1.0, -2.0, 0.5, 0.2])
    found = passings(curve, np.zeros(6))
    assert [(p.before, p.after, p.falling) for p in found] == [(1, 2, True), (3, 4, False)]


def test_points_within_their_errors_belong_to_neither_side() -> None:
    curve = np.array([9.0, 5.0, 0.3, -0.2, 0.1, -5.0, -9.0])
    (found,) = passings(curve, np.ones(7))
    assert (found.before, found.after) == (1, 5)
    assert passings(np.array([9.0, 5.0, 0.5, -0.5, -2.0]), np.ones(5)) == []


@pytest.mark.parametrize("points", [10, 200])
def test_a_curve_on_the_level_passes_it_no_more_often_than_said(points: int) -> None:
    """Both sides must be reached by noise alone: rarer than one side, which is 1 % or less."""
    random = np.random.default_rng(77)
    false = sum(
        bool(passings(random.standard_normal(points), np.ones(points))) for _ in range(2000)
    )
    assert false <= 2
