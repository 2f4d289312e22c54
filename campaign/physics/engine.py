"""The engine: advances loop, friction and controller step by step in compiled code.

Scheme: everything linear is exact (`campaign.physics.loop.discretise`). Each friction model is
asked once per step for its torque as a straight line over the step, from the relative rate at the
start and the rate expected at the end; that line is then an input of the linear part. The result
is of second order in the step for friction with a state, and stable for any bristle stiffness.

The engine knows no friction model, compensation or controller form by name. It is compiled once:
friction models come as addresses of compiled step functions, everything else as numbers.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from campaign.physics.compiled import compiled, inlined
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
    parameters_at: NDArray[np.uintp]  # (k,) where each row of `parameters` begins
    state_at: NDArray[np.uintp]  # (k,) where each row of `state` begins
    torque: Array  # (k,) what one N m counts at the load, gain included
    rate: Array  # (k,) model's rate per relative rate of the load
    viscous: Array  # (k,) the linear part (N m s/rad at the load), gain included
    motor_side: NDArray[np.bool_]  # (k,) reads the resolver rather than the encoder
    last: Array  # (k,) torque at the end of the last step; in place
    stateless: NDArray[np.bool_]  # (k,)
    ripple: Array  # (k, 3) amplitude, periods, phase: torque over the angle of the load


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
    pointing_pole: float  # of the pointing error's high-pass, 1 for none
    resolution: Array  # (4,) of the sensors, 0 for none
    delay: NDArray[np.int64]  # (4,) samples
    output_delay: int  # whole samples ...
    output_offset: int  # ... and steps beyond them
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
    held: Array  # (2,) current command that is next, and that is in force (A)
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
    disturbance: Array,
    noise: Array,
    every: int,
    out: Array,
) -> None:
    """Advance over one block and record every `every`-th step.

    command, base_rate, disturbance: (steps + 1,) at the step grid.
    noise: (samples, 4), in sensor units.
    out: (8, steps / every), rows as OUTPUTS; the sample at the start of each `every` steps.
    """
    n = system.f.shape[0]
    new = np.empty(n)
    u, du, line = np.zeros(4), np.zeros(4), np.zeros(2)
    ask, rub = np.zeros(3), np.zeros(3)  # mean, change over the step, value at its start
    sampled = controller.every > 0
    samples = 0
    for k in range(command.shape[0] - 1):
        if not sampled:
            u[0] = command[k]
            du[0] = command[k + 1] - command[k]
        else:
            place = memory.counters[0] % controller.every
            if place == 0:
                memory.held[0] = _sample(
                    controller, compensation, memory, command[k], noise[samples], line
                )
                samples += 1
            if place == controller.output_offset:
                memory.held[1] = memory.held[0]
            u[0] = memory.held[1]
        memory.counters[0] += 1
        u[1] = base_rate[k]
        du[1] = base_rate[k + 1] - base_rate[k]
        # A disturbance drives the load forwards, friction holds it back: the same input, negative.
        u[2] = -disturbance[k]
        du[2] = disturbance[k] - disturbance[k + 1]
        _step_linear(system, memory.x, u, du, new)

        seen = 0.0
        if not sampled:
            seen = _compensate(system, friction, compensation, memory.x, new, u, du, line, ask)
        _rub(system, friction, memory.x, new, base_rate[k], base_rate[k + 1], ask, line, rub)

        if (memory.counters[0] - 1) % every == 0:
            column = out[:, k // every]
            _record(column, system, controller, memory, u, seen)
            column[5] += ask[2]
            column[6] = rub[2]
        rub_start, ask_start = rub[0] - 0.5 * rub[1], ask[0] - 0.5 * ask[1]
        for i in range(n):
            memory.x[i] = (
                new[i]
                + system.g[i, 2] * rub_start
                + system.h[i, 2] * rub[1]
                + system.g[i, 3] * ask_start
                + system.h[i, 3] * ask[1]
            )


@inlined
def _step_linear(system: System, x: Array, u: Array, du: Array, new: Array) -> None:
    """The step without friction and without friction-model compensation."""
    n = x.shape[0]
    for i in range(n):
        total = 0.0
        for j in range(3):
            total += system.g[i, j] * u[j] + system.h[i, j] * du[j]
        for j in range(n):
            total += system.f[i, j] * x[j]
        new[i] = total


@inlined
def _compensate(
    system: System,
    friction: Elements,
    compensation: Elements,
    x: Array,
    new: Array,
    u: Array,
    du: Array,
    line: Array,
    ask: Array,
) -> float:
    """Ask continuous compensation for its torque; return the relative rate it sees now."""
    seen = system.relative_u[1] * u[1]
    expected = system.relative_u[1] * (u[1] + du[1])
    per_friction, per_compensation = 0.0, 0.0
    for i in range(x.shape[0]):
        seen += system.relative_x[i] * x[i]
        expected += system.relative_x[i] * new[i]
        per_friction += system.relative_x[i] * system.g[i, 2]
        per_compensation += system.relative_x[i] * system.g[i, 3]
    # What it expects to see at the end of the step if all torques stay as they are.
    for e in range(friction.last.shape[0]):
        expected += per_friction * friction.last[e]
    for e in range(compensation.last.shape[0]):
        expected += per_compensation * compensation.last[e]
    ask[:] = 0.0
    for e in range(compensation.last.shape[0]):
        _ask(compensation, e, x[2], seen, expected, system.step, 0.0, line)
        ask[0] += line[0]
        ask[1] += line[1]
        ask[2] += line[0] - 0.5 * line[1] + compensation.viscous[e] * seen
    return float(seen)


@inlined
def _rub(
    system: System,
    friction: Elements,
    x: Array,
    new: Array,
    base_before: float,
    base_after: float,
    ask: Array,
    line: Array,
    rub: Array,
) -> None:
    """Ask friction for its torque, from the rate expected if its torque stays as it is."""
    v0 = x[0] - base_before
    v1 = new[0] - base_after
    v1 += system.g[0, 3] * (ask[0] - 0.5 * ask[1]) + system.h[0, 3] * ask[1]
    compliance = -system.g[0, 2]
    for e in range(friction.last.shape[0]):
        v1 -= compliance * friction.last[e]
    rub[:] = 0.0
    for e in range(friction.last.shape[0]):
        _ask(friction, e, x[2], v0, v1, system.step, compliance, line)
        if friction.stateless[e]:
            # What one dry friction takes is no longer there for the next to stop.
            v1 -= compliance * line[0]
            friction.last[e] = 0.0
        rub[0] += line[0]
        rub[1] += line[1]
        rub[2] += line[0] - 0.5 * line[1] + friction.viscous[e] * v0


@inlined
def _ask(
    elements: Elements,
    e: int,
    angle: float,
    v0: float,
    v1: float,
    step: float,
    compliance: float,
    line: Array,
) -> None:
    """Torque line of one element at the load; also kept as its last torque."""
    torque, rate = elements.torque[e], elements.rate[e]
    if elements.ripple[e, 0] != 0.0:
        torque *= 1.0 + elements.ripple[e, 0] * np.sin(
            elements.ripple[e, 1] * angle + elements.ripple[e, 2]
        )
    line[0] = 0.0
    line[1] = 0.0
    call_step(
        elements.address[e],
        elements.parameters_at[e],
        elements.state_at[e],
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
    """One sample of the controller: read the sensors, return the current command that is next."""
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
        own[5] *= controller.pointing_pole
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
        _ask(compensation, e, encoder, before, now, controller.period, 0.0, line)
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


@inlined
def _rub_at(
    elements: Elements,
    memory: Memory,
    e: int,
    angle: float,
    v0: float,
    v1: float,
    step: float,
    line: Array,
) -> float:
    """Advance one element over a step at a prescribed rate; its torque where the step begins."""
    before = elements.last[e]
    _ask(elements, e, angle, v0, v1, step, 0.0, line)
    after = line[0] - 0.5 * line[1]
    if memory.counters[0] == 0:
        before = after
    return float(0.5 * (before + after) + elements.viscous[e] * v0)


@compiled
def drive(
    friction: Elements,
    compensation: Elements,
    memory: Memory,
    rate: Array,
    step: float,
    every: int,
    out: Array,
) -> None:
    """Move friction and compensation at a prescribed relative rate, without plant or motor.

    rate: (steps + 1,) rad/s at the step grid.   out: (8, steps / every), rows as OUTPUTS; both
    rates are the prescribed one and there is no current. The torque recorded at an instant is the
    mean of the lines that end and begin there, so that it lags the rate by nothing.
    """
    line = np.zeros(2)
    for k in range(rate.shape[0] - 1):
        angle = memory.x[0]
        friction_now, compensation_now = 0.0, 0.0
        for e in range(friction.last.shape[0]):
            friction_now += _rub_at(friction, memory, e, angle, rate[k], rate[k + 1], step, line)
        for e in range(compensation.last.shape[0]):
            compensation_now += _rub_at(
                compensation, memory, e, angle, rate[k], rate[k + 1], step, line
            )
        memory.counters[0] += 1
        if k % every == 0:
            column = k // every
            out[:, column] = 0.0
            out[0, column] = rate[k]
            out[1, column] = rate[k]
            out[2, column] = angle
            out[4, column] = angle
            out[5, column] = compensation_now
            out[6, column] = friction_now
            out[7, column] = rate[k]
        memory.x[0] += 0.5 * step * (rate[k] + rate[k + 1])
