"""Friction of a model along a motion that was measured: what the engine makes of its rate.

No loop is closed and no drive simulated, so that nothing of a rig needs to be known: friction meets
the rate that the axis had, with its own state, and the force that drove it is what is predicted.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from campaign.estimation.inverse.motion import Array
from campaign.physics.bench import Bench
from campaign.physics.complete import CompleteBench, complete
from campaign.physics.friction import FrictionField
from campaign.physics.simulate import FrictionAlong
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
        task = Task(
            mode="prescribed",
            command=Polyline(times=tuple(times.tolist()), values=tuple(rates.tolist())),
            duration=count / sample_rate,
            window=(0.0, count / sample_rate),
            sample_rate=sample_rate,
            start_angle=start,
        )
        self._count = count
        self._met = FrictionAlong(_nobody(), task, 1.0 / sample_rate)

    def friction(self, options: Mapping[str, Any]) -> Array:
        """Friction force (N m, or N), shape (n,), of an interface with these options (SI)."""
        load = _friction().validate_python(options, context={"si": True})
        return self._met.of({"load": load})[: self._count]


@cache
def _nobody() -> CompleteBench:
    return complete(Bench.model_validate(_NOBODYS, context={"si": True}))


@cache
def _friction() -> TypeAdapter[Any]:
    return TypeAdapter(FrictionField)
