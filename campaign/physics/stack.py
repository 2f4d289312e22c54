"""Arrays of compiled code whose place is known to the compiler.

On the stack nothing else lies: loops that write there need not be checked, step by step, against
every array that they read.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

DOUBLES = 4096
"""Size of every such array."""


@intrinsic
def stack_doubles(typingctx: Any) -> Any:
    """The address of DOUBLES doubles, for `numba.carray`; gone when the function returns."""
    signature = types.CPointer(types.float64)()

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        place = cgutils.alloca_once(builder, ir.ArrayType(ir.DoubleType(), DOUBLES))
        return builder.bitcast(place, ir.DoubleType().as_pointer())

    return signature, codegen


@intrinsic
def data_of(typingctx: Any, array: Any) -> Any:
    """The address of an array's first element, for `numba.carray`.

    An array made of it owns nothing: rows taken of it in a loop cost no counting of references.
    """
    signature = types.CPointer(array.dtype)(array)

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return context.make_array(signature.args[0])(context, builder, args[0]).data

    return signature, codegen
