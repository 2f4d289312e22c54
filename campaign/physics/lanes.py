"""Trials made ready for the engine: one lane each, and several side by side."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from campaign.physics.base_motion import base_rate
from campaign.physics.bench import AngleSensor, Bench, CurrentSensor, RateSensor
from campaign.physics.blocks import (
    MOST_COLUMNS,
    UNROLLED,
    Controller,
    Elements,
    Memory,
    System,
)
from campaign.physics.compensation.interface import Compensator
from campaign.physics.friction import friction_models
from campaign.physics.friction.interface import FrictionOptions
from campaign.physics.grid import Grid, make_grid
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
from campaign.physics.rows import (
    ANSWERS,
    BASE_RATE,
    COMPENSATION,
    DRIVE,
    FRICTION,
    HAS,
    KEEPS,
    KEPT,
    MEETS,
    MEETS_PER_STEP,
    MEETS_RIPPLE,
    MEETS_STEP,
    RATE,
    RELATIVE_ANGLE,
)
from campaign.physics.step_function import ROOM_TEMPERATURE, Motion, address_of, single_step
from campaign.physics.variation import as_it_is
from campaign.signals import Zero
from campaign.trial import Task

AN_INSTANT = 1e-9
"""s; over it nothing moves, and differences are still numbers."""


@dataclass(frozen=True)
class Interface:
    """One friction model of one trial, as plant or as compensation."""

    step: Callable[..., Any]
    parameters: Array
    state_size: int
    torque: float
    rate: float
    viscous: float
    motor_side: bool
    ripple: tuple[float, float, float]

    @classmethod
    def of(cls, options: FrictionOptions, gain: float, bench: Bench) -> Interface:
        model = friction_models()[options.model]  # type: ignore[attr-defined]
        torque, rate = at_load(options, bench)
        ripple = options.ripple
        return cls(
            step=model.step if model.step_for is None else model.step_for(options),
            parameters=np.asarray(model.parameters(options), dtype=float),
            state_size=model.state_size(options),
            torque=torque * gain,
            rate=rate,
            viscous=gain * viscous_at_load(options, bench),
            motor_side=options.side == "motor",
            ripple=(ripple.amplitude, ripple.periods, ripple.phase),
        )

    def address(self, lanes: int) -> int:
        """Of its step function, compiled for so many lanes."""
        return address_of(self.step, lanes, len(self.parameters), self.state_size)

    @property
    def structure(self) -> Hashable:
        sizes = len(self.parameters), self.state_size
        return self.step, *sizes, self.motor_side, self.ripple[0] != 0.0


@dataclass(frozen=True)
class Lane:
    """A trial made ready: everything but its state.

    Attributes:
        f, g, h: the discretised loop; see `loop.discretise`.
        inputs: those that act on the loop, in the order of their signals.
    """

    bench: Bench
    task: Task
    seed: int
    grid: Grid
    compensator: Compensator
    loop: Loop
    f: Array
    g: Array
    h: Array
    inputs: tuple[int, ...]
    friction: tuple[Interface, ...]
    compensation: tuple[Interface, ...]

    @classmethod
    def of(cls, bench: Bench, task: Task, seed: int, longest_step: float | None = None) -> Lane:
        """Raises ValueError when the task's rates do not fit the bench's."""
        bench = as_it_is(bench, seed)
        grid = make_grid(bench, task, longest_step)
        compensator = make_compensator(bench, task.compensation)
        loop = _loop(bench, task, compensator, grid)
        f, g, h = discretise(loop.a, loop.b, grid.step)
        return cls(
            bench=bench,
            task=task,
            seed=seed,
            grid=grid,
            compensator=compensator,
            loop=loop,
            f=f,
            g=g,
            h=h,
            inputs=_inputs(task, grid),
            friction=tuple(Interface.of(each, 1.0, bench) for each in bench.friction.values()),
            compensation=tuple(Interface.of(*each, bench) for each in compensator.friction),
        )

    @property
    def prescribed(self) -> bool:
        """Whether there is no plant: the motion is what it is said to be."""
        return self.task.mode == "prescribed"

    @property
    def structure(self) -> Hashable:
        """Trials with equal structures can be simulated together."""
        grid, mode = self.grid, "plant" if self.grid.per_control else self.task.mode
        sensors = [(sensor.noise > 0.0, sensor.delay) for sensor in _sensors(self.bench)]
        block = self.compensator.linear
        sampled = (
            grid.per_control and self.task.mode,
            self.bench.controller.sample_rate,
            self.bench.controller.delay,
            *sensors,
        )
        return (
            mode,
            grid.step,
            grid.every,
            grid.per_control,
            len(self.f),
            self.inputs,
            self.loop.seen,
            0 if block is None else len(block.c),
            tuple(each.structure for each in self.friction),
            tuple(each.structure for each in self.compensation),
            sampled if grid.per_control else (),
        )


@dataclass(frozen=True)
class Lanes:
    """Trials side by side, with their state."""

    width: int
    trials: tuple[Lane, ...]
    system: System
    friction: Elements
    compensation: Elements
    controller: Controller
    memory: Memory
    random: tuple[np.random.Generator, ...]

    def signals(self, at: Array) -> Array:
        """The inputs over the step grid `at` (steps + 1,), shape (inputs, steps + 1, width)."""
        inputs = self.trials[0].inputs
        signals = np.zeros((len(inputs), len(at), self.width))
        for k, trial in enumerate(self.trials):
            for row, which in enumerate(inputs):
                signals[row, :, k] = _signal(trial.task, which, at)
        signals[:, :, len(self.trials) :] = signals[:, :, :1]
        return signals

    def noise(self, steps: int) -> Array:
        """Of the noisy sensors, in their units, shape (samples, sensors, width)."""
        every = self.controller.every
        samples = steps // every if every else 0
        sigmas = [_sigmas(trial) for trial in self.trials]
        noise = np.zeros((samples, len(sigmas[0]), self.width))
        if noise.size:
            for k, (random, sigma) in enumerate(zip(self.random, sigmas, strict=True)):
                noise[:, :, k] = random.standard_normal((samples, len(sigma))) * sigma
        return noise


def together(trials: Sequence[Lane], width: int) -> Lanes:
    """Trials of one structure side by side; lanes without a trial repeat the first one."""
    if not 0 < len(trials) <= width:
        raise ValueError(f"{len(trials)} trials cannot be simulated together, but 1 to {width}")
    lanes = [*trials, *[trials[0]] * (width - len(trials))]
    if any(trial.structure != trials[0].structure for trial in trials):
        raise ValueError("only trials of one structure can be simulated together")
    controller = _controller(lanes)
    return Lanes(
        width=width,
        trials=tuple(trials),
        system=_system(lanes),
        friction=_elements([lane.friction for lane in lanes], lanes, in_plant=True),
        compensation=_elements([lane.compensation for lane in lanes], lanes, in_plant=False),
        controller=controller,
        memory=_memory(lanes, controller),
        random=tuple(np.random.Generator(np.random.PCG64(trial.seed)) for trial in trials),
    )


def _by_lane(rows: Sequence[Any]) -> Array:
    """One array of each lane, with the lanes as the last axis."""
    return np.ascontiguousarray(np.stack([np.asarray(row, dtype=float) for row in rows], axis=-1))


def _loop(bench: Bench, task: Task, compensator: Compensator, grid: Grid) -> Loop:
    match task.mode:
        case "spring":
            return make_spring(bench, task.spring_stiffness)
        case "rate" | "torque" if grid.per_control == 0:
            return make_loop(bench, task.mode, compensator)
    return make_plant(bench)


def _inputs(task: Task, grid: Grid) -> tuple[int, ...]:
    """The inputs that act; a sampled controller reads the command, and it comes last."""
    if task.mode == "prescribed":
        return (DRIVE,)
    signals = {DRIVE: task.command, BASE_RATE: task.base_acceleration, FRICTION: task.disturbance}
    acting = tuple(which for which, signal in signals.items() if not isinstance(signal, Zero))
    if not grid.per_control:
        return acting
    return (*(which for which in acting if which != DRIVE), DRIVE)


def _signal(task: Task, which: int, at: Array) -> Array:
    if which == BASE_RATE:
        return base_rate(task.base_acceleration, at)
    return task.command.sample(at) if which == DRIVE else task.disturbance.sample(at)


def _system(lanes: Sequence[Lane]) -> System:
    first = lanes[0]
    plant = [which for which in first.inputs if not (which == DRIVE and first.grid.per_control)]
    columns = len(first.f) + 2 * len(plant) + (1 if first.grid.per_control else 0)
    padded = -(-columns // UNROLLED) * UNROLLED
    block = first.compensator.linear
    columns = max(columns, 0 if block is None else len(block.c))
    if max(padded, columns) > MOST_COLUMNS:
        raise ValueError(f"the loop has {columns} states and inputs; at most {MOST_COLUMNS} fit")
    acts = np.full(4, -1, dtype=np.int64)
    for row, which in enumerate(first.inputs):
        acts[which] = row
    return System(
        known=_by_lane([_known(lane, plant, padded) for lane in lanes]),
        plant_inputs=len(plant),
        by_friction=_by_lane([_torque_columns(lane, FRICTION) for lane in lanes]),
        by_compensation=_by_lane([_torque_columns(lane, COMPENSATION) for lane in lanes]),
        acts=acts,
        seen=first.loop.seen,
        low_pass=_by_lane([lane.bench.controller.relative_rate_filter for lane in lanes]),
        linear_x=_by_lane([lane.loop.linear_compensation[0] for lane in lanes]),
        linear_base=_by_lane([lane.loop.linear_compensation[1][BASE_RATE] for lane in lanes]),
        step=_by_lane([lane.grid.step for lane in lanes]),
    )


def _known(lane: Lane, plant: Sequence[int], columns: int) -> Array:
    """What follows in a step of the states, and of each input at its start and at its end."""
    # A disturbance drives the load forwards, friction holds it back: the same input, negative.
    signs = np.array([-1.0 if which == FRICTION else 1.0 for which in plant])
    at_start, at_end = (lane.g - lane.h)[:, list(plant)] * signs, lane.h[:, list(plant)] * signs
    held = lane.g[:, [DRIVE]] if lane.grid.per_control else np.zeros((len(lane.f), 0))
    known = np.hstack([lane.f, at_start, at_end, held])
    padding = np.zeros((len(lane.f), columns - known.shape[1]))
    return np.hstack([known, padding]).T


def _torque_columns(lane: Lane, which: int) -> Array:
    """What follows of a torque line: per N m of its mean, and of its change over the step."""
    return np.stack([lane.g[:, which], lane.h[:, which] - 0.5 * lane.g[:, which]])


def _elements(
    interfaces: Sequence[Sequence[Interface]], lanes: Sequence[Lane], *, in_plant: bool
) -> Elements:
    """`interfaces`: of each lane, in one order."""
    first, width = interfaces[0], len(lanes)
    count, sampled = len(first), lanes[0].grid.per_control > 0
    most = max((len(each.parameters) for each in first), default=0)
    fixed = np.zeros((count, HAS + most, width))
    states = max((each.state_size for each in first), default=0)
    kept, met = np.zeros((count, KEEPS + states, width)), np.zeros((2, MEETS, width))
    answer = np.zeros((ANSWERS, width))
    for k, (lane, own) in enumerate(zip(lanes, interfaces, strict=True)):
        step = _period(lane) if sampled and not in_plant else lane.grid.step
        met[:, MEETS_STEP, k], met[:, MEETS_PER_STEP, k] = step, 1.0 / step
        met[:, MEETS_RIPPLE, k] = 1.0
        for e, each in enumerate(own):
            fixed[e, :HAS, k] = (
                each.rate,
                each.torque,
                1.0 / each.torque if each.torque else 0.0,
                each.state_size > 0 or not in_plant,
                ROOM_TEMPERATURE,
                1.0,
            )
            fixed[e, HAS : HAS + len(each.parameters), k] = each.parameters
    ripples = [np.reshape([each.ripple for each in own], (count, 3)) for own in interfaces]
    return Elements(
        address=np.array([each.address(width) for each in first], dtype=np.uintp),
        fixed=fixed,
        fixed_at=_addresses(fixed),
        kept=kept,
        kept_at=_addresses(kept),
        met=met,
        met_at=_addresses(met),
        answer=answer,
        answer_at=answer.ctypes.data,
        viscous=_by_lane([[each.viscous for each in own] for own in interfaces]),
        motor_side=np.array(
            [each.motor_side and sampled and not in_plant for each in first], dtype=np.int64
        ),
        rippled=np.array([each.ripple[0] != 0.0 for each in first], dtype=np.int64),
        ripple=_by_lane(ripples),
    )


def _addresses(rows: Array) -> NDArray[np.uintp]:
    """Where each element's rows begin in memory, shape (elements,)."""
    return rows.ctypes.data + np.arange(len(rows), dtype=np.uintp) * np.uintp(rows.strides[0])


def _sensors(bench: Bench) -> tuple[RateSensor, AngleSensor, AngleSensor, CurrentSensor]:
    """In the order of `rows.SENSORS`."""
    sensors = bench.sensors
    return sensors.gyro, sensors.encoder, sensors.resolver, sensors.current


def _sigmas(lane: Lane) -> Array:
    """Standard deviations of the sensors that are noisy."""
    return np.array([sensor.noise for sensor in _sensors(lane.bench) if sensor.noise > 0.0])


def _controller(lanes: Sequence[Lane]) -> Controller:
    first = lanes[0]
    per_control, gains = first.grid.per_control, first.bench.controller
    period = _period(first)
    delay_steps = math.ceil(gains.delay / first.grid.step - 1e-9)
    sensors = _sensors(first.bench)
    noisy = np.cumsum([sensor.noise > 0.0 for sensor in sensors]) - 1
    blocks = [_discrete_block(lane) for lane in lanes]

    def each(value: Callable[[Lane], Any]) -> Array:
        return _by_lane([value(lane) for lane in lanes])

    return Controller(
        every=per_control,
        closes_rate_loop=first.task.mode == "rate",
        output_delay=delay_steps // per_control if per_control else 0,
        output_offset=delay_steps % per_control if per_control else 0,
        delay=np.array([round(sensor.delay / period) for sensor in sensors], dtype=np.int64),
        noisy=np.where([sensor.noise > 0.0 for sensor in sensors], noisy, -1).astype(np.int64),
        period=each(_period),
        proportional=each(lambda lane: lane.bench.controller.rate.proportional),
        integral=each(lambda lane: lane.bench.controller.rate.integral_gain),
        torque_per_current=each(lambda lane: lane.bench.torque_per_current),
        ratio=each(lambda lane: lane.bench.gear.ratio),
        filter_pole=each(_filter_pole),
        pointing_pole=each(
            lambda lane: math.exp(
                -2.0 * math.pi * lane.bench.controller.pointing_high_pass * _period(lane)
            )
        ),
        resolution=each(lambda lane: [sensor.resolution for sensor in _sensors(lane.bench)]),
        a=_by_lane([block[0] for block in blocks]),
        b=_by_lane([block[1] for block in blocks]),
        c=_by_lane([block[2] for block in blocks]),
        d=_by_lane([block[3] for block in blocks]),
    )


def _period(lane: Lane) -> float:
    rate = lane.bench.controller.sample_rate
    return 1.0 / rate if rate else 1.0


def _filter_pole(lane: Lane) -> float:
    low_pass = lane.bench.controller.relative_rate_filter
    return math.exp(-_period(lane) / low_pass) if low_pass > 0.0 else 0.0


def _discrete_block(lane: Lane) -> tuple[Array, Array, Array, Array]:
    """The linear compensation of a sampled controller, which holds its readings over a sample."""
    block = lane.compensator.linear
    if block is None or not lane.grid.per_control:
        return np.zeros((0, 0)), np.zeros((0, 3)), np.zeros(0), np.zeros(3)
    a, b, _ = discretise(block.a, block.b, _period(lane))
    return a, b, block.c, block.d


def _memory(lanes: Sequence[Lane], controller: Controller) -> Memory:
    width, states = len(lanes), len(lanes[0].f)
    x = np.zeros((states, width))
    x[RATE if lanes[0].prescribed else RELATIVE_ANGLE] = [lane.task.start_angle for lane in lanes]
    ended = np.zeros((2, width))
    for k, lane in enumerate(lanes):
        ended[:, k] = _torques_at_start(lane)
    return Memory(
        x=x,
        kept=np.zeros((KEPT, width)),
        linear=np.zeros((len(controller.c), width)),
        readings=np.zeros((4, int(controller.delay.max()) + 1, width)),
        outputs=np.zeros((controller.output_delay + 1, width)),
        held=np.zeros((2, width)),
        ended=ended,
        counters=np.zeros(2, dtype=np.int64),
    )


def _torques_at_start(lane: Lane) -> tuple[float, float]:
    """Friction and continuous compensation when the trial begins (N m), their linear part apart.

    The load is at rest in space, with undeflected bristles, and the hull may be under way: what the
    models say of so short a time that nothing moves. NaN where a model of the plant has no state:
    what it takes follows from what is applied.
    """
    hull = float(_signal(lane.task, BASE_RATE, np.zeros(1))[0])
    rate = float(_signal(lane.task, DRIVE, np.zeros(1))[0]) if lane.prescribed else -hull
    filtered = lane.loop.seen != RATE and not lane.prescribed
    yields = not lane.prescribed and any(each.state_size == 0 for each in lane.friction)
    return (
        math.nan
        if yields
        else sum(_torque_at(each, rate, lane.task.start_angle) for each in lane.friction),
        sum(
            _torque_at(each, 0.0 if filtered else rate, lane.task.start_angle)
            for each in lane.compensation
        ),
    )


def _torque_at(interface: Interface, rate: float, angle: float) -> float:
    amplitude, periods, phase = interface.ripple
    motion = Motion.at(rate * interface.rate, rate * interface.rate, AN_INSTANT, position=angle)
    state = np.zeros(interface.state_size)
    mean, _ = single_step(interface.step, interface.parameters, state, motion)
    return mean * interface.torque * (1.0 + amplitude * math.sin(periods * angle + phase))
