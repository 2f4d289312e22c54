"""The arrays of one trial, or of a block of trials side by side, as the engine takes them.

The last axis has the lanes; w is their number. The functions here give the compiler, inside the
engine, the same arrays with a number of lanes that it knows, and which own nothing: else each row
that is taken of them in a loop would cost a counting of references.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import carray
from numpy.typing import NDArray

from campaign.physics.compiled import inlined
from campaign.physics.stack import DOUBLES, data_of
from campaign.physics.step_function import LANES

Array = NDArray[np.float64]

MOST_COLUMNS = DOUBLES // LANES
"""States and inputs that a loop may have."""
UNROLLED = 4
"""Columns of `System.known` that are summed at a time; their number is a multiple of it."""


class System(NamedTuple):
    """The discretised linear part by lanes; w is the number of lanes.

    `known` has a column for each state and then for each input that acts, at the start and at the
    end of the step; what friction and compensation add is `by_friction` and `by_compensation`.
    """

    known: Array  # (columns, states, w), transposed: a column's rows lie side by side
    plant_inputs: int  # rows of the signals that act on the plant, the first ones
    by_friction: Array  # (2, states, w) per N m of the mean, and of the change over the step
    by_compensation: Array  # (2, states, w)
    acts: NDArray[np.int64]  # (4,) for each input its row of the signals; -1: it is zero
    seen: int  # the state that continuous compensation sees as the relative rate ...
    low_pass: Array  # (w,) ... and the time constant (s) of its filter, 0 for none
    linear_x: Array  # (states, w) torque of the continuous linear compensation
    linear_base: Array  # (w,) the same, of the base's rate
    step: Array  # (w,) s


class Elements(NamedTuple):
    """Friction models by lanes, as plant or as compensation; k of them."""

    address: NDArray[np.uintp]  # (k,) compiled step functions, for this many lanes
    fixed: Array  # (k, HAS + parameters, w)
    fixed_at: NDArray[np.uintp]  # (k,) where each one's rows begin
    kept: Array  # (k, KEEPS + state, w) advanced in place
    kept_at: NDArray[np.uintp]  # (k,)
    met: Array  # (2, MEETS, w) what they meet on the load's and on the motor's side
    met_at: NDArray[np.uintp]  # (2,)
    answer: Array  # (ANSWERS, w) the sum of their torque lines
    answer_at: int
    viscous: Array  # (k, w) the linear part (N m s/rad at the load), gain included
    motor_side: NDArray[np.int64]  # (k,) reads the resolver rather than the encoder
    rippled: NDArray[np.int64]  # (k,)
    ripple: Array  # (k, 3, w) amplitude, periods, phase: torque over the angle of the load


class Controller(NamedTuple):
    """A sampled rate controller with its sensors; `every` is 0 for a continuous one."""

    every: int  # steps per sample
    closes_rate_loop: bool
    output_delay: int  # whole samples ...
    output_offset: int  # ... and steps beyond them
    delay: NDArray[np.int64]  # (4,) samples
    noisy: NDArray[np.int64]  # (4,) for each sensor its column of the noise; -1: it has none
    period: Array  # (w,) s
    proportional: Array  # (w,) A s/rad
    integral: Array  # (w,) A/rad
    torque_per_current: Array  # (w,) N m/A
    ratio: Array  # (w,) N
    filter_pole: Array  # (w,) of the relative-rate low-pass, 0 for none
    pointing_pole: Array  # (w,) of the pointing error's high-pass, 1 for none
    resolution: Array  # (4, w) of the sensors, 0 for none
    a: Array  # (m, m, w) linear compensation, discrete
    b: Array  # (m, 3, w)
    c: Array  # (m, w)
    d: Array  # (3, w)


class Memory(NamedTuple):
    """What is carried from step to step, advanced in place."""

    x: Array  # (states, w)
    kept: Array  # (KEPT, w) of the sampled controller
    linear: Array  # (m, w)
    readings: Array  # (4, longest delay + 1, w), ring
    outputs: Array  # (output delay + 1, w), ring
    held: Array  # (2, w) current command that is next, and that is in force (A)
    ended: Array  # (2, w) torque at the end of the last line: of friction, of compensation
    counters: NDArray[np.int64]  # steps done, samples done


@inlined
def rows_of(array: Array, lanes: int) -> Any:
    """An array (rows, lanes) of which the compiler knows how far apart the rows are."""
    return carray(data_of(array), (array.shape[0], lanes))


@inlined
def row_of(array: Any) -> Any:
    """The same of an array of one axis, of any type."""
    return carray(data_of(array), (array.shape[0],))


@inlined
def tables_of(array: Array, lanes: int) -> Any:
    """The same of an array (tables, rows, lanes)."""
    return carray(data_of(array), (array.shape[0], array.shape[1], lanes))


@inlined
def system_of(lanes: int, its: System) -> System:
    """A system, for the inside of the engine."""
    return System(
        tables_of(its.known, lanes),
        its.plant_inputs,
        tables_of(its.by_friction, lanes),
        tables_of(its.by_compensation, lanes),
        row_of(its.acts),
        its.seen,
        row_of(its.low_pass),
        rows_of(its.linear_x, lanes),
        row_of(its.linear_base),
        row_of(its.step),
    )


@inlined
def elements_of(lanes: int, its: Elements) -> Elements:
    """Friction models, for the inside of the engine."""
    return Elements(
        row_of(its.address),
        tables_of(its.fixed, lanes),
        row_of(its.fixed_at),
        tables_of(its.kept, lanes),
        row_of(its.kept_at),
        tables_of(its.met, lanes),
        row_of(its.met_at),
        rows_of(its.answer, lanes),
        its.answer_at,
        rows_of(its.viscous, lanes),
        row_of(its.motor_side),
        row_of(its.rippled),
        tables_of(its.ripple, lanes),
    )


@inlined
def controller_of(lanes: int, its: Controller) -> Controller:
    """A controller, for the inside of the engine."""
    return Controller(
        its.every,
        its.closes_rate_loop,
        its.output_delay,
        its.output_offset,
        row_of(its.delay),
        row_of(its.noisy),
        row_of(its.period),
        row_of(its.proportional),
        row_of(its.integral),
        row_of(its.torque_per_current),
        row_of(its.ratio),
        row_of(its.filter_pole),
        row_of(its.pointing_pole),
        rows_of(its.resolution, lanes),
        tables_of(its.a, lanes),
        tables_of(its.b, lanes),
        rows_of(its.c, lanes),
        rows_of(its.d, lanes),
    )


@inlined
def memory_of(lanes: int, its: Memory) -> Memory:
    """A memory, for the inside of the engine."""
    return Memory(
        rows_of(its.x, lanes),
        rows_of(its.kept, lanes),
        rows_of(its.linear, lanes),
        tables_of(its.readings, lanes),
        rows_of(its.outputs, lanes),
        rows_of(its.held, lanes),
        rows_of(its.ended, lanes),
        row_of(its.counters),
    )
