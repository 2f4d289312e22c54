"""exp, expm1, log, power, sin, cos, tanh with reproducible bits.

A loop over lanes is compiled to SIMD instructions; its remainder and a single call are scalar.
Mathematical libraries use different algorithms for vectors, for numbers, and on other systems. The
last digits of a trial would depend on the system and on the number of parallel trials. Here every
result consists of operations that IEEE 754 rounds in exactly one way (sum, product, quotient, fma)
and of bit patterns, in a fixed order. LLVM keeps that order without fastmath flags; **no function
that calls these may have one**, since `reassoc` rounds vectors and scalars differently, and
`contract` may.

No function branches: each lane computes every case and selects its own. So they work on vectors of
lanes (`campaign.physics.vector`), and loops over them become SIMD loops (Python's `/` in such a
loop prevents that: see `divide`). A NaN stays a NaN; its sign and payload are undefined, as in
IEEE 754.

Largest errors in millions of arguments, in units in the last place (ulp):

    exp 0.87   expm1 1.3   log 0.56   sin, cos 1.5 (|x| <= 1e6)   tanh 2.5
    power 1.1 where the result is within e^-10 to e^10; 7e-15 of any result

The kernels are minimax polynomials from Remez' exchange algorithm in 60 digits; the leading
coefficients were rounded to doubles one by one, the rest fitted again each time. "Off by" is the
relative error that a kernel alone adds; half an ulp is 1.1e-16. A processor without fused
multiply-add gives the same bits, but slower: fma is then a call.
"""

from __future__ import annotations

import math
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from campaign.physics.compilation import pasted
from campaign.physics.vector import Vector, call_llvm, splat, vector_among

_TO_INTEGER = 1.5 * 2.0**52
"""Added to |x| < 2^51, it rounds x to an integer in the lowest bits of the sum."""
_SIGN_BIT = -(2**63)
_MANTISSA_BITS = 52
_EXPONENT_MASK = 0x7FF
_BIAS = 1023
_SMALLEST_NORMAL = 2.0**-1022
_BITS_OF_2_TO_52 = (_BIAS + 52) << _MANTISSA_BITS
_FROM_SQRT_HALF_TO_ONE = 0x3FF0000000000000 - 0x3FE6A09E667F3BCD
"""1.0 minus sqrt(1/2), both as bits. Added to the bits of x, it carries into the exponent if and
only if the mantissa is at least sqrt(2)."""

_LOG2_E = 1.4426950408889634
_LN2 = (0.6931471805599453, 2.3190468138462996e-17)
"""ln 2 = the sum: a double, and the double nearest to the remainder."""
_LN2_SHORT = (float.fromhex("0x1.62e42fefa38p-1"), 5.497923018708371e-14)
"""The same, the first in 42 bits: its product with an exponent is exact."""

_EXP = (
    0.5,
    0.16666666666666677,
    0.0416666666666667,
    0.008333333333321785,
    0.0013888888888877622,
    0.00019841269884672262,
    2.4801587297731465e-05,
    2.7557246415097445e-06,
    2.7557332441920525e-07,
    2.5108105713224545e-08,
    2.0887251786803067e-09,
)
"""(e^r - 1 - r) / r^2 in r, |r| <= ln(2)/2: e^r - 1 is off by 5.3e-19."""

_EXP_OVERFLOWS = 710.0
_EXP_VANISHES = -707.0  # half of the result, computed first, is still a normal number here
_EXPM1_IS_MINUS_ONE = -40.0
_EXPM1_IS_X = 1e-17
_TANH_IS_ONE = 20.0

_LOG = (
    0.6666666666666734,
    0.3999999999941705,
    0.2857142874189028,
    0.2222219862195924,
    0.18183561884452767,
    0.15314111022488383,
    0.14795361997010364,
)
"""(2 artanh(s) - 2 s) / s^3 in s^2, |s| <= (sqrt(2) - 1)^2: 2 artanh(s) is off by 1.2e-18."""

_TWO_OVER_PI = 0.6366197723675814
_HALF_PI = (1.5707963267948966, 6.123233995736766e-17, -1.4973849048591698e-33)
"""pi/2 = the sum, each the double nearest to the remainder."""

_SIN = (
    -0.1666666666666663,
    0.00833333333332184,
    -0.000198412698293585,
    2.7557313538490195e-06,
    -2.5050734382797242e-08,
    1.589543274092411e-10,
)
"""(sin(r) - r) / r^3 in r^2, |r| <= pi/4: sin(r) is off by 3.8e-18."""

_COS = (
    0.041666666666666595,
    -0.0013888888888873346,
    2.480158728900594e-05,
    -2.7557314218295826e-07,
    2.0875705574189306e-09,
    -1.1358758538655127e-11,
)
"""(cos(r) - 1 + r^2/2) / r^4 in r^2, |r| <= pi/4: cos(r) is off by 5.7e-20."""

_LARGEST_ANGLE = 1e15


@intrinsic
def fma(typingctx: Any, a: Any, b: Any, c: Any) -> Any:
    """Return a b + c, rounded once."""
    number = vector_among((a, b, c)) or types.float64

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return call_llvm(builder, "fma", *args)

    return number(number, number, number), codegen


@intrinsic
def divide(typingctx: Any, a: Any, b: Any) -> Any:
    """Return a / b of IEEE 754; Python's `/` raises for zero, which is a branch."""
    number = vector_among((a, b)) or types.float64

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.fdiv(*args)

    return number(number, number), codegen


@intrinsic
def nearest(typingctx: Any, x: Any) -> Any:
    """Return the nearest integer; a tie rounds to even."""
    number = vector_among((x,)) or types.float64

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return call_llvm(builder, "rint", *args)

    return number(number), codegen


@intrinsic
def where(typingctx: Any, condition: Any, yes: Any, no: Any) -> Any:
    """`yes if condition else no` of two computed numbers.

    Vectors lane by lane.
    """
    number = vector_among((yes, no)) or types.float64
    if isinstance(condition, Vector) and number == types.float64:
        number = Vector(types.float64, condition.lanes)

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.select(*args)

    return number(condition, number, number), codegen


@intrinsic
def any_of(typingctx: Any, condition: Any) -> Any:
    """Whether a condition is true in any lane: the caller can omit work that no lane needs."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        if not isinstance(condition, Vector):
            return args[0]
        bits = ir.IntType(condition.lanes)
        return builder.icmp_unsigned("!=", builder.bitcast(args[0], bits), bits(0))

    return types.boolean(condition), codegen


@intrinsic
def bits_of(typingctx: Any, x: Any) -> Any:
    """Return the 64 bits of a double as an integer."""
    bits = Vector(types.int64, x.lanes) if isinstance(x, Vector) else types.int64
    number = x if isinstance(x, Vector) else types.float64

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.bitcast(args[0], context.get_value_type(bits))

    return bits(number), codegen


@intrinsic
def double_of(typingctx: Any, bits: Any) -> Any:
    """Return the double with these 64 bits."""
    number = Vector(types.float64, bits.lanes) if isinstance(bits, Vector) else types.float64
    bits = bits if isinstance(bits, Vector) else types.int64

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.bitcast(args[0], context.get_value_type(number))

    return number(bits), codegen


@intrinsic
def polynomial(typingctx: Any, x: Any, coefficients: Any) -> Any:
    """Return c[0] + c[1] x + c[2] x^2 + ... of a tuple of doubles, by Estrin's scheme with fma.

    It joins neighbors, (c[0] + c[1] x) + (c[2] + c[3] x) x^2 + ..., and then the pairs in the same
    way. Eleven coefficients take four dependent steps, in Horner's scheme ten. For a single trial
    the latency determines the time.
    """

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        power = args[0]
        terms = [builder.extract_value(args[1], index) for index in range(len(coefficients))]
        if isinstance(x, Vector):
            terms = [splat(builder, term, x.lanes) for term in terms]
        while len(terms) > 1:
            unpaired = terms[len(terms) // 2 * 2 :]
            pairs = zip(terms[::2], terms[1::2], strict=False)
            joined = [call_llvm(builder, "fma", odd, power, even) for even, odd in pairs]
            terms = joined + unpaired
            power = builder.fmul(power, power)
        return terms[0]

    number = x if isinstance(x, Vector) else types.float64
    return number(number, coefficients), codegen


@pasted
def exp(x: float) -> float:
    """e^x; 0 below -707 (1e-307: smaller doubles begin to lose digits), inf above 709.78."""
    return _exp_of_sum(x, 0.0)


@pasted
def expm1(x: float) -> float:
    """e^x - 1, with a small relative error near x = 0 too."""
    half_scale, r, curve = _reduced_exp(x, 0.0)
    half = fma(half_scale, curve, fma(half_scale, r, half_scale - 0.5))
    result = where(abs(x) < _EXPM1_IS_X, x, 2.0 * half)
    result = where(x < _EXPM1_IS_MINUS_ONE, -1.0, result)
    last: float = where(x > _EXP_OVERFLOWS, math.inf, result)
    return last


@pasted
def log(x: float) -> float:
    """Natural logarithm; -inf for x = 0, NaN for x < 0."""
    high, _ = _log_in_two(x)
    result = where(x < math.inf, high, x)
    result = where(x != 0.0, result, -math.inf)
    last: float = where(x < 0.0, math.nan, result)
    return last


@pasted
def power(x: float, y: float) -> float:
    """x^y for x >= 0 and y > 0: the double x for y = 1, and the double x * x for y = 2.

    The relative error grows with |y ln x|, to 7e-15. 0 where x^y < 1e-307, as in `exp`. With any
    other y, x < 0 gives NaN. y <= 0 is right only for 0 < x < inf.
    """
    high, low = _log_in_two(x)
    exponent = where(y > 1e300, 1e300, y)  # x^1e300 is 0, 1 or inf; a product of inf would be NaN
    product = exponent * high
    rest = fma(exponent, low, fma(exponent, high, -product))
    limit = x * exponent  # 0 at 0, inf at inf, and NaN with any NaN
    result = where(x < math.inf, _exp_of_sum(product, rest), limit)
    result = where(x != 0.0, result, limit)
    result = where(x < 0.0, math.nan, result)
    result = where(y == 1.0, x, result)
    last: float = where(y == 2.0, x * x, result)
    return last


@pasted
def sin(x: float) -> float:
    """Sine of x (rad): to 1.5 ulp for |x| <= 1e6, also near its zeros.

    The error grows to 5e-16 at 1e15. NaN beyond: adjacent doubles differ by 0.1 rad and more.
    """
    result: float = where(x != 0.0, _sine_from_quarter(x, 0), x)
    return result


@pasted
def cos(x: float) -> float:
    """Cosine of x (rad); range and errors are those of `sin`."""
    return _sine_from_quarter(x, 1)


@pasted
def tanh(x: float) -> float:
    """Hyperbolic tangent; exactly odd; exactly 1 or -1 beyond 20."""
    within = where(abs(x) > _TANH_IS_ONE, _TANH_IS_ONE, abs(x))
    growth = expm1(2.0 * within)
    size = divide(growth, growth + 2.0)
    result: float = double_of(bits_of(size) | (bits_of(x) & _SIGN_BIT))
    return result


@pasted
def _exp_of_sum(x: float, low: float) -> float:
    """e^(x + low), |low| at most some ulp of x."""
    half_scale, r, curve = _reduced_exp(x, low)
    result = where(x < _EXP_VANISHES, 0.0, 2.0 * fma(half_scale, r + curve, half_scale))
    last: float = where(x > _EXP_OVERFLOWS, math.inf, result)
    return last


@pasted
def _reduced_exp(x: float, low: float) -> tuple[float, float, float]:
    """2^(k-1), r and e^r - 1 - r, where x + low = k ln 2 + r, |r| <= ln(2)/2 and -707 <= x <= 710.

    It returns half of 2^k, because the largest results need 2^1024, which is no double.
    """
    shifted = fma(x, _LOG2_E, _TO_INTEGER)
    k = shifted - _TO_INTEGER
    half_scale = double_of((bits_of(shifted) + (_BIAS - 1)) << _MANTISSA_BITS)
    main = fma(k, -_LN2[0], x)  # exact: a multiple of 2^-53 below 1 (or x itself if k = 0)
    rest = fma(k, -_LN2[1], low)
    r = main + rest
    lost = rest - (r - main)
    return half_scale, r, fma(r * r, polynomial(r, _EXP), lost)


@pasted
def _log_in_two(x: float) -> tuple[float, float]:
    """Natural logarithm, 0 < x < inf, as a sum of two doubles; relative error 2^-56.

    With x = 2^k m, sqrt(1/2) <= m < sqrt(2), and s = (m - 1) / (m + 1): ln m = 2 artanh(s).
    """
    subnormal = x < _SMALLEST_NORMAL
    bits = bits_of(where(subnormal, x * 2.0**54, x))
    biased = ((bits + _FROM_SQRT_HALF_TO_ONE) >> _MANTISSA_BITS) & _EXPONENT_MASK
    m = double_of(bits - ((biased - _BIAS) << _MANTISSA_BITS))
    k = double_of(biased | _BITS_OF_2_TO_52) - (2.0**52 + _BIAS) - where(subnormal, 54.0, 0.0)
    # s + s_low: the quotient, and the rounding errors of it and of m + 1.
    divisor = m + 1.0
    divisor_low = m - (divisor - 1.0)
    inverse = divide(1.0, divisor)
    s = (m - 1.0) * inverse
    s_low = inverse * fma(-s, divisor_low, fma(-s, divisor, m - 1.0))
    z = s * s
    whole = k * _LN2_SHORT[0]
    main = whole + 2.0 * s
    lost = 2.0 * s - (main - whole)
    rest = lost + fma(k, _LN2_SHORT[1], fma(s * z, polynomial(z, _LOG), 2.0 * s_low))
    high = main + rest
    return high, rest - (high - main)


@pasted
def _sine_from_quarter(x: float, quarter: int) -> float:
    """sin(x + quarter pi/2): x = k pi/2 + r, |r| <= pi/4, and sin or cos of r according to k.

    pi/2 is subtracted in three parts (Cody and Waite). The first difference is exact, a multiple of
    2^-53 below 1; the third part is relevant only if r, and thus the sine, is nearly 0.
    """
    shifted = fma(x, _TWO_OVER_PI, _TO_INTEGER)
    k = shifted - _TO_INTEGER
    quarters = bits_of(shifted) + quarter
    r = fma(k, -_HALF_PI[1], fma(k, -_HALF_PI[0], x))
    z = r * r
    sine = r + fma(r * z, polynomial(z, _SIN), k * -_HALF_PI[2])
    cosine = fma(z, fma(z, polynomial(z, _COS), -0.5), 1.0)
    size = where((quarters & 1) == 0, sine, cosine)
    result = double_of(bits_of(size) ^ ((quarters & 2) << 62))
    last: float = where(abs(x) <= _LARGEST_ANGLE, result, math.nan)
    return last
