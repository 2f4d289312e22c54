"""Friction of a model along a motion that was measured: what the engine makes of its rate.

No loop is closed and no drive simulated, so that nothing of a rig needs to be known: friction meets
the rate that the axis had, with its own state, and the force that drove it is what is predicted.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from campaign.identification.inverse.motion import Array
from campaign.physics.bench import Bench
from campaign.physics.complete import CompleteBench, complete
from campaign.physics.lanes import Lane
from campaign.physics.rows import OUT_FRICTION
from campaign.physics.simulate import simulate_together
from campaign.signals import Polyline
from campaign.trial import Task

_LOOP = {"form": "parallel", "proportional": 1.0, "integral": 0.0}
_NOBODYS: Mapping[str, Any] = {
    "name": "friction alone",
    "axis": {"name": "none", "inertia": 1.0},
    "motor": {
        "torque_constant": 1.0,
        "back_emf_constant": 0.0,
        "resistance": 1.0,
        "inductance": 1.0,
    },
    "gear": {"ratio": 1.0},
    "controller": {"rate": _LOOP, "current": _LOOP},
    "limits": dict.fromkeys(
        ("angle", "rate", "acceleration", "torque", "current", "duration"), 1e9
    ),
}
"""What a simulation asks for; a prescribed motion uses none of it."""


class Along:
    """A motion, ready to be met by friction again and again."""

    def __init__(self, rates: Array, sample_rate: float, start: float = 0.0) -> None:
        """rates: rad/s (or m/s), shape (n,), at `sample_rate` (Hz). start: position (rad, or m)."""
        count = len(rates)
        times = np.arange(count) / sample_rate
        self._step = 1.0 / sample_rate
        self._task = Task(
            mode="prescribed",
            command=Polyline(times=tuple(times.tolist()), values=tuple(rates.tolist())),
            duration=count / sample_rate,
            window=(0.0, count / sample_rate),
            sample_rate=sample_rate,
            start_angle=start,
        )
        self._count = count

    def friction(self, options: Mapping[str, Any]) -> Array:
        """Friction force (N m, or N), shape (n,), of an interface with these options (SI)."""
        lane = Lane.of(_bench(json.dumps(options, sort_keys=True)), self._task, 1, self._step)
        parts = [found[OUT_FRICTION] for _, (found,) in simulate_together([lane])]
        return np.concatenate(parts)[: self._count]


@lru_cache(maxsize=4)
def _bench(options: str) -> CompleteBench:
    """Of options as JSON: the pieces of a motion meet one friction, one after the other."""
    tree = {**_NOBODYS, "friction": {"load": json.loads(options)}}
    return complete(Bench.model_validate(tree, context={"si": True}))
