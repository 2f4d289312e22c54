"""The step function of a friction model, and its call from the engine.

A step function is a short function in plain Python, for one interface of one trial::

    step(parameters, state, motion) -> tuple[float, float]

parameters: parameters of the model, read only.   state: states of the model, advanced in place.
motion: motion of the interface over the step, see `Motion`.
It returns the mean torque over the step and its change over the step (N m): the torque enters the
plant as that straight line. It excludes the viscous part. It must not raise, because native code
cannot propagate an exception. A NaN ends the trial as diverged.

The same function serves one trial and many. numba compiles it to native code with a fixed
signature, with vectors as numbers (`campaign.physics.vector`): of a block's lanes, or, in a single
trial, of the interfaces with this model. Such a function has no branches except
`elementary.where`, and calls only `campaign.physics.elementary`. Any other function works, but
slower. The engine gets addresses, so one compiled engine serves every model, of this package or of
another.
"""

from __future__ import annotations

import ctypes
import re
import threading
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.core.errors import NumbaError
from numba.extending import intrinsic, overload

from campaign.arrays import Array
from campaign.physics.compilation import compiled_callback, pasted
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
from campaign.physics.vector import add_up, rows_at

ROOM_TEMPERATURE = 293.15
"""K; no bench states another temperature yet."""
AN_INSTANT = 1e-15
"""s; without motion over this time, differences are still finite."""


class Motion(NamedTuple):
    """Motion of an interface over a step, in its own units: the motor's at the motor side.

    Attributes:
        rate_start: relative rate at the start of the step (rad/s).
        rate_end: predicted rate at its end with constant torques.
        rate_mean: predicted mean over the step; a straight line would have the mean of both ends.
        applied: mean torque of all other sources on the interface over the step (N m): the friction
            that would keep the rate constant; 0 without compliance.
        position: relative angle (rad) of the load in the middle of the step.
        temperature: K.
        normal_load: of the interface, relative to the nominal one.
        step: s.
        per_step: its reciprocal.
        compliance: decrease of the rate at the end per N m of mean torque (rad/s per N m); 0 if the
            rate does not respond within the step, as in compensation.
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
        """A motion with default values, for tests of a model."""
        return Motion(
            rate_start, rate_end, 0.5 * (rate_start + rate_end), applied, position, temperature,
            normal_load, step, 1.0 / step, compliance,
        )  # fmt: skip


_DOUBLES = types.CPointer(types.float64)
SIGNATURE = types.void(_DOUBLES, _DOUBLES, _DOUBLES, _DOUBLES)


def address_of(
    step: Callable[..., Any], lanes: int, members: int, parameters: int, states: int
) -> int:
    """Address of the step function compiled by `compiled_step`; it stays valid."""
    return int(compiled_step(step, lanes, members, parameters, states).address)


def compiled_step(
    step: Callable[..., Any], lanes: int, members: int, parameters: int, states: int
) -> Any:
    """Compile the step function for these numbers of lanes, interfaces, parameters and states.

    The result is cached in the process. A compiled `step` is replaced by its Python function.
    """
    with _COMPILING:
        sizes = lanes, members, parameters, states
        return _compiled_once(getattr(step, "py_func", step), *sizes)


_COMPILING = threading.RLock()


@cache
def _compiled_once(
    step: Callable[..., Any], lanes: int, members: int, parameters: int, states: int
) -> Any:
    _known_to_numba(step)
    # A vector contains the lanes of a block, or the interfaces of a single trial.
    width = lanes if lanes > 1 else members
    try:
        by_vectors = _by_vectors(step, lanes, members, width, parameters, states)
        return compiled_callback(SIGNATURE, by_vectors, step.__module__)
    except NumbaError:
        if width == 1:
            raise
    # The function contains an operation without a vector form.
    by_numbers = _by_vectors(step, lanes, members, 1, parameters, states)
    return compiled_callback(SIGNATURE, by_numbers, step.__module__)


@cache
def _known_to_numba(step: Callable[..., Any]) -> None:
    """Let compiled code call `step`, inlined into its caller, so that it becomes SIMD code."""
    overload(step, jit_options={"error_model": "numpy"}, inline="always", strict=False)(
        lambda parameters, state, motion: step
    )


def single_step(
    step: Callable[..., Any], parameters: Array, state: Array, motion: Motion
) -> tuple[float, float]:
    """One step of one interface with the engine's compiled code, for tests of a model.

    parameters (p,) and state (s,): arguments of the step function; the state is advanced in place.
    Returns mean torque and its change (N m).
    """
    fixed = np.array([1.0, 1.0, 1.0, 1.0, motion.temperature, motion.normal_load, *parameters])
    kept, answer = np.array([0.0, *state]), np.zeros(ANSWERS)
    met = np.array([
        motion.rate_start, motion.rate_end, motion.rate_mean, motion.applied, motion.compliance,
        motion.position, 1.0, motion.step, motion.per_step,
    ])  # fmt: skip
    run = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 4)(
        address_of(step, 1, 1, len(parameters), len(state))
    )
    run(*(rows.ctypes.data for rows in (fixed, kept, met, answer)))
    state[:] = kept[KEEPS:]
    return float(answer[MEAN]), float(answer[CHANGE])


def _by_vectors(
    step: Any, lanes: int, members: int, width: int, parameters: int, states: int
) -> Callable[..., None]:
    """The step function for `lanes` lanes of `members` equal interfaces, in vectors of `width`.

    Values of an interface are in arrays (rows, members, lanes), common values in arrays
    (rows, lanes); module `rows` names the rows.
    """
    own_end, state_end = HAS + parameters, KEEPS + states
    vectors = members * lanes // width
    shared_width = min(width, lanes)  # in a single trial, one number for all members
    shared = lanes // shared_width

    def by_vectors(fixed: Any, kept: Any, met: Any, answer: Any) -> None:
        has, keeps = rows_at(fixed, width, vectors), rows_at(kept, width, vectors)
        meets, line = rows_at(met, shared_width, shared), rows_at(answer, shared_width, shared)
        for k in range(vectors):
            motion = _motion(k, k % shared, has, keeps, meets)
            mean, change = step(has[HAS:own_end, k], keeps[KEEPS:state_end, k], motion)
            _take(k, k % shared, mean, change, has, keeps, meets, line)

    by_vectors.__qualname__ = own_name(step, lanes, members, width, parameters, states)
    return by_vectors


def own_name(function: Any, *sizes: int) -> str:
    """Unique name of a compiled function of a model, and thus of its own cache file.

    Processes that write one file of numba's cache at the same time can swap its contents.
    """
    name = ".".join((function.__module__, function.__qualname__, *map(str, sizes)))
    return re.sub(r"\W", "_", name)


@pasted
def _motion(own: int, common: int, has: Any, keeps: Any, meets: Any) -> Motion:
    """Motion of interfaces in their own units.

    own: index in the arrays of interfaces.   common: index in the common arrays.
    """
    rate, ripple = has[HAS_RATE, own], meets[MEETS_RIPPLE, common]
    compliance = meets[MEETS_COMPLIANCE, common]
    others = meets[MEETS_PUSH, common] + keeps[KEEPS_TORQUE, own]
    return Motion(
        meets[MEETS_RATE_START, common] * rate,
        meets[MEETS_RATE_END, common] * rate,
        meets[MEETS_RATE_MEAN, common] * rate,
        where(compliance > 0.0, others * has[HAS_PER_TORQUE, own] / ripple, 0.0),
        meets[MEETS_POSITION, common],
        has[HAS_TEMPERATURE, own],
        has[HAS_NORMAL_LOAD, own],
        meets[MEETS_STEP, common],
        meets[MEETS_PER_STEP, common],
        compliance * has[HAS_TORQUE, own] * ripple * rate,
    )


@pasted
def _take(
    own: int, common: int, mean: Any, change: Any, has: Any, keeps: Any, meets: Any, answer: Any
) -> None:
    """Add the lines of interfaces to the answer, at the load."""
    torque = has[HAS_TORQUE, own] * meets[MEETS_RIPPLE, common]
    own_mean, own_change = mean * torque, change * torque
    # A model without a state takes its torque from the applied one; the next model gets the rest.
    held = has[HAS_STATE, own] * (own_mean + 0.5 * own_change)
    taken = (1.0 - has[HAS_STATE, own]) * own_mean
    meets[MEETS_PUSH, common] = add_up(meets[MEETS_PUSH, common], -taken)
    keeps[KEEPS_TORQUE, own] = held
    answer[MEAN, common] = add_up(answer[MEAN, common], own_mean)
    answer[CHANGE, common] = add_up(answer[CHANGE, common], own_change)
    answer[HELD, common] = add_up(answer[HELD, common], held)


@intrinsic
def call_step(typingctx: Any, address: Any, fixed: Any, kept: Any, met: Any, answer: Any) -> Any:
    """Call a step function by address; the other arguments are addresses of doubles."""
    from llvmlite import ir

    signature = types.void(*[types.uintp] * 5)

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        doubles = ir.DoubleType().as_pointer()
        function = ir.FunctionType(ir.VoidType(), [doubles] * 4)
        pointer = builder.inttoptr(args[0], function.as_pointer())
        builder.call(pointer, [builder.inttoptr(each, doubles) for each in args[1:]])
        return context.get_dummy_value()

    return signature, codegen
