"""Benches and short cuts that the tests of physics, backends and experiments share."""

from __future__ import annotations

import copy
import tomllib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from campaign.physics.bench import Bench
from campaign.physics.rows import OUTPUTS
from campaign.physics.simulate import simulate
from campaign.trial import Task

Tree = dict[str, Any]
SIMULINK = Path(__file__).parents[2] / "protocols" / "benches" / "simulink.toml"

# The thesis' appendix once more, typed here from the document and in SI: what the tests compare
# the program with must not be read by the program.
RATIO, KT, KE, R, L = 141.176, 0.086, 0.071, 0.136, 0.238e-3
INERTIA = 35.0
KPV, KIV, KPC, KIC = 3.0, 30.0, 0.78, 1000.0  # A s/deg, 1/s, V/A, V/(A s)
DEG = 180.0 / np.pi
LOAD = {"tc": 26.0, "ts": 32.0, "vs": 0.03, "s2": 4.0, "s0": 18000.0, "s1": 800.0}
MOTOR = {"tc": 0.03, "ts": 0.04, "vs": 0.03, "s2": 0.001, "s0": 1000.0, "s1": 0.5}


@cache
def _simulink() -> Tree:
    return tomllib.loads(SIMULINK.read_text(encoding="utf-8"))


def bench(edit: Callable[[Tree], object] | None = None) -> Bench:
    """The simulink bench, changed by `edit`."""
    tree = copy.deepcopy(_simulink())
    if edit is not None:
        edit(tree)
    return Bench.model_validate(tree)


def stribeck(static: float, coulomb: float, viscous: float = 0.0, **more: Any) -> Tree:
    """A static friction interface, as a bench file has it."""
    return {
        "model": "stribeck",
        "static_torque": f"{static!r} N m",
        "coulomb_torque": f"{coulomb!r} N m",
        "stribeck_velocity": "0.03 rad/s",
        "viscous_friction": f"{viscous!r} N m s/rad",
        **more,
    }


def run(
    on: Bench, task: Task, step: float | None = 0.25e-3, seed: int = 1
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Time and the engine's outputs by name; a step of None is the one that the trial needs."""
    blocks = list(simulate(on, task, seed, step))
    out = np.concatenate([block for _, block in blocks], axis=1)
    return np.concatenate([time for time, _ in blocks]), dict(zip(OUTPUTS, out, strict=True))


def task(**fields: Any) -> Task:
    """A task of 1 s, recorded at 1 kHz, unless told otherwise."""
    fields = {"mode": "rate", "duration": 1.0, "sample_rate": 1000.0, **fields}
    return Task(**{"window": (0.0, fields["duration"]), **fields})
