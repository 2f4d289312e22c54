"""Arrays of one trial, or of several in parallel, for the engine.

The last axis has the lanes; w is their number. The functions here return the arrays of the engine:
the same without that axis, with all lanes in a number (`campaign.physics.vector`). These arrays own
no memory, else each row in a loop would count references.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from campaign.arrays import Array as Array
from campaign.physics.compilation import pasted
from campaign.physics.vector import (
    CACHE_LINE,
    by_lanes,
    by_rows,
    each_lane,
    number_by_lanes,
    row_of,
)


class System(NamedTuple):
    """The discretised linear part by lanes; w is the number of lanes.

    `known` has a column for each state and then for each active input, at the start and at the end
    of the step. `by_friction` and `by_compensation` are the effects of friction and compensation.
    There is a row for each state; a single trial has additional rows of zeros (`vector.by_rows`).
    """

    known: Array  # (columns / COLUMNS, COLUMNS, rows, w): rows of a column are contiguous
    plant_inputs: int  # number of first rows of the signals, which act on the plant
    by_friction: Array  # (2, rows, w) per N m of the mean, and of the change over the step
    by_compensation: Array  # (2, rows, w)
    friction_rows: Array  # the same two, for loops over all rows
    compensation_rows: Array
    acts: NDArray[np.int64]  # (4,) row of each input in the signals; -1: zero input
    seen: int  # state that continuous compensation uses as the relative rate ...
    low_pass: Array  # (w,) ... and the time constant (s) of its filter, 0 for none
    linear_x: Array  # (states, w) torque of the continuous linear compensation
    linear_base: Array  # (w,) the same, per rate of the base
    step: Array  # (w,) s


class Dry(NamedTuple):
    """Friction models that are set-valued at rest, by lanes, as plant or compensation; d models."""

    address: NDArray[np.uintp]  # (d,) compiled sliding torques, for this many lanes
    fixed: Array  # (d, HAS + parameters, w)
    fixed_at: NDArray[np.uintp]  # (d,)
    limits: Array  # (d, LIMITS, w) torques of rest and of the slowest sliding (N m at the load)
    rippled: NDArray[np.int64]  # (d,)
    ripple: Array  # (d, 3, w) as of `Elements`
    wave: Array  # (d, 1, w) ripple factor of the torques in this step
    wave_at: NDArray[np.uintp]  # (d,)
    asked: Array  # (ASKED, w) direction and speed
    asked_at: int
    answer: Array  # (1, w) sum of the sliding torques, unsigned
    answer_at: int
    state: Array  # (DRY, w) common to all, as they share one rate
    numbers: Array  # the same, as the engine's numbers with all lanes


class Elements(NamedTuple):
    """Friction models by lanes, as plant or compensation: k interfaces besides the dry ones.

    Equal ones form one of g groups, with one call each (`campaign.physics.equal_interfaces`).
    """

    address: NDArray[np.uintp]  # (g,) compiled step functions, for this many lanes and interfaces
    fixed: Array  # (k, HAS + parameters, w), within a group (rows, its interfaces, w)
    fixed_at: NDArray[np.uintp]  # (g,) address of the rows of each group
    kept: Array  # (k, KEEPS + state, w) likewise, advanced in place
    kept_at: NDArray[np.uintp]  # (g,)
    met: Array  # (2, MEETS, w) motion at the load's and at the motor's side
    met_at: NDArray[np.uintp]  # (2,)
    answer: Array  # (ANSWERS, w) sum of the torque lines
    answer_at: int
    viscous: Array  # (k + d, w) the linear part (N m s/rad at the load), gain included
    motor_side: NDArray[np.int64]  # (g,) reads the resolver instead of the encoder
    side: NDArray[np.int64]  # (k + d,) the same for each interface
    rippled: NDArray[np.int64]  # (g,)
    ripple: Array  # (g, 3, w) amplitude, periods, phase: torque over the angle of the load
    dry: Dry


class Controller(NamedTuple):
    """A sampled rate controller with its sensors; `every` is 0 for a continuous one."""

    every: int  # steps per sample
    closes_rate_loop: bool
    fed_by_encoder: bool  # its rate is the filtered difference of the encoder, not the gyro
    output_delay: int  # whole samples ...
    output_offset: int  # ... and steps beyond them
    delay: NDArray[np.int64]  # (4,) samples
    noisy: NDArray[np.int64]  # (4,) column of each sensor in the noise; -1: no noise
    period: Array  # (w,) s
    proportional: Array  # (w,) A s/rad
    integral: Array  # (w,) A/rad
    torque_per_current: Array  # (w,) N m/A
    ratio: Array  # (w,) N
    filter_pole: Array  # (w,) of the relative-rate low-pass, 0 for none
    pointing_pole: Array  # (w,) of the pointing error's high-pass, 1 for none
    counts: NDArray[np.int64]  # (4,) whether a lane's sensor has a resolution
    resolution: Array  # (4, w) of the sensors, 0 for none
    a: Array  # (m, m, w) linear compensation, discrete
    b: Array  # (m, 3, w)
    c: Array  # (m, w)
    d: Array  # (3, w)


class Memory(NamedTuple):
    """State from step to step, advanced in place."""

    x: Array  # (states, w)
    kept: Array  # (KEPT, w) of the sampled controller
    linear: Array  # (m, w)
    readings: Array  # (4, longest delay + 1, w), ring
    outputs: Array  # (output delay + 1, w), ring
    held: Array  # (2, w) next current command, and the active one (A)
    ended: Array  # (2, w) torque at the end of the last line: of friction, of compensation
    counters: NDArray[np.int64]  # steps done, samples done


def zeros(*shape: int) -> Array:
    """Zeros, aligned to a cache line: each row of a block's lanes lies in one line."""
    size = math.prod(shape)
    room = np.zeros(size + CACHE_LINE // 8)
    first = -room.ctypes.data % CACHE_LINE // 8
    return room[first : first + size].reshape(shape)


def by_lane(rows: Sequence[Any]) -> Array:
    """Stack one array per lane, with the lanes as the last axis."""
    array = zeros(*np.shape(rows[0]), len(rows))
    for lane, row in enumerate(rows):
        array[..., lane] = row
    return array


@pasted
def system_of(lanes: int, its: System) -> System:
    """View of a system with the engine's numbers."""
    return System(
        by_rows(its.known, lanes),
        its.plant_inputs,
        by_lanes(its.by_friction, lanes),
        by_lanes(its.by_compensation, lanes),
        by_rows(its.by_friction, lanes),
        by_rows(its.by_compensation, lanes),
        row_of(its.acts),
        its.seen,
        number_by_lanes(its.low_pass, lanes),
        by_lanes(its.linear_x, lanes),
        number_by_lanes(its.linear_base, lanes),
        number_by_lanes(its.step, lanes),
    )


@pasted
def elements_of(lanes: int, its: Elements) -> Elements:
    """View of friction models with the engine's numbers."""
    return Elements(
        row_of(its.address),
        by_lanes(its.fixed, lanes),
        row_of(its.fixed_at),
        by_lanes(its.kept, lanes),
        row_of(its.kept_at),
        by_lanes(its.met, lanes),
        row_of(its.met_at),
        by_lanes(its.answer, lanes),
        its.answer_at,
        by_lanes(its.viscous, lanes),
        row_of(its.motor_side),
        row_of(its.side),
        row_of(its.rippled),
        by_lanes(its.ripple, lanes),
        dry_of(lanes, its.dry),
    )


@pasted
def dry_of(lanes: int, its: Dry) -> Dry:
    """View of dry friction for the engine, mostly as doubles: each lane branches separately."""
    return Dry(
        row_of(its.address),
        by_lanes(its.fixed, lanes),
        row_of(its.fixed_at),
        each_lane(by_lanes(its.limits, lanes)),
        row_of(its.rippled),
        each_lane(by_lanes(its.ripple, lanes)),
        each_lane(by_lanes(its.wave, lanes)),
        row_of(its.wave_at),
        each_lane(by_lanes(its.asked, lanes)),
        its.asked_at,
        each_lane(by_lanes(its.answer, lanes)),
        its.answer_at,
        each_lane(by_lanes(its.state, lanes)),
        by_lanes(its.numbers, lanes),
    )


@pasted
def controller_of(lanes: int, its: Controller) -> Controller:
    """View of a controller with the engine's numbers."""
    return Controller(
        its.every,
        its.closes_rate_loop,
        its.fed_by_encoder,
        its.output_delay,
        its.output_offset,
        row_of(its.delay),
        row_of(its.noisy),
        number_by_lanes(its.period, lanes),
        number_by_lanes(its.proportional, lanes),
        number_by_lanes(its.integral, lanes),
        number_by_lanes(its.torque_per_current, lanes),
        number_by_lanes(its.ratio, lanes),
        number_by_lanes(its.filter_pole, lanes),
        number_by_lanes(its.pointing_pole, lanes),
        row_of(its.counts),
        by_lanes(its.resolution, lanes),
        by_lanes(its.a, lanes),
        by_lanes(its.b, lanes),
        by_lanes(its.c, lanes),
        by_lanes(its.d, lanes),
    )


@pasted
def memory_of(lanes: int, its: Memory) -> Memory:
    """View of a memory with the engine's numbers."""
    return Memory(
        by_lanes(its.x, lanes),
        by_lanes(its.kept, lanes),
        by_lanes(its.linear, lanes),
        by_lanes(its.readings, lanes),
        by_lanes(its.outputs, lanes),
        by_lanes(its.held, lanes),
        by_lanes(its.ended, lanes),
        row_of(its.counters),
    )
