"""With noisy, quantised sensors the step biases nothing: pairs of trials with the same noise.

A sensor that reads in counts makes a trial chaotic in its last digits: at half the step it takes
another path. So no single trial says whether the step is fine enough, but many do: the error of
stabilization at two steps, each pair with the same noise, differs by chance alone.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from campaign.physics.lanes import Lane
from campaign.physics.simulate import simulate_together
from campaign.physics.vector import LANES
from campaign.signals import Sine
from tests.physics.benches import bench, task

SEEDS = range(1, 33)
DURATION, SETTLED = 12.0, 4.0
SWING = Sine(amplitude=math.radians(18.0), frequency=0.25)
FINE = 1e-3 / 32


def quantised(tree: dict[str, Any]) -> None:
    tree["controller"]["sample_rate"] = "1 kHz"
    tree["sensors"] = {
        "gyro": {"noise": "1e-4 rad/s", "resolution": "5e-5 rad/s"},
        "encoder": {"noise": "2e-6 rad", "resolution": "1e-5 rad"},
        "current": {"noise": "5 mA", "resolution": "10 mA"},
    }


def errors(compensation: str, step: float | None) -> np.ndarray:
    """RMS pointing error (rad) of each seed."""
    on = bench(quantised)
    what = task(
        mode="rate", base_acceleration=SWING, compensation=compensation, duration=DURATION,
        window=(SETTLED, DURATION),
    )  # fmt: skip
    found: list[float] = []
    for first in range(0, len(SEEDS), LANES):
        seeds = SEEDS[first : first + LANES]
        lanes = [Lane.of(on, what, seed, step) for seed in seeds]
        pointing: list[list[np.ndarray]] = [[] for _ in seeds]
        for _, outs in simulate_together(lanes):
            for own, out in zip(pointing, outs, strict=True):
                own.append(out[4])
        settled = round(SETTLED * what.sample_rate)
        found += [float(np.std(np.concatenate(own)[settled:])) for own in pointing]
    return np.array(found)


@pytest.mark.parametrize(
    ("compensation", "noiseless"), [("none", 1e-5), ("static", 0.0), ("lugre", 0.0)]
)
@pytest.mark.parametrize("step", [1e-3, None], ids=["1 ms", "chosen"])
def test_the_step_biases_no_noisy_trial(
    compensation: str, noiseless: float, step: float | None
) -> None:
    """`noiseless`: what the step is wrong by without any noise, where seeds scatter by less.

    Without compensation the differences of the pairs scatter by 1e-6 of the error, and chance
    hides nothing: there the 3e-6 of a noiseless trial are seen.
    """
    coarse, fine = errors(compensation, step), errors(compensation, FINE)
    assert len(np.unique(coarse)) == len(SEEDS)  # the seeds are different trials
    differences = coarse - fine
    standard_error = np.std(differences, ddof=1) / math.sqrt(len(SEEDS))
    bias = abs(float(np.mean(differences)))
    assert bias < max(3.0 * standard_error, noiseless * np.mean(fine))
