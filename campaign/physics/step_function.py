"""The step function of a friction model, and how the engine calls one it has never seen.

A step function is plain Python of a few lines::

    step(parameters, state, v0, v1, h, compliance, line) -> None

parameters: the model's numbers, read only.   state: the model's numbers, advanced in place.
v0: relative velocity (rad/s) when the step begins.   v1: the velocity expected at its end if this
friction's torque were as at the end of the last step (zero for a model without state).
h: the step (s).   compliance: how much the velocity at the end of the step falls per unit of mean
torque (rad/s per N m); 0 where the velocity does not answer within the step.
line: out. line[0] is the mean torque over the step, line[1] its change over the step (N m); the
torque enters the plant as that straight line. The viscous part is not in it.

numba compiles each step function once to native code with a fixed C signature. The engine gets its
address as a number, so one compiled engine serves every model, of this package or of another.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from numba import types
from numba.extending import intrinsic

from campaign.physics.compiled import compiled_callback

_DOUBLES = types.CPointer(types.float64)
SIGNATURE = types.void(
    _DOUBLES, _DOUBLES, types.float64, types.float64, types.float64, types.float64, _DOUBLES
)


@cache
def address_of(step: Callable[..., None]) -> int:
    """Address of the compiled step function; it stays valid for the life of the process."""
    callback = compiled_callback(SIGNATURE, step)
    _KEEP_ALIVE.append(callback)
    return int(callback.address)


_KEEP_ALIVE: list[Any] = []


@intrinsic
def call_step(
    typingctx: Any,
    address: Any,
    parameters: Any,
    state: Any,
    v0: Any,
    v1: Any,
    h: Any,
    compliance: Any,
    line: Any,
) -> Any:
    """Call a step function by address; `parameters`, `state`, `line` are addresses of doubles."""
    from llvmlite import ir

    signature = types.void(
        types.uintp,
        types.uintp,
        types.uintp,
        types.float64,
        types.float64,
        types.float64,
        types.float64,
        types.uintp,
    )

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        double = ir.DoubleType()
        doubles = double.as_pointer()
        function = ir.FunctionType(
            ir.VoidType(), [doubles, doubles, double, double, double, double, doubles]
        )
        pointer = builder.inttoptr(args[0], function.as_pointer())
        arguments = [
            builder.inttoptr(argument, doubles) if index in (1, 2, 7) else argument
            for index, argument in enumerate(args)
        ][1:]
        builder.call(pointer, arguments)
        return context.get_dummy_value()

    return signature, codegen
