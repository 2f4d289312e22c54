"""Simulating one task on one bench, block by block, so that memory stays flat at any length."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from campaign.physics.base_motion import base_rate
from campaign.physics.bench import AngleSensor, Bench, CurrentSensor, RateSensor
from campaign.physics.compensation.interface import Compensator
from campaign.physics.engine import Controller, Elements, Memory, System, advance, drive
from campaign.physics.friction import friction_models
from campaign.physics.friction.interface import FrictionOptions
from campaign.physics.loop import (
    Array,
    Loop,
    at_load,
    discretise,
    make_compensator,
    make_loop,
    make_plant,
    make_spring,
    viscous_at_load,
)
from campaign.physics.step_function import address_of
from campaign.physics.variation import as_it_is
from campaign.signals import MultiSine, Sine
from campaign.trial import Task

LONGEST_STEP = 0.25e-3
"""s; the LuGre-compensated stabilization error, the most sensitive number, is then 0.12 % off."""
LONGEST_SAMPLED_STEP = 1e-3
"""s; between the samples of a controller nothing is that sensitive: errors of 1e-4 at most."""
FINEST_DELAY = 4
"""How many times finer the steps may become to meet the controller's delay."""
STEPS_PER_CYCLE = 80
"""of the fastest sine; at 80 a straight-line input loses 5e-4 of its amplitude."""
BLOCK_STEPS = 20_000


@dataclass(frozen=True)
class Grid:
    """The time grid of a simulation.

    Attributes:
        step: integration step (s).
        every: steps per recorded sample.
        per_control: steps per controller sample; 0 for a continuous controller.
        samples: recorded samples in all.
    """

    step: float
    every: int
    per_control: int
    samples: int


def make_grid(bench: Bench, task: Task, longest_step: float | None = None) -> Grid:
    """Steps that divide both the recording's and the controller's sample time.

    `longest_step` (s) is LONGEST_STEP, or LONGEST_SAMPLED_STEP with a sampled controller, when
    None. Raises ValueError when the recording's rate and the controller's do not divide each other.
    """
    control_rate = bench.controller.sample_rate
    continuous = control_rate is None or task.mode in ("prescribed", "spring")
    if longest_step is None:
        longest_step = LONGEST_STEP if continuous else LONGEST_SAMPLED_STEP
    # A sampled controller holds its command between samples: the steps need not resolve it.
    smooth = (task.base_acceleration, task.disturbance)
    for signal in (*smooth, task.command) if continuous else smooth:
        if isinstance(signal, Sine | MultiSine):
            fastest = signal.frequency if isinstance(signal, Sine) else max(signal.frequencies)
            longest_step = min(longest_step, 1.0 / (STEPS_PER_CYCLE * fastest))
    samples = max(1, math.floor(task.duration * task.sample_rate + 1e-9))
    if control_rate is None or continuous:
        every = max(1, math.ceil(1.0 / (task.sample_rate * longest_step) - 1e-9))
        return Grid(1.0 / (task.sample_rate * every), every, 0, samples)
    per_record = control_rate / task.sample_rate
    if abs(per_record - round(per_record)) > 1e-6 or round(per_record) < 1:
        raise ValueError(
            f"the controller's sample rate ({control_rate:g} Hz) must be a whole multiple of the "
            f"recording's ({task.sample_rate:g} Hz)"
        )
    per_control = max(1, math.ceil(1.0 / (control_rate * longest_step) - 1e-9))
    per_control = _with_delay(per_control, bench.controller.delay * control_rate)
    step = 1.0 / (control_rate * per_control)
    return Grid(step, per_control * round(per_record), per_control, samples)


def _with_delay(per_control: int, delay: float) -> int:
    """More steps per sample, a few times over, if a `delay` (samples) then is whole steps."""
    for times in range(1, FINEST_DELAY + 1):
        steps = delay * per_control * times
        if abs(steps - round(steps)) < 1e-6:
            return per_control * times
    return per_control * FINEST_DELAY


def simulate(
    bench: Bench, task: Task, seed: int, longest_step: float | None = None
) -> Iterator[tuple[Array, Array]]:
    """Blocks of (time (n,), outputs (8, n) with rows as `engine.OUTPUTS`) until the task ends."""
    bench = as_it_is(bench, seed)
    grid = make_grid(bench, task, longest_step)
    compensator = make_compensator(bench, task.compensation)
    friction = _elements([(item, 1.0) for item in bench.friction.values()], bench)
    compensation = _elements(compensator.friction, bench)
    samples_per_block = max(1, BLOCK_STEPS // grid.every)
    advance_block = _advancer(bench, task, compensator, grid, friction, compensation, seed)
    for first in range(0, grid.samples, samples_per_block):
        count = min(samples_per_block, grid.samples - first)
        at: Array = (first * grid.every + np.arange(count * grid.every + 1.0)) * grid.step
        out = np.empty((8, count))
        advance_block(at, out)
        # n / rate, not n steps: whoever knows the rate has the same times to the bit.
        yield (first + np.arange(count)) / task.sample_rate, out


def _advancer(
    bench: Bench,
    task: Task,
    compensator: Compensator,
    grid: Grid,
    friction: Elements,
    compensation: Elements,
    seed: int,
) -> Callable[[Array, Array], None]:
    """What advances over the step grid `at` (steps + 1,) and fills `out`; it keeps the state."""
    loop = _loop(bench, task, compensator, grid)
    f, g, h = discretise(loop.a, loop.b, grid.step)
    system = System(f, g, h, *loop.relative_rate, *loop.linear_compensation, grid.step)
    controller = _controller(bench, task, compensator, grid)
    memory = _memory(len(f), controller)
    random = np.random.Generator(np.random.PCG64(seed))
    sigmas = np.array([sensor.noise for sensor in _sensors(bench)])

    if task.mode == "prescribed":
        memory.x[0] = task.start_angle

        def prescribe(at: Array, out: Array) -> None:
            rate = task.command.sample(at)
            drive(friction, compensation, memory, rate, grid.step, grid.every, out)

        return prescribe

    memory.x[2] = task.start_angle

    def simulate_block(at: Array, out: Array) -> None:
        readings = (len(at) - 1) // grid.per_control if grid.per_control else 1
        noise = random.standard_normal((readings, 4)) * sigmas
        command, base = task.command.sample(at), base_rate(task.base_acceleration, at)
        disturbance = task.disturbance.sample(at)
        advance(
            system, friction, compensation, controller, memory,
            command, base, disturbance, noise, grid.every, out,
        )  # fmt: skip

    return simulate_block


def _loop(bench: Bench, task: Task, compensator: Compensator, grid: Grid) -> Loop:
    match task.mode:
        case "spring":
            return make_spring(bench, task.spring_stiffness)
        case "rate" | "torque" if grid.per_control == 0:
            return make_loop(bench, task.mode, compensator)
    return make_plant(bench)


def _elements(items: Sequence[tuple[FrictionOptions, float]], bench: Bench) -> Elements:
    models = [friction_models()[options.model] for options, _ in items]  # type: ignore[attr-defined]
    rows = [model.parameters(options) for model, (options, _) in zip(models, items, strict=True)]
    parameters = np.zeros((len(items), max((len(row) for row in rows), default=1)))
    for row, values in zip(parameters, rows, strict=True):
        row[: len(values)] = values
    state = np.zeros((len(items), max((m.state_size for m in models), default=0) or 1))
    sides = [at_load(options, bench) for options, _ in items]
    return Elements(
        address=np.array([address_of(model.step) for model in models], dtype=np.uintp),
        parameters=parameters,
        state=state,
        parameters_at=_row_addresses(parameters),
        state_at=_row_addresses(state),
        torque=np.array([t * gain for (t, _), (_, gain) in zip(sides, items, strict=True)]),
        rate=np.array([rate for _, rate in sides]),
        viscous=np.array([gain * viscous_at_load(o, bench) for o, gain in items]),
        motor_side=np.array([o.side == "motor" for o, _ in items], dtype=np.bool_),
        last=np.zeros(len(items)),
        stateless=np.array([model.state_size == 0 for model in models], dtype=np.bool_),
        ripple=np.array(
            [(o.ripple.amplitude, o.ripple.periods, o.ripple.phase) for o, _ in items]
        ).reshape(-1, 3),
    )


def _row_addresses(rows: Array) -> NDArray[np.uintp]:
    """Where each row of a C-ordered array begins in memory, shape (rows,)."""
    return rows.ctypes.data + np.arange(len(rows), dtype=np.uintp) * np.uintp(rows.strides[0])


def _sensors(bench: Bench) -> tuple[RateSensor, AngleSensor, AngleSensor, CurrentSensor]:
    sensors = bench.sensors
    return sensors.gyro, sensors.encoder, sensors.resolver, sensors.current


def _controller(bench: Bench, task: Task, compensator: Compensator, grid: Grid) -> Controller:
    gains = bench.controller
    period = 1.0 / gains.sample_rate if gains.sample_rate else 1.0
    order = 0 if compensator.linear is None or not grid.per_control else len(compensator.linear.c)
    a, b, c, d = np.zeros((order, order)), np.zeros((order, 3)), np.zeros(order), np.zeros(3)
    if order and compensator.linear is not None:
        # The compensation holds its readings over a sample: the exact discrete equivalent.
        a, b, _ = discretise(compensator.linear.a, compensator.linear.b, period)
        c, d = compensator.linear.c, compensator.linear.d
    delay_steps = math.ceil(gains.delay / grid.step - 1e-9)
    low_pass = gains.relative_rate_filter
    sensors = _sensors(bench)
    return Controller(
        every=grid.per_control,
        period=period,
        closes_rate_loop=task.mode == "rate",
        proportional=gains.rate.proportional,
        integral=gains.rate.integral_gain,
        torque_per_current=bench.torque_per_current,
        ratio=bench.gear.ratio,
        filter_pole=math.exp(-period / low_pass) if low_pass > 0.0 else 0.0,
        pointing_pole=math.exp(-2.0 * math.pi * gains.pointing_high_pass * period),
        resolution=np.array([sensor.resolution for sensor in sensors]),
        delay=np.array([round(sensor.delay / period) for sensor in sensors], dtype=np.int64),
        output_delay=delay_steps // grid.per_control if grid.per_control else 0,
        output_offset=delay_steps % grid.per_control if grid.per_control else 0,
        a=np.ascontiguousarray(a),
        b=np.ascontiguousarray(b),
        c=np.ascontiguousarray(c),
        d=d,
    )


def _memory(order: int, controller: Controller) -> Memory:
    return Memory(
        x=np.zeros(order),
        controller=np.zeros(10),
        linear=np.zeros(len(controller.c)),
        readings=np.zeros((4, int(controller.delay.max()) + 1)),
        outputs=np.zeros(controller.output_delay + 1),
        held=np.zeros(2),
        counters=np.zeros(2, dtype=np.int64),
    )
