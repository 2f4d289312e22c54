"""What follows from the angle holds the truth as often as it says, where few strokes are long."""

from __future__ import annotations

import numpy as np
import pytest

from campaign.estimation.angle_dependence import over_a_turn
from tests.estimation.coverage import rejected

GRAVITY = 8.0
"""N m"""


def strokes(random: np.random.Generator) -> list[tuple[np.ndarray, ...]]:
    """To and fro at nine speeds: 0.07 to 2 rad in 0.9 s, friction of each as it happens to be."""
    found = []
    for number, speed in enumerate(np.repeat(np.geomspace(0.07, 2.0, 9), 2)):
        time = 1.5 * number + 0.002 * np.arange(450)
        there = number % 2 == 0
        angle = 0.9 * speed * np.linspace(0.0, 1.0, 450)[:: 1 if there else -1]
        level = random.uniform(5.0, 15.0) * (1.0 if there else -1.0)
        noise = 0.05 * random.standard_normal(450)
        found.append((time, angle, level + GRAVITY * np.sin(angle) + noise))
    return found


@pytest.mark.slow
def test_its_doubt_holds_what_is_wrongly_taken_off_short_strokes() -> None:
    """By stretches as draws without a correction for the few that decide 87 % held, not 95 %."""
    held = []
    for seed in range(150):
        parts = strokes(np.random.default_rng(seed))
        found = over_a_turn(parts)
        angle = parts[0][1]
        off = float(np.mean(found.at(angle) - GRAVITY * np.sin(angle)))
        held.append(abs(off) <= 1.96 * float(np.linalg.norm(found.doubts(angle))))
    assert not rejected({"short strokes": held}, "less")
    assert not rejected({"short strokes": held}, "greater", 0.985)
