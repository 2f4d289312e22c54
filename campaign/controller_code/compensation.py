"""A compensation of a bench in a sampled controller: parameters, states, steps."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from campaign.axis_kind import axis_unit
from campaign.errors import UsageError
from campaign.physics.blocks import (
    Controller,
    Elements,
    Memory,
    controller_of,
    elements_of,
    memory_of,
)
from campaign.physics.complete import CompleteBench
from campaign.physics.friction_elements import Interface
from campaign.physics.lanes import Lane, Lanes, together
from campaign.physics.rows import KEPT_CURRENT
from campaign.physics.sampled_controller import _compensate, _rates
from campaign.signals import Zero
from campaign.trial import Task

Array = NDArray[np.float64]
INPUTS = ("gyro_rate", "load_angle", "motor_angle", "motor_current")
"""rad/s, rad, rad at the load, A."""
SAMPLES = 2_000
"""Number of test vectors."""
FREQUENCIES = 0.3, 1.7, 6.1
"""Frequencies of the sines in their motion (Hz)."""


@dataclass(frozen=True)
class SampledCompensation:
    """A compensation prepared for its translation to controller code.

    Attributes:
        name: name of the compensation in the bench.
        lanes: the compensation as the engine executes it.
    """

    name: str
    bench: CompleteBench
    lanes: Lanes

    @property
    def identifier(self) -> str:
        """Name in code and of files; the name in the bench can have any characters."""
        words = "_".join(["compensation", *re.findall("[A-Za-z0-9]+", self.name)])
        return words[:50].rstrip("_")  # MATLAB allows 63 characters

    @classmethod
    def of(cls, bench: CompleteBench, name: str) -> SampledCompensation:
        """From a bench. UsageError if it has no such compensation or no sample rate."""
        if name not in bench.compensation:
            names = ", ".join(bench.compensation) or "none"
            raise UsageError(f"{bench.name} has no compensation {name!r}; there are {names}")
        rate = bench.controller.sample_rate
        if rate is None:
            raise UsageError(
                f"{bench.name} does not say controller.sample_rate: a continuous compensation "
                "has no code"
            )
        task = Task(
            mode="rate", command=Zero(), compensation=name, duration=1.0, window=(0.0, 1.0),
            sample_rate=rate,
        )  # fmt: skip
        return cls(name, bench, together([Lane.of(bench, task, 1)], 1))

    def unit(self, rotary: str) -> str:
        """Unit of this axis in place of that of a rotary axis."""
        return axis_unit(rotary, self.bench.sides)

    @property
    def controller(self) -> Controller:
        return self.lanes.controller

    @property
    def interfaces(self) -> tuple[Interface, ...]:
        """Friction models, in the order in which their torques are summed."""
        return self.lanes.trials[0].compensation

    @property
    def motor_side(self) -> tuple[bool, ...]:
        """Whether each interface uses the motor's angle."""
        return tuple(bool(each) for each in self.lanes.compensation.side)

    def torques(self, inputs: Array) -> Array:
        """Torque (N m at the load) of each sample, shape (n,), from `INPUTS`, shape (n, 4).

        Clipped to the bench's `limits.torque`, as in the generated code.
        """
        made = together(list(self.lanes.trials), 1)  # new states
        out = np.empty(len(inputs))
        _run(made.controller, made.compensation, made.memory, np.ascontiguousarray(inputs), out)
        return np.clip(out, -self.bench.limits.torque, self.bench.limits.torque)


@numba.njit(error_model="numpy")  # type: ignore[untyped-decorator]
def _run(
    controller: Controller, compensation: Elements, memory: Memory, inputs: Array, out: Array
) -> None:
    """Execute the controller's compensation for each sample."""
    controller, memory = controller_of(1, controller), memory_of(1, memory)
    compensation = elements_of(1, compensation)
    for k in range(len(inputs)):
        gyro, encoder, resolver = inputs[k, 0], inputs[k, 1], inputs[k, 2]
        memory.kept[KEPT_CURRENT] = inputs[k, 3]
        gyro = _rates(controller, memory.kept, k == 0, gyro, encoder, resolver)
        motor_torque = controller.torque_per_current * inputs[k, 3]
        out[k] = _compensate(1, controller, compensation, memory, gyro, motor_torque)


def trial_inputs(made: SampledCompensation) -> Array:
    """`INPUTS` of three sines plus noise of a sensor's size, shape (n, 4); fixed seed."""
    draw, limits = np.random.default_rng(1), made.bench.limits
    time = np.arange(SAMPLES) * float(made.controller.period[0])
    angle, rate = np.zeros(SAMPLES), np.zeros(SAMPLES)
    for frequency in FREQUENCIES:
        turned = 2.0 * np.pi * frequency
        size = 0.05 * limits.rate / turned
        angle += size * np.sin(turned * time)
        rate += size * turned * np.cos(turned * time)
    twist = 1e-4 * limits.angle * draw.standard_normal(SAMPLES)
    current = 0.2 * limits.current * np.sin(2.0 * np.pi * 0.9 * time)
    noise = 1e-4 * limits.rate * draw.standard_normal(SAMPLES)
    return np.column_stack([rate + noise, angle, angle + twist, current])
