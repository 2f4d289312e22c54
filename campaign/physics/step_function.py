"""The step function of a friction model, and its call from the engine.

A step function is plain Python of a few lines, for one interface of one trial::

    step(parameters, state, motion) -> tuple[float, float]

parameters: the model's numbers, read only.   state: the model's numbers, advanced in place.
motion: what the interface meets over the step, see `Motion`.
It returns the mean torque over the step and its change over the step (N m): the torque enters the
plant as that straight line. The viscous part is not in it. It must not raise: native code cannot
pass an exception on, and what is not a number ends the trial as diverged.

The same function serves one trial and many. numba compiles it to native code with a fixed
signature, in which its numbers are vectors (`campaign.physics.vector`): of a block's lanes, or, in
a single trial, of the interfaces that have this model. For that a function has no branches but
`elementary.where`, and calls nothing but `campaign.physics.elementary`. Any other function works
and is slower. The engine gets addresses, so one compiled engine serves every model, of this package
or of another.
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
from numpy.typing import NDArray

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

Array = NDArray[np.float64]

ROOM_TEMPERATURE = 293.15
"""K; no bench tells another one yet."""
AN_INSTANT = 1e-15
"""s; over it nothing moves, and differences are still numbers."""


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


def address_of(
    step: Callable[..., Any], lanes: int, members: int, parameters: int, states: int
) -> int:
    """Address of the step function as `compiled_step` compiles it; it stays valid."""
    return int(compiled_step(step, lanes, members, parameters, states).address)


def compiled_step(
    step: Callable[..., Any], lanes: int, members: int, parameters: int, states: int
) -> Any:
    """The step function compiled for so many lanes, interfaces, parameters and states.

    It is kept for the process. `step` may be compiled already: then it is what it was compiled of.
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
    # What goes into a vector: the lanes of a block, or the interfaces of a single trial.
    width = lanes if lanes > 1 else members
    try:
        by_vectors = _by_vectors(step, lanes, members, width, parameters, states)
        return compiled_callback(SIGNATURE, by_vectors, step.__module__)
    except NumbaError:
        if width == 1:
            raise
    # There is something in it that a vector cannot do.
    by_numbers = _by_vectors(step, lanes, members, 1, parameters, states)
    return compiled_callback(SIGNATURE, by_numbers, step.__module__)


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
        address_of(step, 1, 1, len(parameters), len(state))
    )
    run(*(rows.ctypes.data for rows in (fixed, kept, met, answer)))
    state[:] = kept[KEEPS:]
    return float(answer[MEAN]), float(answer[CHANGE])


def _by_vectors(
    step: Any, lanes: int, members: int, width: int, parameters: int, states: int
) -> Callable[..., None]:
    """The step function for so many lanes of so many alike interfaces, in vectors of `width`.

    What belongs to an interface stands in arrays (rows, members, lanes), what they meet and answer
    together in arrays (rows, lanes); `rows` names the rows.
    """
    own_end, state_end = HAS + parameters, KEEPS + states
    vectors = members * lanes // width
    shared_width = min(width, lanes)  # for a single trial, a number that all members meet
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
    """A name for what is compiled of a model's function: it has a file of its own by it.

    Processes that add to one file of numba's cache at a time can exchange what is in it.
    """
    name = ".".join((function.__module__, function.__qualname__, *map(str, sizes)))
    return re.sub(r"\W", "_", name)


@pasted
def _motion(own: int, common: int, has: Any, keeps: Any, meets: Any) -> Motion:
    """What interfaces meet, in their own units.

    own: their place in the arrays of interfaces.   common: in the arrays that all share.
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
    # A model without a state takes what the rate leaves it, and the next one does without.
    held = has[HAS_STATE, own] * (own_mean + 0.5 * own_change)
    taken = (1.0 - has[HAS_STATE, own]) * own_mean
    meets[MEETS_PUSH, common] = add_up(meets[MEETS_PUSH, common], -taken)
    keeps[KEEPS_TORQUE, own] = held
    answer[MEAN, common] = add_up(answer[MEAN, common], own_mean)
    answer[CHANGE, common] = add_up(answer[CHANGE, common], own_change)
    answer[HELD, common] = add_up(answer[HELD, common], held)


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
