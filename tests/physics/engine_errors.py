"""How far the engine is off on a bench, channel by channel."""

from __future__ import annotations

import numpy as np

from campaign.physics.bench import Bench
from campaign.physics.rows import OUTPUTS
from campaign.physics.simulate import simulate
from campaign.trial import Task
from tests.physics.bench_reference import CHANNELS, reference

TOLERANCE = 1e-3
"""Largest error of a channel that a trial may have, of the channel's RMS."""


def error_of(
    bench: Bench,
    task: Task,
    step: float | None = None,
    expected: dict[str, np.ndarray] | None = None,
) -> dict[str, float]:
    """RMS of engine minus reference over RMS of the reference, by channel.

    step: the engine's longest (s); None for its own choice. A channel that is zero throughout is
    left out where the engine has it zero as well, and otherwise infinitely wrong.
    """
    expected = reference(bench, task) if expected is None else expected
    out = np.concatenate([block for _, block in simulate(bench, task, 1, step)], axis=1)
    found = dict(zip(OUTPUTS, out, strict=True))
    errors = {}
    for name in CHANNELS:
        size, off = rms(expected[name]), rms(found[name] - expected[name])
        if size > 0.0 or off > 0.0:
            errors[name] = off / size if size > 0.0 else np.inf
    return errors


def rms(values: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))
