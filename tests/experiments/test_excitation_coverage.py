"""Intervals of the report of `excitation` hold on rigs unlike the shipped ones.

A few seeds; `python -m benchmarks.excitation_coverage` has twenty of each rig.
"""

from __future__ import annotations

from collections import defaultdict

import pytest

from campaign.estimate import Estimate
from tests.estimation.coverage import holds, rejected
from tests.estimation.excited_rigs import THREE
from tests.experiments.excited import by_lines, by_series, true_dynamics

SEEDS = range(1, 5)


@pytest.mark.slow
def test_series_tell_inertia_and_friction_of_three_rigs() -> None:
    held: dict[str, list[bool]] = defaultdict(list)
    for name, rig in THREE.items():
        truth = true_dynamics(rig())
        for seed in SEEDS:
            found = {each.name: each for each in by_series(name, seed)}
            for quantity, true in truth.items():
                held[quantity].append(holds(found[quantity], true))
    assert rejected(held, "less") == {}


@pytest.mark.slow
@pytest.mark.parametrize("name", THREE)
def test_levels_of_distortion_differ_by_no_more_than_they_say(name: str) -> None:
    found: list[Estimate] = []
    for seed in SEEDS[:3]:
        found += [each for each in by_lines(name, seed) if each.name == "odd_distortion"]
    mean = sum(each.value for each in found) / len(found)
    assert rejected({name: [holds(each, mean) for each in found]}, "less") == {}
