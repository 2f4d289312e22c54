"""The engine: advances loop, friction and controller step by step in compiled code.

Scheme: everything linear is exact (`campaign.physics.loop.discretise`). Each friction model is asked
once per step for its torque as a straight line over the step, from the relative rate at the start
and the rate expected at the end; that line is then an input of the linear part. The result is of
second order in the step for friction with a state, and stable for any bristle stiffness.

The engine knows no friction model, compensation or controller form by name. It is compiled once:
friction models come as addresses of compiled step functions, everything else as numbers.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from campaign.physics.compiled import compiled
from campaign.physics.step_function import call_step

Array = NDArray[np.float64]

GYRO, ENCODER, RESOLVER, CURRENT_SENSOR = range(4)
# Rows of the engine's output, one column per recorded sample.
OUTPUTS = (
    "gyro_rate",
    "relative_rate",
    "relative_angle",
    "motor_current",
    "pointing_angle",
    "compensation_torque",
    "friction_torque",
    "load_rate",
)


class System(NamedTuple):
    """The discretised linear part: x' = F x + G u + H (u' - u); see `loop.discretise`."""

    f: Array  # (n, n)
    g: Array  # (n, 4)
    h: Array  # (n, 4)
    relative_x: Array  # (n,) relative rate that continuous compensation sees
    relative_u: Array  # (4,)
    linear_x: Array  # (n,) torque of the continuous linear compensation
    linear_u: Array  # (4,)
    step: float


class Elements(NamedTuple):
    """Friction models, as plant or as compensation; k of them."""

    address: NDArray[np.uintp]  # (k,) compiled step functions
    parameters: Array  # (k, p)
    state: Array  # (k, s) advanced in place
    torque: Array  # (k,) what one N m counts at the load, gain included
    rate: Array  # (k,) model's rate per relative rate of the load
    viscous: Array  # (k,) the linear part (N m s/rad at the load), gain included
    motor_side: NDArray[np.bool_]  # (k,) reads the resolver rather than the encoder
    last: Array  # (k,) torque at the end of the last step; in place
    stateless: NDArray[np.bool_]  # (k,)


class Controller(NamedTuple):
    """A sampled rate controller with its sensors; `every` is 0 for a continuous one."""

    every: int  # steps per sample
    period: float  # s
    closes_rate_loop: bool
    proportional: float  # A s/rad
    integral: float  # A/rad
    torque_per_current: float  # N m/A
    ratio: float  # N
    filter_pole: float  # of the relative-rate low-pass, 0 for none
    resolution: Array  # (4,) of the sensors, 0 for none
    delay: NDArray[np.int64]  # (4,) samples
    output_delay: int  # samples
    a: Array  # (m, m) linear compensation, discrete
    b: Array  # (m, 3)
    c: Array  # (m,)
    d: Array  # (3,)


class Memory(NamedTuple):
    """What is carried from block to block, advanced in place.

    controller: 0 integral (A), 1, 2 relative rate by encoder and resolver, 3, 4 last angles,
    5 pointing angle, 6 gyro reading, 7 current reading, 8 compensation torque, 9 angle reading.
    """

    x: Array  # (n,)
    controller: Array  # (10,)
    linear: Array  # (m,)
    readings: Array  # (4, longest delay + 1), ring
    outputs: Array  # (output delay + 1,), ring
    counters: NDArray[np.int64]  # 0 steps done, 1 samples done


@compiled
def advance(
    system: System,
    friction: Elements,
    compensation: Elements,
    controller: Controller,
    memory: Memory,
    command: Array,
    base_rate: Array,
    noise: Array,
    every: int,
    out: Array,
) -> None:
    """Advance over one block and record every `every`-th step.

    command, base_rate: (steps + 1,) at the step grid.   noise: (samples, 4), in sensor units.
    out: (8, steps / every), rows as OUTPUTS; the sample at the start of each `every` steps.
    """
    n = system.f.shape[0]
    x = memory.x
    new = np.empty(n)
    u = np.zeros(4)
    line = np.zeros(2)
    sampled = controller.every > 0
    samples = 0
    # Relative rate that compensation sees at the end of a step, per constant torque over it.
    seen_per_friction, seen_per_compensation = 0.0, 0.0
    for i in range(n):
        seen_per_friction += system.relative_x[i] * system.g[i, 2]
        seen_per_compensation += system.relative_x[i] * system.g[i, 3]
    for k in range(command.shape[0] - 1):
        if sampled and memory.counters[0] % controller.every == 0:
            u[0] = _sample(controller, compensation, memory, command[k], noise[samples], line)
            samples += 1
        memory.counters[0] += 1
        u[1] = base_rate[k]
        du0 = 0.0
        if not sampled:
            u[0] = command[k]
            du0 = command[k + 1] - command[k]
        du1 = base_rate[k + 1] - base_rate[k]

        # The step without friction and friction-model compensation.
        for i in range(n):
            total = system.g[i, 0] * u[0] + system.h[i, 0] * du0
            total += system.g[i, 1] * u[1] + system.h[i, 1] * du1
            for j in range(n):
                total += system.f[i, j] * x[j]
            new[i] = total

        compensation_mean, compensation_change = 0.0, 0.0
        seen = 0.0
        if not sampled:
            seen = system.relative_u[1] * u[1]
            expected = system.relative_u[1] * base_rate[k + 1]
            for i in range(n):
                seen += system.relative_x[i] * x[i]
                expected += system.relative_x[i] * new[i]
            for e in range(friction.last.shape[0]):
                expected += seen_per_friction * friction.last[e]
            for e in range(compensation.last.shape[0]):
                expected += seen_per_compensation * compensation.last[e]
            for e in range(compensation.last.shape[0]):
                _ask(compensation, e, seen, expected, system.step, 0.0, line)
                compensation_mean += line[0]
                compensation_change += line[1]

        # Friction: what rate to expect at the end if its torque stayed as it is.
        v0 = x[0] - u[1]
        v1 = new[0] - base_rate[k + 1]
        v1 += system.g[0, 3] * (compensation_mean - 0.5 * compensation_change)
        v1 += system.h[0, 3] * compensation_change
        compliance = -system.g[0, 2]
        for e in range(friction.last.shape[0]):
            v1 -= compliance * friction.last[e]
        friction_mean, friction_change = 0.0, 0.0
        friction_now = 0.0
        for e in range(friction.last.shape[0]):
            _ask(friction, e, v0, v1, system.step, compliance, line)
            if friction.stateless[e]:
                # What one dry friction takes is no longer there for the next to stop.
                v1 -= compliance * line[0]
                friction.last[e] = 0.0
            friction_mean += line[0]
            friction_change += line[1]
            friction_now += line[0] - 0.5 * line[1] + friction.viscous[e] * v0

        if (memory.counters[0] - 1) % every == 0:
            column = k // every
            _record(out[:, column], system, controller, memory, u, seen)
            if not sampled:
                now = compensation_mean - 0.5 * compensation_change
                for e in range(compensation.last.shape[0]):
                    now += compensation.viscous[e] * seen
                out[5, column] += now
            out[6, column] = friction_now

        friction_start = friction_mean - 0.5 * friction_change
        compensation_start = compensation_mean - 0.5 * compensation_change
        for i in range(n):
            x[i] = (
                new[i]
                + system.g[i, 2] * friction_start
                + system.h[i, 2] * friction_change
                + system.g[i, 3] * compensation_start
                + system.h[i, 3] * compensation_change
            )


@compiled
def _ask(
    elements: Elements, e: int, v0: float, v1: float, step: float, compliance: float, line: Array
) -> None:
    """Torque line of one element at the load; also kept as its last torque."""
    torque, rate = elements.torque[e], elements.rate[e]
    line[0] = 0.0
    line[1] = 0.0
    call_step(
        elements.address[e],
        elements.parameters[e].ctypes.data,
        elements.state[e].ctypes.data,
        v0 * rate,
        v1 * rate,
        step,
        compliance * torque * rate,
        line.ctypes.data,
    )
    line[0] *= torque
    line[1] *= torque
    elements.last[e] = line[0] + 0.5 * line[1]


@compiled
def _record(
    out: Any, system: System, controller: Controller, memory: Memory, u: Array, seen: float
) -> None:
    x, seen_by = memory.x, memory.controller
    out[7] = x[0]
    if controller.every > 0:
        out[0] = seen_by[6]
        out[1] = seen_by[1]
        out[2] = seen_by[9]
        out[3] = seen_by[7]
        out[4] = seen_by[5]
        out[5] = seen_by[8]
        return
    out[0] = x[0]
    out[1] = seen
    out[2] = x[2]
    out[3] = x[3]
    out[4] = x[1]
    torque = 0.0
    for i in range(x.shape[0]):
        torque += system.linear_x[i] * x[i]
    for i in range(4):
        torque += system.linear_u[i] * u[i]
    out[5] = torque


@compiled
def _sample(
    controller: Controller,
    compensation: Elements,
    memory: Memory,
    command: float,
    noise: Array,
    line: Array,
) -> float:
    """One sample of the controller: read the sensors, return the current command now in force."""
    x, own = memory.x, memory.controller
    sample = memory.counters[1]
    memory.counters[1] += 1
    ring = memory.readings.shape[1]
    readings = memory.readings
    truth = (x[0], x[2], x[2] * controller.ratio, x[3])
    for s in range(4):
        value = truth[s] + noise[s]
        if controller.resolution[s] > 0.0:
            value = np.rint(value / controller.resolution[s]) * controller.resolution[s]
        if sample == 0:
            readings[s, :] = value  # before the first sample everything stood still
        readings[s, sample % ring] = value
    gyro = readings[0, (sample - controller.delay[0]) % ring]
    encoder = readings[1, (sample - controller.delay[1]) % ring]
    resolver = readings[2, (sample - controller.delay[2]) % ring] / controller.ratio
    current = readings[3, (sample - controller.delay[3]) % ring]
    if sample == 0:
        own[3], own[4] = encoder, resolver
    before_load, before_motor = own[1], own[2]
    pole = controller.filter_pole
    own[1] = pole * own[1] + (1.0 - pole) * (encoder - own[3]) / controller.period
    own[2] = pole * own[2] + (1.0 - pole) * (resolver - own[4]) / controller.period
    own[3], own[4] = encoder, resolver
    if sample > 0:
        own[5] += 0.5 * controller.period * (own[6] + gyro)
    own[6], own[7], own[9] = gyro, current, encoder

    torque = (
        controller.d[0] * gyro
        + controller.d[1] * controller.torque_per_current * current
        + controller.d[2] * own[1]
    )
    torque += _linear(controller, memory.linear, gyro, current, own[1])
    for e in range(compensation.last.shape[0]):
        before, now = before_load, own[1]
        if compensation.motor_side[e]:
            before, now = before_motor, own[2]
        _ask(compensation, e, before, now, controller.period, 0.0, line)
        torque += compensation.last[e] + compensation.viscous[e] * now
    own[8] = torque

    if controller.closes_rate_loop:
        error = command - gyro
        own[0] += controller.integral * controller.period * error
        output = controller.proportional * error + own[0]
    else:
        output = command / controller.torque_per_current
    output += torque / controller.torque_per_current
    delayed = memory.outputs.shape[0]
    memory.outputs[sample % delayed] = output
    return float(memory.outputs[(sample + 1) % delayed])


@compiled
def _linear(
    controller: Controller, state: Array, gyro: float, current: float, relative: float
) -> float:
    m = state.shape[0]
    torque = 0.0
    new = np.empty(m)
    for i in range(m):
        torque += controller.c[i] * state[i]
        total = controller.b[i, 0] * gyro + controller.b[i, 2] * relative
        total += controller.b[i, 1] * controller.torque_per_current * current
        for j in range(m):
            total += controller.a[i, j] * state[j]
        new[i] = total
    state[:] = new
    return torque
