"""The step function of a friction model, and how the engine calls one it has never seen.

A step function is plain Python of a few lines, for one interface of one trial::

    step(parameters, state, motion) -> tuple[float, float]

parameters: the model's numbers, read only.   state: the model's numbers, advanced in place.
motion: what the interface meets over the step, see `Motion`.
It returns the mean torque over the step and its change over the step (N m): the torque enters the
plant as that straight line. The viscous part is not in it. It must not raise: native code cannot
pass an exception on, and what is not a number ends the trial as diverged.

The same function serves one trial and many. numba compiles it twice to native code with a fixed
signature: for one lane, and for a block of LANES lanes, where the processor does several at once
if the function has no branches but `a if condition else b` between numbers that are there already,
and calls nothing but `campaign.physics.elementary`. Any other function works and is slower. The
engine gets addresses, so one compiled engine serves every model, of this package or of another.
"""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numba import carray, types
from numba.extending import intrinsic, overload
from numpy.typing import NDArray

from campaign.physics.compiled import compiled_callback, inlined
from campaign.physics.elementary import where
from campaign.physics.rows import (
    ANSWERS,
    CHANGE,
    HAS,
    HAS_NORMAL_LOAD,
    HAS_PER_TORQUE,
    HAS_RATE,
    HAS_STATE,
    HAS_TEMPERATURE,
    HAS_TORQUE,
    HELD,
    KEEPS,
    KEEPS_TORQUE,
    MEAN,
    MEETS_COMPLIANCE,
    MEETS_PER_STEP,
    MEETS_POSITION,
    MEETS_PUSH,
    MEETS_RATE_END,
    MEETS_RATE_MEAN,
    MEETS_RATE_START,
    MEETS_RIPPLE,
    MEETS_STEP,
)

Array = NDArray[np.float64]

LANES = 16
"""Trials of a block: fewer leave the processor's vectors empty, more its first-level cache."""

ROOM_TEMPERATURE = 293.15
"""K; no bench tells another one yet."""
MOST_ROWS = 1 << 16
"""What the compiler may assume an array to have at most; nothing is as long."""


class Motion(NamedTuple):
    """What one interface meets over a step, in its own units: the motor's, for a motor-side one.

    Attributes:
        rate_start: relative rate when the step begins (rad/s).
        rate_end: the rate expected when it ends if all torques stay as they are.
        rate_mean: its mean over the step, expected likewise; a straight line would have the mean
            of both ends.
        applied: mean torque of all else on the interface over the step (N m): what friction would
            have to hold to keep the rate; 0 where there is no compliance.
        position: relative angle (rad) in the middle of the step, of the load.
        temperature: K.
        normal_load: of the interface, relative to the nominal one.
        step: s.
        per_step: its reciprocal.
        compliance: how much the rate at the end falls per N m of mean torque (rad/s per N m); 0
            where the rate does not answer within the step, as in compensation.
    """

    rate_start: float
    rate_end: float
    rate_mean: float
    applied: float
    position: float
    temperature: float
    normal_load: float
    step: float
    per_step: float
    compliance: float

    @staticmethod
    def at(
        rate_start: float,
        rate_end: float,
        step: float,
        *,
        applied: float = 0.0,
        position: float = 0.0,
        temperature: float = ROOM_TEMPERATURE,
        normal_load: float = 1.0,
        compliance: float = 0.0,
    ) -> Motion:
        """A motion of which little is to be said, for tests of a model."""
        return Motion(
            rate_start, rate_end, 0.5 * (rate_start + rate_end), applied, position, temperature,
            normal_load, step, 1.0 / step, compliance,
        )  # fmt: skip


_DOUBLES = types.CPointer(types.float64)
SIGNATURE = types.void(_DOUBLES, _DOUBLES, _DOUBLES, _DOUBLES)


def address_of(step: Callable[..., Any], lanes: int, parameters: int, states: int) -> int:
    """Address of the step function as `compiled_step` compiles it; it stays valid."""
    return int(compiled_step(step, lanes, parameters, states).address)


def compiled_step(step: Callable[..., Any], lanes: int, parameters: int, states: int) -> Any:
    """The step function compiled for so many lanes, parameters and states, kept for the process.

    `step` may be compiled already: then it is what it was compiled of.
    """
    with _COMPILING:
        return _compiled_once(getattr(step, "py_func", step), lanes, parameters, states)


_COMPILING = threading.RLock()


@cache
def _compiled_once(step: Callable[..., Any], lanes: int, parameters: int, states: int) -> Any:
    _known_to_numba(step)
    by_lanes = _by_lanes(step, lanes, parameters, states)
    return compiled_callback(SIGNATURE, by_lanes, step.__module__)


@cache
def _known_to_numba(step: Callable[..., Any]) -> None:
    """Compiled code may call it from now on; pasted into its caller, so that lanes go together."""
    overload(step, jit_options={"error_model": "numpy"}, inline="always", strict=False)(
        lambda parameters, state, motion: step
    )


def single_step(
    step: Callable[..., Any], parameters: Array, state: Array, motion: Motion
) -> tuple[float, float]:
    """One step of one interface, through the code that the engine runs: for tests of a model.

    parameters (p,) and state (s,) as the step function gets them; the state is advanced in place.
    Returns mean torque and its change (N m).
    """
    fixed = np.array([1.0, 1.0, 1.0, 1.0, motion.temperature, motion.normal_load, *parameters])
    kept, answer = np.array([0.0, *state]), np.zeros(ANSWERS)
    met = np.array([
        motion.rate_start, motion.rate_end, motion.rate_mean, motion.applied, motion.compliance,
        motion.position, 1.0, motion.step, motion.per_step,
    ])  # fmt: skip
    run = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 4)(
        address_of(step, 1, len(parameters), len(state))
    )
    run(*(rows.ctypes.data for rows in (fixed, kept, met, answer)))
    state[:] = kept[KEEPS:]
    return float(answer[MEAN]), float(answer[CHANGE])


def _by_lanes(step: Any, lanes: int, parameters: int, states: int) -> Callable[..., None]:
    """The step function for so many lanes, of a model with so many parameters and states.

    Arrays are rows by lanes, lane last; `rows` names the rows. The number of lanes stands in the
    code as a number, so that the compiler knows how far apart rows are; else it could not tell that
    they do not overlap.
    """
    own_end, state_end = HAS + parameters, KEEPS + states

    def by_lanes(fixed: Any, kept: Any, met: Any, answer: Any) -> None:
        has, keeps = carray(fixed, (MOST_ROWS, lanes)), carray(kept, (MOST_ROWS, lanes))
        meets, line = carray(met, (MOST_ROWS, lanes)), carray(answer, (MOST_ROWS, lanes))
        for k in range(lanes):
            motion = _motion(k, has, keeps, meets)
            mean, change = step(has[HAS:own_end, k], keeps[KEEPS:state_end, k], motion)
            _take(k, mean, change, has, keeps, meets, line)

    return by_lanes


@inlined
def _motion(k: int, has: Any, keeps: Any, meets: Any) -> Motion:
    """What the interface in lane `k` meets, in its own units."""
    rate, ripple = has[HAS_RATE, k], meets[MEETS_RIPPLE, k]
    others, compliance = meets[MEETS_PUSH, k] + keeps[KEEPS_TORQUE, k], meets[MEETS_COMPLIANCE, k]
    return Motion(
        meets[MEETS_RATE_START, k] * rate,
        meets[MEETS_RATE_END, k] * rate,
        meets[MEETS_RATE_MEAN, k] * rate,
        where(compliance > 0.0, others * has[HAS_PER_TORQUE, k] / ripple, 0.0),
        meets[MEETS_POSITION, k],
        has[HAS_TEMPERATURE, k],
        has[HAS_NORMAL_LOAD, k],
        meets[MEETS_STEP, k],
        meets[MEETS_PER_STEP, k],
        compliance * has[HAS_TORQUE, k] * ripple * rate,
    )


@inlined
def _take(
    k: int, mean: float, change: float, has: Any, keeps: Any, meets: Any, answer: Any
) -> None:
    """Add the line of the interface in lane `k` to the answer, at the load."""
    torque = has[HAS_TORQUE, k] * meets[MEETS_RIPPLE, k]
    own_mean, own_change = mean * torque, change * torque
    # A model without a state takes what the rate leaves it, and the next one does without.
    held = has[HAS_STATE, k] * (own_mean + 0.5 * own_change)
    meets[MEETS_PUSH, k] -= (1.0 - has[HAS_STATE, k]) * own_mean
    keeps[KEEPS_TORQUE, k] = held
    answer[MEAN, k] += own_mean
    answer[CHANGE, k] += own_change
    answer[HELD, k] += held


@intrinsic
def call_step(typingctx: Any, address: Any, fixed: Any, kept: Any, met: Any, answer: Any) -> Any:
    """Call a step function by address; the rest are addresses of doubles."""
    from llvmlite import ir

    signature = types.void(*[types.uintp] * 5)

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        doubles = ir.DoubleType().as_pointer()
        function = ir.FunctionType(ir.VoidType(), [doubles] * 4)
        pointer = builder.inttoptr(args[0], function.as_pointer())
        builder.call(pointer, [builder.inttoptr(each, doubles) for each in args[1:]])
        return context.get_dummy_value()

    return signature, codegen
