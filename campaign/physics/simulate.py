"""Simulation of tasks on benches, in segments of bounded memory.

Trials of one structure can be simulated together, in blocks of lanes; the samples of each are
bit-identical to those of a separate simulation.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from campaign.arrays import Array
from campaign.physics.blocks import zeros
from campaign.physics.complete import CompleteBench
from campaign.physics.engine import advance_block, advance_one
from campaign.physics.grid import Grid
from campaign.physics.lanes import Lane, Lanes, together
from campaign.physics.prescribed_motion import drive_block, drive_one
from campaign.physics.rows import OUT_FRICTION, OUTPUTS
from campaign.physics.vector import LANES
from campaign.trial import Task

STRETCH_STEPS = 20_000
"""Steps of a trial between two checks of limits and stops."""
BLOCK_STEPS, BLOCK_SAMPLES = 128_000, 16_000
"""The same for a block; a quarter of these steps takes 6 % more time."""


def simulate(
    bench: CompleteBench, task: Task, seed: int, longest_step: float | None = None
) -> Iterator[tuple[Array, Array]]:
    """Yield blocks of (time (n,), outputs (8, n) with rows as `rows.OUTPUTS`) until the end."""
    for time, (out,) in simulate_together([Lane.of(bench, task, seed, longest_step)]):
        yield time, out


def simulate_together(
    trials: Sequence[Lane], stretch: int | None = None
) -> Iterator[tuple[Array, tuple[Array, ...]]]:
    """As `simulate`, for up to LANES trials of one structure: outputs of each, in their order.

    It ends with the longest trial; after its end a trial has outputs of shape (8, 0). `stretch`:
    samples per block; None: from the number of steps.
    """
    alone = len(trials) == 1
    lanes = together(trials, 1 if alone else LANES)
    grid = trials[0].grid
    longest = max(trial.grid.samples for trial in trials)
    if stretch is None:
        stretch = samples_at_a_time(grid, alone=alone)
    for first in range(0, longest, stretch):
        count = min(stretch, longest - first)
        at = _steps(grid, first, count)
        out = zeros(len(OUTPUTS), count, lanes.width)
        _advance(lanes, trials[0].prescribed, alone, at, grid.every, out)
        # n / rate, not n steps: the times are bit-identical to those computed from the rate.
        time = (first + np.arange(count)) / trials[0].task.sample_rate
        left = (max(0, min(count, trial.grid.samples - first)) for trial in trials)
        by_trial = np.empty((lanes.width, len(OUTPUTS), count))
        for row, samples in enumerate(out):  # each fits the processor's cache
            by_trial[:, row] = samples.T
        yield time, tuple(by_trial[k, :, :n] for k, n in enumerate(left))


class FrictionAlong:
    """A prescribed motion, prepared once for repeated evaluations of friction."""

    def __init__(self, bench: CompleteBench, task: Task, longest_step: float) -> None:
        """Prepare it. Raises ValueError if the task's and the bench's rates do not match."""
        lane = Lane.of(bench, task, 1, longest_step)
        self._lanes, self._every = together([lane], 1), lane.grid.every
        stretch = samples_at_a_time(lane.grid, alone=True)
        self._stretches: list[tuple[int, Array]] = []
        for first in range(0, lane.grid.samples, stretch):
            count = min(stretch, lane.grid.samples - first)
            (rates,) = self._lanes.signals(_steps(lane.grid, first, count))
            self._stretches.append((count, rates))

    def of(self, friction: Mapping[str, Any]) -> Array:
        """Friction torque (N m, or N), shape (samples,), as from `simulate` with this friction."""
        lanes = self._lanes.with_friction_at_rest(friction)
        parts = []
        for count, rates in self._stretches:
            out = zeros(len(OUTPUTS), count, 1)
            drive_one(
                lanes.friction, lanes.compensation, lanes.memory, rates,
                lanes.system.step, self._every, out,
            )  # fmt: skip
            parts.append(out[OUT_FRICTION, :, 0])
        return np.concatenate(parts)


def _steps(grid: Grid, first: int, count: int) -> Array:
    """Times (s) of the step grid over `count` samples, shape (steps + 1,)."""
    return np.asarray((first * grid.every + np.arange(count * grid.every + 1.0)) * grid.step)


def samples_at_a_time(grid: Grid, *, alone: bool) -> int:
    """Samples per block; bounds memory and the time between two checks."""
    if alone:
        return max(1, STRETCH_STEPS // grid.every)
    return max(1, min(BLOCK_SAMPLES, BLOCK_STEPS // grid.every))


def _advance(
    lanes: Lanes, prescribed: bool, alone: bool, at: Array, every: int, out: Array
) -> None:
    """Advance over the step grid `at` (steps + 1,); fills `out` (8, samples, lanes)."""
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
