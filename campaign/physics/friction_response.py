"""Torque of a friction model along a given motion.

It simulates neither loop nor drive, so no values of a rig are necessary: the model gets the rate,
and has its own state.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from campaign.arrays import Array
from campaign.physics.bench import Bench
from campaign.physics.complete import CompleteBench, complete
from campaign.physics.friction import FrictionField
from campaign.physics.simulate import FrictionAlong
from campaign.signals import Polyline, Sine
from campaign.trial import Task

_LOOP = {"form": "parallel", "proportional": 1.0, "integral": 0.0}
_BARE_BENCH: Mapping[str, Any] = {
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
"""Values that a simulation requires; a prescribed motion uses none of them."""


class Along:
    """A motion, prepared for repeated evaluations of friction."""

    def __init__(self, task: Task) -> None:
        """task: prescribed rate in rad/s (or m/s); a step is one sample at most."""
        self._count = task.samples
        self._met = FrictionAlong(_bare_bench(), task, 1.0 / task.sample_rate)

    @classmethod
    def rates(cls, rates: Array, sample_rate: float, start: float = 0.0) -> Along:
        """rates: rad/s (or m/s), shape (n,), at `sample_rate` (Hz). start: position (rad, or m)."""
        times = np.arange(len(rates)) / sample_rate
        command = Polyline(times=tuple(times.tolist()), values=tuple(rates.tolist()))
        return cls(_task(command, len(rates), sample_rate, start))

    @classmethod
    def sine(cls, rate: float, frequency: float, cycles: int, per_cycle: int) -> Along:
        """rate: amplitude (rad/s); it begins at an end position, with rate 0."""
        sample_rate = per_cycle * frequency
        command = Sine(amplitude=rate, frequency=frequency)
        start = -rate / (2.0 * np.pi * frequency)
        return cls(_task(command, cycles * per_cycle, sample_rate, start))

    def friction(self, options: Mapping[str, Any]) -> Array:
        """Friction force (N m, or N), shape (n,), of an interface with these options (SI)."""
        load = _friction().validate_python(options, context={"si": True})
        return self._met.of({"load": load})[: self._count]


def _task(command: Polyline | Sine, count: int, sample_rate: float, start: float) -> Task:
    duration = count / sample_rate
    return Task(
        mode="prescribed",
        command=command,
        duration=duration,
        window=(0.0, duration),
        sample_rate=sample_rate,
        start_angle=start,
    )


@cache
def _bare_bench() -> CompleteBench:
    return complete(Bench.model_validate(_BARE_BENCH, context={"si": True}))


@cache
def _friction() -> TypeAdapter[Any]:
    return TypeAdapter(FrictionField)
