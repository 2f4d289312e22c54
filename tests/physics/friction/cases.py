"""Every friction model with a state or a set, as the tests of this folder use it; all in SI."""

from __future__ import annotations

from typing import Any

import numpy as np

from campaign.physics.bench import Bench
from campaign.physics.friction import friction_models
from campaign.physics.step_function import Motion, single_step
from campaign.signals import Signal
from tests.physics.benches import Tree, bench, run, task

CURVE = {
    "coulomb_torque": 26.0,
    "static_torque": 32.0,
    "stribeck_velocity": 0.03,
    "viscous_friction": 4.0,
}
BRISTLES = {"bristle_stiffness": 18000.0, "bristle_damping": 800.0}
MODELS: dict[str, Tree] = {
    "karnopp": {**CURVE, "zero_band": 1e-3},
    "armstrong": {**CURVE, "bristle_stiffness": 18000.0, "memory_lag": 5e-3, "dwell_time": 0.5},
    "dahl": {"coulomb_torque": 26.0, "bristle_stiffness": 18000.0},
    "bliman-sorine": {
        "coulomb_torque": 26.0,
        "static_torque": 32.0,
        "bristle_stiffness": 18000.0,
        "slow_stiffness": 500.0,
    },
    "lugre": {**CURVE, **BRISTLES},
    "lugre-fading": {**CURVE, **BRISTLES, "damping_velocity": 0.1},
    "elasto-plastic": {**CURVE, **BRISTLES},
    "leuven": {**CURVE, **BRISTLES},
    "gms": {**CURVE, "bristle_stiffness": 18000.0, "attraction": 3000.0},
}
NEGATIVE = {"coulomb_torque": 20.0}
"""Another direction: each model declares this parameter."""
WITH_STATE = tuple(name for name in MODELS if name != "karnopp")


def options(name: str, **changes: Any) -> Any:
    """Validated options of a model, with some of them changed."""
    tree = {"model": name, **MODELS[name], **changes}
    return friction_models()[name].options.model_validate(tree, context={"si": True})


def on(name: str, **changes: Any) -> Bench:
    """The simulink bench with this friction alone, and no compensation."""

    def edit(tree: Tree) -> None:
        tree["friction"], tree["compensation"] = {}, {}

    return bench(edit).with_friction({"load": options(name, **changes)})


class Driven:
    """A model by itself at rates that are said step by step, through the engine's code."""

    def __init__(self, name: str, step: float = 1e-3, **changes: Any) -> None:
        self.model, self.options, self.step = (
            friction_models()[name],
            options(name, **changes),
            step,
        )
        self.parameters = self.model.parameters(self.options)
        self.state = np.zeros(self.model.state_size(self.options, step))
        choose = self.model.step_for
        self.function = self.model.step if choose is None else choose(self.options)

    def over(self, start: float, end: float) -> tuple[float, float]:
        """A step from one rate to another; mean torque and torque at its end (N m), no viscous."""
        motion = Motion.at(start, end, self.step)
        mean, change = single_step(self.function, self.parameters, self.state, motion)
        return mean, mean + 0.5 * change

    def move(self, way: float, steps: int = 200) -> float:
        """Torque (N m) after a motion of `way` (rad) at a constant rate."""
        rate = way / steps / self.step
        for _ in range(steps):
            _, torque = self.over(rate, rate)
        return torque


def prescribed(
    name: str, motion: Signal, duration: float, step: float, **changes: Any
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Time and outputs of a prescribed motion, recorded at every step."""
    fields = {"mode": "prescribed", "command": motion, "sample_rate": 1.0 / step}
    return run(on(name, **changes), task(duration=duration, **fields), step)
