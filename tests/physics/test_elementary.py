"""Our own exp, log, sin, ...: right to about an ulp, and to the bit the same at every SIMD width.

References are computed in 50 digits by `decimal`: exp and ln are its own, sine and cosine are
Taylor series after a subtraction of multiples of pi. Arguments are drawn afresh from a fixed seed.
"""

from __future__ import annotations

import json
import math
import os
import re
import subprocess
import sys
from collections.abc import Callable
from decimal import Decimal, getcontext, localcontext
from functools import cache
from pathlib import Path
from typing import Any

import llvmlite.binding
import numba
import numpy as np
import pytest

from campaign.physics import elementary

PI = Decimal(
    "3.14159265358979323846264338327950288419716939937510582097494459230781640628620899862803"
)
NAN, INF = math.nan, math.inf
LARGEST = sys.float_info.max
LN_LARGEST = 709.782712893384  # the largest double whose exponential is finite

Reference = Callable[[float], Decimal]


def digits(function: Reference) -> Reference:
    def reference(x: float) -> Decimal:
        with localcontext(getcontext()) as context:
            context.prec = 50
            context.Emin, context.Emax = -99_999, 99_999
            return function(x)

    return reference


@digits
def exp(x: float) -> Decimal:
    return Decimal(x).exp()


@digits
def expm1(x: float) -> Decimal:
    """By series where 1 would eat the digits."""
    return Decimal(x).exp() - 1 if abs(x) > 0.1 else series(Decimal(x), lambda n: n + 1)


@digits
def log(x: float) -> Decimal:
    return Decimal(x).ln()


@digits
def sin(x: float) -> Decimal:
    return sine(Decimal(x))


@digits
def cos(x: float) -> Decimal:
    return sine(Decimal(x) + PI / 2)


@digits
def tanh(x: float) -> Decimal:
    growth = expm1(2.0 * x)
    return growth / (growth + 2)


def sine(angle: Decimal) -> Decimal:
    """The angle is brought to 0 by half turns, in digits enough that what is left has 50."""
    with localcontext() as context:
        context.prec = 85
        turns = (angle / PI).to_integral_value()
        r = angle - turns * PI
        value = series(r, lambda n: -(2 * n) * (2 * n + 1), r * r)
        return -value if turns % 2 else value


def series(first: Decimal, divisor: Callable[[int], int], factor: Decimal | None = None) -> Decimal:
    """first (1 + factor / divisor(1) (1 + factor / divisor(2) (...)))."""
    total = term = first
    for n in range(1, 60):
        term *= (first if factor is None else factor) / divisor(n)
        total += term
    return total


REFERENCES: dict[str, Reference] = {
    "exp": exp,
    "expm1": expm1,
    "log": log,
    "sin": sin,
    "cos": cos,
    "tanh": tanh,
}


@cache
def loop(name: str) -> Callable[[np.ndarray, np.ndarray], None]:
    function = getattr(elementary, name)

    @numba.njit
    def run(x, out):
        for k in range(len(x)):
            out[k] = function(x[k])

    return run


@cache
def scalar(name: str) -> Callable[[float], float]:
    function = getattr(elementary, name)

    @numba.njit
    def call(x):
        return function(x)

    return call


@numba.njit
def powers(x, y, out):
    for k in range(len(x)):
        out[k] = elementary.power(x[k], y[k])


@numba.njit
def power(x, y):
    return elementary.power(x, y)


def of(name: str, x: np.ndarray) -> np.ndarray:
    out = np.empty_like(x)
    loop(name)(x, out)
    return out


def ulps(value: float, reference: Decimal) -> float:
    """How far a value is from the reference, in units of the reference's last place."""
    return float(abs(Decimal(value) - reference) / Decimal(math.ulp(float(reference))))


def uniform(low: float, high: float, count: int = 1000) -> np.ndarray:
    return np.random.default_rng(1).uniform(low, high, count)


def decades(low: float, high: float, count: int = 300) -> np.ndarray:
    return 10.0 ** uniform(low, high, count)


def near_zeros(quarters: float) -> np.ndarray:
    """The doubles next to multiples of pi/2: their sine or cosine is lost to a bad reduction."""
    return np.rint(uniform(-quarters, quarters, 500)) * (math.pi / 2)


BOTH = np.array([-1.0, 1.0])[:, None]
ANGLES = [uniform(-10, 10), uniform(-1e6, 1e6), near_zeros(20), near_zeros(6e5)]
SMALL = (BOTH * decades(-300, 0)).ravel()
WORST_FOUND = {
    "exp": [100.1656691702085, -1.0357280017783705, LN_LARGEST, -707.0],
    "expm1": [37.92317026678363, 0.3635546223694819, -0.34956888838760186, 1.1e-17, 0.9e-17],
    "log": [1.4270259177070517, 0.703653085052265, 1.0 - 2.0**-53, 1.0 + 2.0**-52, 5e-324, LARGEST],
    "sin": [441821.52788064023, 9.487297706185021, 1e6, 5e-324],
    "cos": [833897.0011823652, -8.104443029340352, 1e6, 5e-324],
    "tanh": [0.2342965845479228, -0.24222632188375925, 5e-324],
}
ARGUMENTS = {
    "exp": [uniform(-707, 709.7), uniform(-2, 2), SMALL],
    "expm1": [uniform(-41, 709.7), uniform(-1.2, 1.2), uniform(0.3, 0.4), SMALL],
    "log": [decades(-323, 308), uniform(0.5, 2), 1.0 + SMALL[np.abs(SMALL) > 1e-16][:200]],
    "sin": [*ANGLES, SMALL],
    "cos": [*ANGLES, SMALL],
    "tanh": [uniform(-2, 2), uniform(-25, 25), SMALL],
}
LARGEST_ERROR = {"exp": 0.88, "expm1": 1.31, "log": 0.57, "sin": 1.5, "cos": 1.5, "tanh": 2.5}
"""Units in the last place, as the module says."""


@pytest.mark.slow
@pytest.mark.parametrize("name", REFERENCES)
def test_errors_are_as_stated(name: str) -> None:
    x = np.concatenate([*ARGUMENTS[name], WORST_FOUND[name]])
    errors = [ulps(value, REFERENCES[name](at)) for at, value in zip(x, of(name, x), strict=True)]
    worst = int(np.argmax(errors))
    assert errors[worst] <= LARGEST_ERROR[name], x[worst]


@pytest.mark.parametrize("name", ["sin", "cos"])
def test_large_angles_lose_little(name: str) -> None:
    x = np.concatenate([decades(6, 15), near_zeros(6e14)])
    errors = [
        abs(Decimal(value) - REFERENCES[name](at)) for at, value in zip(x, of(name, x), strict=True)
    ]
    assert max(errors) < 5e-16


@pytest.mark.parametrize(("size", "relative"), [(10.0, 2.3e-16), (690.0, 7e-15)])
def test_errors_of_power_are_as_stated(size: float, relative: float) -> None:
    y = decades(-3, 4, 1000)
    x = np.exp(np.clip(uniform(-size, size) / y, -700.0, 700.0))
    x, y = np.append(x, [1.3747863611052897, 5e-324]), np.append(y, [size * 3.14, size / 750.0])
    out = np.empty_like(x)
    powers(x, y, out)
    for base, exponent, value in zip(x, y, out, strict=True):
        with localcontext() as context:
            context.prec = 50
            reference = (Decimal(exponent) * Decimal(base).ln()).exp()
            assert abs(Decimal(value) / reference - 1) < relative, (base, exponent)


KERNELS = {
    "_EXP": (lambda r: (expm1(r), Decimal(r), 2, 1), -0.3466, 0.3466, 5.4e-19),
    "_SIN": (lambda r: (sin(r), Decimal(r), 3, 2), 0.0, math.pi / 4, 3.8e-18),
    "_COS": (lambda r: (cos(r), 1 - Decimal(r) ** 2 / 2, 4, 2), 0.0, math.pi / 4, 5.7e-20),
    "_LOG": (lambda r: (artanh(r), 2 * Decimal(r), 3, 2), 0.0, 3.0 - math.sqrt(8.0), 1.3e-18),
}
"""The function, the terms before its polynomial, the first of its powers and their step."""


def artanh(s: float) -> Decimal:
    """2 artanh(s)."""
    return ((1 + Decimal(s)) / (1 - Decimal(s))).ln()


@pytest.mark.parametrize("name", KERNELS)
def test_kernels_are_off_by_what_is_stated(name: str) -> None:
    """The error of a polynomial alone: a wrong digit shows here before it costs an ulp."""
    parts, low, high, stated = KERNELS[name]
    coefficients = [Decimal(c) for c in getattr(elementary, name)]
    worst = Decimal(0)
    with localcontext() as context:
        context.prec = 50
        for r in np.linspace(low, high, 402)[1:]:
            whole, leading, first, step = parts(float(r))
            terms = [c * Decimal(r) ** (first + step * n) for n, c in enumerate(coefficients)]
            worst = max(worst, abs((leading + sum(terms)) / whole - 1))
    assert stated * 0.9 < worst < stated


def test_constants_in_parts_sum_up() -> None:
    """To half a unit in the last place of the last part."""
    with localcontext() as context:
        context.prec = 80
        for parts, whole in (
            (elementary._LN2, Decimal(2).ln()),
            (elementary._LN2_SHORT, Decimal(2).ln()),
            (elementary._HALF_PI, PI / 2),
        ):
            left = abs(whole - sum(map(Decimal, parts)))
            assert left <= Decimal(math.ulp(parts[-1])) / 2
    assert (elementary._LN2_SHORT[0] * 2.0**42).is_integer()


@pytest.mark.parametrize("name", REFERENCES)
def test_bits_do_not_depend_on_the_width(name: str) -> None:
    """At every length and offset: what is left over from a loop's vectors runs as scalars."""
    x = mixed(name)
    alone = np.array([scalar(name)(value) for value in x])
    assert same_bits(of(name, x), alone)
    for length in range(1, 34):
        for offset in range(34):
            part = slice(offset, offset + length)
            assert same_bits(of(name, x[part]), alone[part]), (length, offset)


def test_bits_of_power_do_not_depend_on_the_width() -> None:
    x, y = mixed("log"), mixed_exponents()
    alone = np.array([power(base, exponent) for base, exponent in zip(x, y, strict=True)])
    for length in range(1, 34):
        for offset in range(34):
            part = slice(offset, offset + length)
            out = np.empty(length)
            powers(x[part], y[part], out)
            assert same_bits(out, alone[part]), (length, offset)


def mixed(name: str) -> np.ndarray:
    """Ordinary arguments, and edges among them."""
    x = np.concatenate([ARGUMENTS[name][0][:40], ARGUMENTS[name][-1][:30]])
    x[[3, 17, 29, 30, 44]] = [0.0, INF, NAN, LARGEST, 5e-324]
    return x


def mixed_exponents() -> np.ndarray:
    y = decades(-1, 1, 70)
    y[[1, 5, 12, 29, 33]] = [2.0, 1.0, 2.0, 1.0, NAN]
    return y


def same_bits(a: np.ndarray, b: np.ndarray) -> bool:
    """Also the sign of zero; of a NaN only that it is one."""
    nan = np.isnan(a)
    return np.array_equal(nan, np.isnan(b)) and bool(
        np.all((a.view(np.int64) == b.view(np.int64)) | nan)
    )


ON_ANOTHER_PROCESSOR = """
import json
from tests.physics import test_elementary as here
print(json.dumps(here.all_bits()))
"""


def all_bits() -> list[int]:
    """Of every function, at all of its arguments."""
    values = [of(name, np.concatenate(ARGUMENTS[name])) for name in REFERENCES]
    x, y = np.concatenate(ARGUMENTS["log"]), decades(-1, 1, 1500)
    out = np.empty_like(x)
    powers(x, y[: len(x)], out)
    return [int(bits) for bits in np.concatenate([*values, out]).view(np.int64)]


@pytest.mark.slow
def test_bits_do_not_depend_on_the_processor() -> None:
    """As compiled for the oldest of this kind: narrower vectors, or none, and perhaps no fma."""
    done = subprocess.run(
        [sys.executable, "-c", ON_ANOTHER_PROCESSOR],
        cwd=Path(__file__).parents[2],
        env={**os.environ, "NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == all_bits()


def has_fma() -> bool:
    features = llvmlite.binding.get_host_cpu_features()
    return bool(features.get("fma", "neon" in features))


VECTOR_FMA = re.compile(r"call <\d+ x double> @llvm\.fma\.v\d+f64")
DOUBLES = numba.types.CPointer(numba.types.float64)


@pytest.mark.slow
@pytest.mark.skipif(not has_fma(), reason="this processor has no fused multiply-add")
@pytest.mark.parametrize("name", REFERENCES)
def test_loops_are_compiled_to_vectors(name: str) -> None:
    """Over arrays, and over the raw pointers of a callback."""
    of(name, np.ones(1))
    (code,) = loop(name).inspect_llvm().values()
    assert VECTOR_FMA.search(code)

    function = getattr(elementary, name)

    def over_pointers(x: Any, out: Any, count: int) -> None:
        for k in range(count):
            out[k] = function(x[k])

    signature = numba.types.void(DOUBLES, DOUBLES, numba.types.int64)
    assert VECTOR_FMA.search(numba.cfunc(signature)(over_pointers).inspect_llvm())


@pytest.mark.skipif(not has_fma(), reason="this processor has no fused multiply-add")
def test_a_loop_over_power_is_compiled_to_vectors() -> None:
    powers(np.ones(1), np.ones(1), np.ones(1))
    (code,) = powers.inspect_llvm().values()
    assert VECTOR_FMA.search(code)


EDGES = {
    "exp": [(0.0, 1.0), (-0.0, 1.0), (INF, INF), (-INF, 0.0), (1e300, INF), (-1e300, 0.0)],
    "expm1": [(-1e300, -1.0), (-INF, -1.0), (INF, INF), (-0.0, -0.0), (5e-324, 5e-324)],
    "log": [(1.0, 0.0), (0.0, -INF), (-0.0, -INF), (INF, INF), (-1.0, NAN), (-INF, NAN)],
    "sin": [(0.0, 0.0), (-0.0, -0.0), (INF, NAN), (-INF, NAN), (1.1e15, NAN), (-LARGEST, NAN)],
    "cos": [(0.0, 1.0), (-0.0, 1.0), (INF, NAN), (-INF, NAN), (1.1e15, NAN), (-LARGEST, NAN)],
    "tanh": [(-0.0, -0.0), (20.0, 1.0), (-20.0, -1.0), (LARGEST, 1.0), (INF, 1.0), (-INF, -1.0)],
}


@pytest.mark.parametrize("name", EDGES)
def test_edges(name: str) -> None:
    pairs = [*EDGES[name], (NAN, NAN)] * 3  # in vectors, too
    x, expected = np.array(pairs).T
    assert same_bits(of(name, np.ascontiguousarray(x)), expected)


def test_exp_is_zero_or_infinite_beyond_its_ends() -> None:
    ends = np.array([LN_LARGEST, math.nextafter(LN_LARGEST, INF), -707.0, -707.0000000000001])
    assert np.isfinite(of("exp", ends)).tolist() == [True, False, True, True]
    assert of("exp", ends)[2] > 8e-308
    assert of("exp", ends)[3] == 0.0
    assert np.isfinite(of("expm1", ends)).tolist() == [True, False, True, True]


@pytest.mark.parametrize("name", ["sin", "tanh"])
def test_odd_functions_are_odd_to_the_bit(name: str) -> None:
    x = np.concatenate(ARGUMENTS[name])
    assert same_bits(of(name, -x), -of(name, x))


def test_exact_powers_are_exact() -> None:
    x = np.concatenate([decades(-200, 200), [0.0, 5e-324, 1e200, INF, 1.0 / 3.0]])
    out = np.empty_like(x)
    powers(x, np.full_like(x, 1.0), out)
    assert same_bits(out, x)
    powers(x, np.full_like(x, 2.0), out)
    with np.errstate(over="ignore", under="ignore"):
        assert same_bits(out, x * x)


@pytest.mark.parametrize(
    ("x", "y", "expected"),
    [
        (0.0, 0.5, 0.0), (0.0, 1e308, 0.0), (INF, 0.5, INF), (1.0, 1e308, 1.0), (1.0, INF, 1.0),
        (1.0 + 2.0**-52, 1e308, INF), (1.0 - 2.0**-53, 1e308, 0.0), (1e-200, 1.9, 0.0),
        (1e200, 1.9, INF), (4.0, 0.5, 2.0), (-4.0, 0.5, NAN), (NAN, 0.5, NAN), (NAN, 1.0, NAN),
        (NAN, 2.0, NAN), (0.0, NAN, NAN), (1.0, NAN, NAN), (INF, NAN, NAN),
    ],
)  # fmt: skip
def test_edges_of_power(x: float, y: float, expected: float) -> None:
    out = np.empty(9)
    powers(np.full(9, x), np.full(9, y), out)
    assert same_bits(out, np.full(9, expected))
