"""Vectors of lanes: one number per trial of a block, as one value in compiled code.

The code of the engine is that for a single trial. Compiled for a block, its numbers are vectors
with a lane per trial, and `a + b` adds lane by lane, in SIMD instructions of the processor's width.
Sums, products, comparisons and the functions of `campaign.physics.elementary` accept vectors. `if`
does not, since each lane can have a different condition: use `elementary.where`.

IEEE 754 rounds lanes and numbers in the same way, so both give the same bits.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typeconv import Conversion
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, lower_cast, models, register_model

LANES = 16
"""Trials of a block: fewer do not fill the processor's vectors, more exceed its L1 cache."""
ROWS = 4
"""Rows of a single trial computed at once; eight were a quarter slower."""
COLUMNS = 4
"""Columns of a matrix summed at once."""
MOST_COLUMNS = 256
"""Maximum number of columns of a matrix: the length of an array on the stack."""
MOST_ROWS = 1 << 16
"""Length that the compiler assumes for an array at an address; all arrays are shorter."""
CACHE_LINE = 64
"""Bytes; a vector across two cache lines is read twice."""


class Vector(types.Type):  # type: ignore[misc]
    """Type of a vector of doubles, 64-bit integers or truth values."""

    def __init__(self, element: Any, lanes: int) -> None:
        if lanes.bit_count() != 1:  # it would have gaps in memory
            raise ValueError(f"a vector has a power of two of lanes, not {lanes}")
        self.element, self.lanes = element, lanes
        super().__init__(name=f"Vector({element}, {lanes})")

    def holds(self, number: Any) -> bool:
        """Whether lanes can hold a number: doubles hold all numbers, integers no doubles."""
        kinds = {types.float64: types.Number, types.int64: types.Integer}
        return isinstance(number, kinds.get(self.element, types.Boolean))

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:
        """Convert a number to a vector with the same value in every lane."""
        return Conversion.safe if self.holds(other) else None

    def unify(self, typingctx: Any, other: Any) -> Any:
        """Type of a variable that is a number in one place and a vector in another: a vector."""
        return self if self.holds(other) else None


@register_model(Vector)
class _VectorModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, vector: Vector) -> None:
        of = {types.float64: ir.DoubleType(), types.int64: ir.IntType(64)}
        element = of.get(vector.element, ir.IntType(1))
        super().__init__(manager, vector, ir.VectorType(element, vector.lanes))


@lower_cast(types.Number, Vector)
def _in_every_lane(context: Any, builder: Any, number: Any, vector: Any, value: Any) -> Any:
    return splat(builder, context.cast(builder, value, number, vector.element), vector.lanes)


def splat(builder: Any, value: Any, lanes: int) -> Any:
    """A vector with the same value in every lane."""
    undefined = ir.Constant(ir.VectorType(value.type, lanes), ir.Undefined)
    first = builder.insert_element(undefined, value, ir.IntType(32)(0))
    return builder.shuffle_vector(first, undefined, ir.VectorType(ir.IntType(32), lanes)(None))


def vector_among(args: Any) -> Any:
    """The first vector type among the types of arguments, or None."""
    return next((each for each in args if isinstance(each, Vector)), None)


def call_llvm(builder: Any, name: str, *args: Any) -> Any:
    """Call a floating-point intrinsic of LLVM, e.g. "fma", with doubles or vectors of doubles."""
    kind = args[0].type
    suffix = f"v{kind.count}f64" if isinstance(kind, ir.VectorType) else "f64"
    function = ir.FunctionType(kind, [kind] * len(args))
    name = f"llvm.{name}.{suffix}"
    return builder.call(cgutils.get_or_insert_function(builder.module, function, name), args)


_DOUBLES, _INTEGERS, _TRUTHS = (types.float64,), (types.int64,), (types.boolean,)


def _operation(
    function: Any,
    arguments: int,
    build: Callable[..., Any],
    elements: tuple[Any, ...],
    *,
    compares: bool = False,
) -> None:
    """Define `function` for vectors of `elements`, and for numbers beside them.

    For other vectors it does not compile, and the caller has to compute lane by lane: in Python a
    truth value is a number, in one bit it would be another number.
    """

    @infer_global(function)
    class Typing(AbstractTemplate):  # type: ignore[misc]
        def generic(self, args: Any, kws: Any) -> Any:
            vector = vector_among(args)
            if vector is None or vector.element not in elements:
                return None
            if not all(each == vector or vector.holds(each) for each in args):
                return None
            result = Vector(types.boolean, vector.lanes) if compares else vector
            return signature(result, *[vector] * len(args))

    @lower_builtin(function, *[Vector] * arguments)
    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return build(builder, sig.args[0].element == types.float64, *args)


def _either(of_doubles: str, of_integers: str) -> Callable[..., Any]:
    def build(builder: Any, doubles: bool, *args: Any) -> Any:
        return getattr(builder, of_doubles if doubles else of_integers)(*args)

    return build


def _comparison(sign: str) -> Callable[..., Any]:
    def build(builder: Any, doubles: bool, a: Any, b: Any) -> Any:
        if not doubles:
            return builder.icmp_signed(sign, a, b)
        compare = builder.fcmp_unordered if sign == "!=" else builder.fcmp_ordered
        return compare(sign, a, b)

    return build


_NUMBERS = _DOUBLES + _INTEGERS
for _function in (operator.add, operator.iadd):
    _operation(_function, 2, _either("fadd", "add"), _NUMBERS)
for _function in (operator.sub, operator.isub):
    _operation(_function, 2, _either("fsub", "sub"), _NUMBERS)
for _function in (operator.mul, operator.imul):
    _operation(_function, 2, _either("fmul", "mul"), _NUMBERS)
for _function in (operator.truediv, operator.itruediv):
    _operation(_function, 2, _either("fdiv", "fdiv"), _DOUBLES)
_operation(operator.and_, 2, _either("and_", "and_"), _INTEGERS + _TRUTHS)
_operation(operator.or_, 2, _either("or_", "or_"), _INTEGERS + _TRUTHS)
_operation(operator.xor, 2, _either("xor", "xor"), _INTEGERS + _TRUTHS)
_operation(operator.lshift, 2, _either("shl", "shl"), _INTEGERS)
_operation(operator.rshift, 2, _either("ashr", "ashr"), _INTEGERS)
_operation(operator.neg, 1, _either("fneg", "neg"), _NUMBERS)
_operation(abs, 1, lambda builder, doubles, x: call_llvm(builder, "fabs", x), _DOUBLES)
_operation(operator.lt, 2, _comparison("<"), _NUMBERS, compares=True)
_operation(operator.le, 2, _comparison("<="), _NUMBERS, compares=True)
_operation(operator.gt, 2, _comparison(">"), _NUMBERS, compares=True)
_operation(operator.ge, 2, _comparison(">="), _NUMBERS, compares=True)
_operation(operator.eq, 2, _comparison("=="), _NUMBERS, compares=True)
_operation(operator.ne, 2, _comparison("!="), _NUMBERS, compares=True)


def numbers(lanes: int) -> Any:
    """Type of the engine's numbers: a double for one lane, else a vector."""
    return types.float64 if lanes == 1 else Vector(types.float64, lanes)


def _array_of(lanes: int, axes: int) -> Any:
    """Array type of the engine's numbers; unaligned, else vectors need multiples of their size."""
    return types.Array(numbers(lanes), axes, "C", aligned=lanes == 1)


def _make_array(context: Any, builder: Any, kind: Any, data: Any, shape: list[Any]) -> Any:
    """An array at `data` that owns no memory: its rows in a loop count no references."""
    array = context.make_array(kind)(context, builder)
    data = builder.bitcast(data, array.data.type)
    size = context.get_abi_sizeof(context.get_data_type(kind.dtype))
    word = context.get_value_type(types.intp)
    strides = [word(size)]
    for length in reversed(shape[1:]):
        strides.insert(0, builder.mul(strides[0], length))
    shape_of = cgutils.pack_array(builder, shape, ty=word)
    strides_of = cgutils.pack_array(builder, strides, ty=word)
    from numba.np.arrayobj import populate_array

    populate_array(
        array, data=data, shape=shape_of, strides=strides_of, itemsize=word(size), meminfo=None
    )
    return array._getvalue()  # noqa: SLF001 (numba's own way)


@intrinsic(prefer_literal=True)
def by_lanes(typingctx: Any, array: Any, lanes: Any) -> Any:
    """An array of doubles (..., lanes) as an array (...) of numbers of the engine.

    `lanes` is a literal in the code.
    """
    kind = _array_of(lanes.literal_value, array.ndim - 1)

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        own = context.make_array(signature.args[0])(context, builder, args[0])
        shape = cgutils.unpack_tuple(builder, own.shape, array.ndim)[:-1]
        return _make_array(context, builder, kind, own.data, shape)

    return kind(array, lanes), codegen


@intrinsic(prefer_literal=True)
def by_rows(typingctx: Any, array: Any, lanes: Any) -> Any:
    """As `by_lanes`, for loops over all rows of an array of doubles (..., rows, lanes).

    For a single trial a vector contains ROWS rows; their number must be a multiple of ROWS.
    """
    if lanes.literal_value > 1:
        kind = _array_of(lanes.literal_value, array.ndim - 1)
    else:
        kind = _array_of(ROWS, array.ndim - 1)

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        own = context.make_array(signature.args[0])(context, builder, args[0])
        shape = cgutils.unpack_tuple(builder, own.shape, array.ndim)[:-1]
        if lanes.literal_value == 1:
            shape[-1] = builder.udiv(shape[-1], context.get_value_type(types.intp)(ROWS))
        return _make_array(context, builder, kind, own.data, shape)

    return kind(array, lanes), codegen


@intrinsic
def in_rows(typingctx: Any, numbers: Any) -> Any:
    """View of `rows_on_the_stack` for loops over all rows; see `by_rows`."""
    kind = numbers if isinstance(numbers.dtype, Vector) else _array_of(ROWS, 1)
    return _other_view(numbers, kind, (MOST_COLUMNS // ROWS,))


@intrinsic
def in_columns(typingctx: Any, numbers: Any) -> Any:
    """View of `rows_on_the_stack` in groups of COLUMNS numbers."""
    kind = types.Array(numbers.dtype, 2, "C", aligned=numbers.aligned)
    return _other_view(numbers, kind, (MOST_COLUMNS // COLUMNS, COLUMNS))


def _other_view(numbers: Any, kind: Any, shape: tuple[int, ...]) -> Any:
    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        own = context.make_array(signature.args[0])(context, builder, args[0])
        word = context.get_value_type(types.intp)
        return _make_array(context, builder, kind, own.data, [word(length) for length in shape])

    return kind(numbers), codegen


@intrinsic(prefer_literal=True)
def number_by_lanes(typingctx: Any, array: Any, lanes: Any) -> Any:
    """An array of doubles (lanes,) as one number of the engine."""
    kind = numbers(lanes.literal_value)

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        data = context.make_array(signature.args[0])(context, builder, args[0]).data
        data = builder.bitcast(data, context.get_data_type(kind).as_pointer())
        return context.unpack_value(builder, kind, data, 8)

    return kind(array, lanes), codegen


@intrinsic
def each_lane(typingctx: Any, numbers: Any) -> Any:
    """View of an array (...) of numbers of the engine as doubles (..., lanes).

    For operations without a vector form, such as `if`.
    """
    lanes = getattr(numbers.dtype, "lanes", 1)
    kind = types.Array(types.float64, numbers.ndim + 1, "C")

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        own = context.make_array(signature.args[0])(context, builder, args[0])
        shape = cgutils.unpack_tuple(builder, own.shape, numbers.ndim)
        word = context.get_value_type(types.intp)
        return _make_array(context, builder, kind, own.data, [*shape, word(lanes)])

    return kind(numbers), codegen


@intrinsic(prefer_literal=True)
def rows_on_the_stack(typingctx: Any, lanes: Any) -> Any:
    """An array of MOST_COLUMNS numbers of the engine; valid until the function returns.

    The stack contains no other array: loops that write to it need no alias checks against the
    arrays that they read.
    """
    kind = _array_of(lanes.literal_value, 1)

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        length = context.get_value_type(types.intp)(MOST_COLUMNS)
        doubles = MOST_COLUMNS * lanes.literal_value
        place = cgutils.alloca_once(builder, ir.ArrayType(ir.DoubleType(), doubles))
        place.align = CACHE_LINE
        return _make_array(context, builder, kind, place, [length])

    return kind(lanes), codegen


@intrinsic(prefer_literal=True)
def rows_at(typingctx: Any, pointer: Any, lanes: Any, parts: Any) -> Any:
    """Rows at an address, each with `parts` numbers of the engine of `lanes` lanes."""
    kind = _array_of(lanes.literal_value, 2)

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        word = context.get_value_type(types.intp)
        shape = [word(MOST_ROWS), word(parts.literal_value)]
        return _make_array(context, builder, kind, args[0], shape)

    return kind(pointer, lanes, parts), codegen


@intrinsic
def add_up(typingctx: Any, total: Any, number: Any) -> Any:
    """Return total + number; adds the lanes of a vector one by one to a scalar total."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        so_far, more = args
        if total == number:
            return builder.fadd(so_far, more)
        for lane in range(number.lanes):
            so_far = builder.fadd(so_far, builder.extract_element(more, ir.IntType(32)(lane)))
        return so_far

    return total(total, number), codegen


@intrinsic
def row_of(typingctx: Any, array: Any) -> Any:
    """View of an array of one axis that owns no memory."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        own = context.make_array(signature.args[0])(context, builder, args[0])
        return _make_array(
            context, builder, array, own.data, cgutils.unpack_tuple(builder, own.shape)
        )

    return array(array), codegen
