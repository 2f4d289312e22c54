"""Rows of a regression: which are left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from campaign.estimation.inverse.motion import FilterSettings, decimated, motion_of_position
from campaign.estimation.inverse.rows import moving
from tests.estimation.test_inverse_dynamics import smooth_motion


def test_noise_at_the_end_of_a_recording_is_left_out() -> None:
    """A filter begins and ends on single samples there, and what it makes is differentiated."""
    draw = np.random.default_rng(3)
    time = np.arange(3000) / 1000.0
    at_end, inside = [], []
    filtering = FilterSettings(100.0, 10, 0, slowest=0.05)
    for _ in range(40):
        made = motion_of_position(time, 2.0 * time + draw.standard_normal(3000), time, 100.0)
        noise = decimated(made.acceleration[:, None], 10)[:, 0] ** 2
        at_end.append(noise[-2:].max())
        inside.append(noise[50:-50].mean())
    assert np.mean(at_end) > 5.0 * np.mean(inside)
    moved = smooth_motion(3.0, 1000.0)
    kept = moving(moved, filtering) > 0.0
    assert not kept[:5].any()
    assert not kept[-5:].any()
    assert moving(moved, replace(filtering, slowest=0.0)).all()  # plain fits are as published
