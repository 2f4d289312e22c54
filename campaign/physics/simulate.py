"""Simulating tasks on benches, stretch by stretch, so that memory stays flat at any length.

Trials of one structure can be simulated together, in blocks of lanes; each one's samples are, to
the bit, what they are when it is simulated alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from campaign.physics.bench import Bench
from campaign.physics.engine import advance_block, advance_one
from campaign.physics.grid import make_grid
from campaign.physics.lanes import Lane, Lanes, together
from campaign.physics.loop import Array
from campaign.physics.prescribed import drive_block, drive_one
from campaign.physics.rows import OUTPUTS
from campaign.physics.step_function import LANES
from campaign.trial import Task

__all__ = ["make_grid", "simulate", "simulate_together"]

STRETCH_STEPS = 20_000
"""Steps between two looks at limits and stops; of a block fewer, as it has many lanes."""


def simulate(
    bench: Bench, task: Task, seed: int, longest_step: float | None = None
) -> Iterator[tuple[Array, Array]]:
    """Blocks of (time (n,), outputs (8, n) with rows as `rows.OUTPUTS`) until the task ends."""
    for time, (out,) in simulate_together([Lane.of(bench, task, seed, longest_step)]):
        yield time, out


def simulate_together(trials: Sequence[Lane]) -> Iterator[tuple[Array, tuple[Array, ...]]]:
    """As `simulate`, of up to LANES trials of one structure: outputs of each, in their order.

    It goes on until the longest ends; one that has ended has outputs of shape (8, 0).
    """
    alone = len(trials) == 1
    lanes = together(trials, 1 if alone else LANES)
    grid = trials[0].grid
    longest = max(trial.grid.samples for trial in trials)
    stretch = max(1, STRETCH_STEPS // (grid.every * (1 if alone else 4)))
    for first in range(0, longest, stretch):
        count = min(stretch, longest - first)
        at: Array = (first * grid.every + np.arange(count * grid.every + 1.0)) * grid.step
        out = np.empty((len(OUTPUTS), count, lanes.width))
        _advance(lanes, trials[0].prescribed, alone, at, grid.every, out)
        # n / rate, not n steps: whoever knows the rate has the same times to the bit.
        time = (first + np.arange(count)) / trials[0].task.sample_rate
        left = (max(0, min(count, trial.grid.samples - first)) for trial in trials)
        yield time, tuple(out[:, :n, k] for k, n in enumerate(left))


def _advance(
    lanes: Lanes, prescribed: bool, alone: bool, at: Array, every: int, out: Array
) -> None:
    """Over the step grid `at` (steps + 1,), filling `out` (8, samples, lanes)."""
    signals = lanes.signals(at)
    if prescribed:
        drive = drive_one if alone else drive_block
        drive(
            lanes.friction, lanes.compensation, lanes.memory, signals[0],
            lanes.system.step, every, out,
        )  # fmt: skip
        return
    advance = advance_one if alone else advance_block
    advance(
        lanes.system, lanes.friction, lanes.compensation, lanes.controller, lanes.memory,
        signals, lanes.noise(len(at) - 1), every, out,
    )  # fmt: skip
