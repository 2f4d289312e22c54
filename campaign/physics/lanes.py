"""Trials prepared for the engine: one lane per trial, several in parallel."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from campaign.arrays import Array
from campaign.physics.base_motion import base_rate
from campaign.physics.blocks import Controller, Elements, Memory, System, by_lane, zeros
from campaign.physics.compensation.interface import Compensator
from campaign.physics.complete import CompleteBench
from campaign.physics.friction import jumps
from campaign.physics.friction_elements import (
    Interface,
    compensation_elements,
    plant_elements,
    torque_at,
)
from campaign.physics.grid import Grid, make_grid
from campaign.physics.loop import (
    Loop,
    discretise,
    make_compensator,
    make_loop,
    make_plant,
    make_spring,
)
from campaign.physics.rows import (
    BASE_RATE,
    COMPENSATION,
    DRIVE,
    FRICTION,
    KEPT,
    RATE,
    RELATIVE_ANGLE,
)
from campaign.physics.variation import as_it_is
from campaign.physics.vector import COLUMNS, MOST_COLUMNS, ROWS
from campaign.signals import Signal, Zero
from campaign.trial import Task

AT_REST = 1e-12
"""rad/s; a hull rate below it is rounding error, and not sliding."""


@dataclass(frozen=True)
class Lane:
    """A trial prepared for the engine, without its state.

    Attributes:
        bench: the simulated bench, with the scatter of this trial.
        stated: source of the numbers in the controller's software: N, Kt, and the design values of
            compensation. It is the same bench, unless the simulation has a separate truth.
        inputs: inputs that act on the loop, in the order of their signals.
    """

    bench: CompleteBench
    stated: CompleteBench
    task: Task
    seed: int
    grid: Grid
    compensator: Compensator
    loop: Loop
    inputs: tuple[int, ...]
    friction: tuple[Interface, ...]
    compensation: tuple[Interface, ...]

    @classmethod
    def of(
        cls,
        bench: CompleteBench,
        task: Task,
        seed: int,
        longest_step: float | None = None,
        stated: CompleteBench | None = None,
    ) -> Lane:
        """Prepare a trial. Raises ValueError if the task's and the bench's rates do not match.

        `stated`: see the attribute; None for `bench`.
        """
        stated = stated or bench
        bench = as_it_is(bench, seed)
        grid = make_grid(bench, task, longest_step)
        compensator = make_compensator(stated, task.compensation)
        loop = _loop(bench, task, compensator, grid, stated)
        moves = task.mode != "prescribed"
        solved, asked_over = moves and not grid.per_control, grid.step * max(1, grid.per_control)
        return cls(
            bench=bench,
            stated=stated,
            task=task,
            seed=seed,
            grid=grid,
            compensator=compensator,
            loop=loop,
            inputs=_inputs(task, grid),
            friction=_plant(bench, grid.step, moves=moves),
            compensation=tuple(
                Interface.of(each, gain, bench, solved and jumps(each), asked_over)
                for each, gain in compensator.friction
            ),
        )

    def with_seed(self, seed: int) -> Lane:
        """The same trial with another seed, on a bench whose friction no seed changes."""
        lane = copy(self)  # with what was computed at first use
        vars(lane)["seed"] = seed
        return lane

    @cached_property
    def discrete(self) -> tuple[Array, Array, Array]:
        """The discretised loop F, G, H; see `loop.discretise`.

        Computed at first use: a plan needs only the step and the structure.
        """
        return discretise(self.loop.a, self.loop.b, self.grid.step)

    @property
    def states(self) -> int:
        """Number of states of the loop."""
        return len(self.loop.a)

    @property
    def prescribed(self) -> bool:
        """Whether the motion is prescribed: there is no plant."""
        return self.task.mode == "prescribed"

    @property
    def structure(self) -> Hashable:
        """Key of the trials that can be simulated together."""
        grid, mode = self.grid, "plant" if self.grid.per_control else self.task.mode
        sensors = [(sensor.noise > 0.0, sensor.delay) for sensor in self.bench.sensors.in_order]
        block = self.compensator.linear
        sampled = (
            grid.per_control and self.task.mode,
            self.bench.controller.sample_rate,
            self.bench.controller.delay,
            self.bench.rate_is_of_encoder,
            *sensors,
        )
        return (
            mode,
            grid.step,
            grid.every,
            grid.per_control,
            self.states,
            self.inputs,
            self.loop.seen,
            0 if block is None else len(block.c),
            tuple(each.structure for each in self.friction),
            tuple(each.structure for each in self.compensation),
            sampled if grid.per_control else (),
        )


@dataclass(frozen=True)
class Lanes:
    """Parallel trials with their state."""

    width: int
    trials: tuple[Lane, ...]
    system: System
    friction: Elements
    compensation: Elements
    controller: Controller
    memory: Memory
    random: tuple[np.random.Generator, ...]

    def with_friction_at_rest(self, friction: Mapping[str, Any]) -> Lanes:
        """A single prescribed motion before its first step, with other friction."""
        (trial,) = self.trials
        bench = as_it_is(trial.bench.with_friction(friction), trial.seed)
        lane = replace(trial, bench=bench, friction=_plant(bench, trial.grid.step, moves=False))
        return replace(
            self,
            trials=(lane,),
            friction=plant_elements([lane.friction], [lane.grid.step], [_rate_at_start(lane)]),
            memory=_memory([lane], self.controller),
        )

    def signals(self, at: Array) -> Array:
        """Inputs over the step grid `at` (steps + 1,), shape (inputs, steps + 1, width)."""
        inputs = self.trials[0].inputs
        signals = zeros(len(inputs), len(at), self.width)
        for row, which in enumerate(inputs):
            own = sampled([trial.task for trial in self.trials], which, at)
            signals[row] = own[0][:, None]
            for k, samples in enumerate(own):
                if samples is not own[0]:
                    signals[row, :, k] = samples
        return signals

    def noise(self, steps: int) -> Array:
        """Noise of the noisy sensors, in their units, shape (samples, sensors, width)."""
        every = self.controller.every
        samples = steps // every if every else 0
        sigmas = [_sigmas(trial) for trial in self.trials]
        noise = zeros(samples, len(sigmas[0]), self.width)
        if noise.size:
            for k, (random, sigma) in enumerate(zip(self.random, sigmas, strict=True)):
                noise[:, :, k] = random.standard_normal((samples, len(sigma))) * sigma
        return noise


def together(trials: Sequence[Lane], width: int) -> Lanes:
    """Join trials of one structure; lanes without a trial repeat the first one."""
    if not 0 < len(trials) <= width:
        raise ValueError(f"{len(trials)} trials cannot be simulated together, but 1 to {width}")
    lanes = [*trials, *[trials[0]] * (width - len(trials))]
    if any(trial.structure != trials[0].structure for trial in trials):
        raise ValueError("only trials of one structure can be simulated together")
    controller = _controller(lanes)
    steps, rates = [lane.grid.step for lane in lanes], [_rate_at_start(lane) for lane in lanes]
    return Lanes(
        width=width,
        trials=tuple(trials),
        system=_system(lanes),
        friction=plant_elements([lane.friction for lane in lanes], steps, rates),
        compensation=compensation_elements(
            [lane.compensation for lane in lanes], steps, reads_sensors=controller.every > 0
        ),
        controller=controller,
        memory=_memory(lanes, controller),
        random=tuple(np.random.Generator(np.random.PCG64(trial.seed)) for trial in trials),
    )


def _plant(bench: CompleteBench, step: float, *, moves: bool) -> tuple[Interface, ...]:
    """Friction of a bench; `moves`: there is a plant, so the engine solves for dry friction."""
    return tuple(Interface.of(each, 1.0, bench, moves, step) for each in bench.friction.values())


def _loop(
    bench: CompleteBench, task: Task, compensator: Compensator, grid: Grid, stated: CompleteBench
) -> Loop:
    match task.mode:
        case "spring":
            return make_spring(bench, task.spring_stiffness)
        case "rate" | "torque" if grid.per_control == 0:
            return make_loop(bench, task.mode, compensator, stated)
    return make_plant(bench)


def _inputs(task: Task, grid: Grid) -> tuple[int, ...]:
    """Active inputs; the command comes last if a sampled controller reads it."""
    if task.mode == "prescribed":
        return (DRIVE,)
    order = (DRIVE, BASE_RATE, FRICTION)
    acting = tuple(which for which in order if not isinstance(_acting(task, which), Zero))
    if not grid.per_control:
        return acting
    return (*(which for which in acting if which != DRIVE), DRIVE)


def _acting(task: Task, which: int) -> Signal:
    return {DRIVE: task.command, BASE_RATE: task.base_acceleration, FRICTION: task.disturbance}[
        which
    ]


def sampled(tasks: Sequence[Task], which: int, at: Array) -> list[Array]:
    """Samples of an input at times `at` (s) for each task; a shared signal is sampled once."""
    known: list[tuple[Signal, Array]] = []
    inputs = []
    for task in tasks:
        signal = _acting(task, which)
        samples = next((values for each, values in known if each == signal), None)
        if samples is None:
            samples = _signal(task, which, at)
            known.append((signal, samples))
        inputs.append(samples)
    return inputs


def _signal(task: Task, which: int, at: Array) -> Array:
    if which == BASE_RATE:
        return base_rate(task.base_acceleration, at)
    return task.command.sample(at) if which == DRIVE else task.disturbance.sample(at)


def _system(lanes: Sequence[Lane]) -> System:
    first = lanes[0]
    plant = [which for which in first.inputs if not (which == DRIVE and first.grid.per_control)]
    columns = first.states + 2 * len(plant) + (1 if first.grid.per_control else 0)
    padded = -(-columns // COLUMNS) * COLUMNS
    block = first.compensator.linear
    columns = max(columns, 0 if block is None else len(block.c))
    if max(padded, columns) > MOST_COLUMNS:
        raise ValueError(f"the loop has {columns} states and inputs; at most {MOST_COLUMNS} fit")
    acts = np.full(4, -1, dtype=np.int64)
    for row, which in enumerate(first.inputs):
        acts[which] = row
    rows = first.states if len(lanes) > 1 else -(-first.states // ROWS) * ROWS
    by_friction = by_lane([_torque_columns(lane, FRICTION, rows) for lane in lanes])
    by_compensation = by_lane([_torque_columns(lane, COMPENSATION, rows) for lane in lanes])
    return System(
        known=by_lane([_known(lane, plant, padded, rows) for lane in lanes]),
        plant_inputs=len(plant),
        by_friction=by_friction,
        by_compensation=by_compensation,
        friction_rows=by_friction,
        compensation_rows=by_compensation,
        acts=acts,
        seen=first.loop.seen,
        low_pass=by_lane([lane.bench.controller.relative_rate_filter for lane in lanes]),
        linear_x=by_lane([lane.loop.linear_compensation[0] for lane in lanes]),
        linear_base=by_lane([lane.loop.linear_compensation[1][BASE_RATE] for lane in lanes]),
        step=by_lane([lane.grid.step for lane in lanes]),
    )


def _known(lane: Lane, plant: Sequence[int], columns: int, rows: int) -> Array:
    """Effect of the states, and of each input at the start and the end, in a step.

    Transposed, and padded with zeros: shape (columns / COLUMNS, COLUMNS, rows).
    """
    # A disturbance accelerates the load, friction decelerates it: the same input, negative.
    signs = np.array([-1.0 if which == FRICTION else 1.0 for which in plant])
    f, g, h = lane.discrete
    at_start, at_end = (g - h)[:, list(plant)] * signs, h[:, list(plant)] * signs
    held = g[:, [DRIVE]] if lane.grid.per_control else np.zeros((lane.states, 0))
    known = np.hstack([f, at_start, at_end, held])
    return _filled_up(known.T, (columns, rows)).reshape(-1, COLUMNS, rows)


def _torque_columns(lane: Lane, which: int, rows: int) -> Array:
    """Effect of a torque line: per N m of its mean, and of its change over the step."""
    _, g, h = lane.discrete
    columns = np.stack([g[:, which], h[:, which] - 0.5 * g[:, which]])
    return _filled_up(columns, (2, rows))


def _filled_up(array: Array, shape: tuple[int, int]) -> Array:
    """Pad an array with zeros to a shape."""
    padded = np.zeros(shape)
    padded[: array.shape[0], : array.shape[1]] = array
    return padded


def _sigmas(lane: Lane) -> Array:
    """Standard deviations of the noisy sensors."""
    return np.array([sensor.noise for sensor in lane.bench.sensors.in_order if sensor.noise > 0.0])


def _controller(lanes: Sequence[Lane]) -> Controller:
    first = lanes[0]
    per_control, gains = first.grid.per_control, first.bench.controller
    period = _period(first)
    delay_steps = math.ceil(gains.delay / first.grid.step - 1e-9)
    sensors = first.bench.sensors.in_order
    noisy = np.cumsum([sensor.noise > 0.0 for sensor in sensors]) - 1
    blocks = [_discrete_block(lane) for lane in lanes]
    a, b, c, d = (by_lane(matrices) for matrices in zip(*blocks, strict=True))

    def each(value: Callable[[Lane], Any]) -> Array:
        return by_lane([value(lane) for lane in lanes])

    resolution = each(lambda lane: [sensor.resolution for sensor in lane.bench.sensors.in_order])
    return Controller(
        every=per_control,
        closes_rate_loop=first.task.mode == "rate",
        fed_by_encoder=first.bench.rate_is_of_encoder,
        output_delay=delay_steps // per_control if per_control else 0,
        output_offset=delay_steps % per_control if per_control else 0,
        delay=np.array([round(sensor.delay / period) for sensor in sensors], dtype=np.int64),
        noisy=np.where([sensor.noise > 0.0 for sensor in sensors], noisy, -1).astype(np.int64),
        period=each(_period),
        proportional=each(lambda lane: lane.bench.controller.rate.proportional),
        integral=each(lambda lane: lane.bench.controller.rate.integral_gain),
        torque_per_current=each(lambda lane: lane.stated.torque_per_current),
        ratio=each(lambda lane: lane.stated.gear.ratio),
        filter_pole=each(_filter_pole),
        pointing_pole=each(
            lambda lane: math.exp(
                -2.0 * math.pi * lane.bench.controller.pointing_high_pass * _period(lane)
            )
        ),
        counts=np.any(resolution > 0.0, axis=-1).astype(np.int64),
        resolution=resolution,
        a=a,
        b=b,
        c=c,
        d=d,
    )


def _period(lane: Lane) -> float:
    rate = lane.bench.controller.sample_rate
    return 1.0 / rate if rate else 1.0


def _filter_pole(lane: Lane) -> float:
    low_pass = lane.bench.controller.relative_rate_filter
    return math.exp(-_period(lane) / low_pass) if low_pass > 0.0 else 0.0


def _discrete_block(lane: Lane) -> tuple[Array, Array, Array, Array]:
    """Linear compensation of a sampled controller, with readings constant over a sample."""
    block = lane.compensator.linear
    if block is None or not lane.grid.per_control:
        return np.zeros((0, 0)), np.zeros((0, 3)), np.zeros(0), np.zeros(3)
    a, b, _ = discretise(block.a, block.b, _period(lane))
    return a, b, block.c, block.d


def _memory(lanes: Sequence[Lane], controller: Controller) -> Memory:
    width, states = len(lanes), lanes[0].states
    x = zeros(states, width)
    x[RATE if lanes[0].prescribed else RELATIVE_ANGLE] = [lane.task.start_angle for lane in lanes]
    ended = zeros(2, width)
    for k, lane in enumerate(lanes):
        ended[:, k] = _torques_at_start(lane)
    return Memory(
        x=x,
        kept=zeros(KEPT, width),
        linear=zeros(len(controller.c), width),
        readings=zeros(4, int(controller.delay.max()) + 1, width),
        outputs=zeros(controller.output_delay + 1, width),
        held=zeros(2, width),
        ended=ended,
        counters=np.zeros(2, dtype=np.int64),
    )


def _torques_at_start(lane: Lane) -> tuple[float, float]:
    """Friction and continuous compensation at the start (N m), without their linear parts.

    The load is at rest in space, with undeflected bristles; the hull can move. The torques are
    those of the models over an infinitesimal time. NaN if a model of the plant has no state: its
    torque depends on the applied one. Dry models are recorded separately.
    """
    rate, angle = _rate_at_start(lane), lane.task.start_angle
    seen = 0.0 if lane.loop.seen != RATE and not lane.prescribed else rate
    plant = [each for each in lane.friction if each.dry is None]
    added = [each for each in lane.compensation if each.dry is None]
    yields = not lane.prescribed and any(each.state_size == 0 for each in plant)
    return (
        math.nan if yields else sum(torque_at(each, rate, angle) for each in plant),
        sum(torque_at(each, seen, angle) for each in added),
    )


def _rate_at_start(lane: Lane) -> float:
    """Relative rate at the start (rad/s); 0 below rounding error."""
    which, sign = (DRIVE, 1.0) if lane.prescribed else (BASE_RATE, -1.0)
    rate = sign * float(_signal(lane.task, which, np.zeros(1))[0])
    return rate if abs(rate) > AT_REST else 0.0
