"""C99: a state struct and a function per sample; doubles, bit-identical to the engine."""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from campaign.controller_code.compensation import INPUTS, SampledCompensation
from campaign.controller_code.sample import MEMORY, rows_of, sample
from campaign.controller_code.syntax import INTEGER, NUMBER, TRUTH, Argument, Syntax, signs
from campaign.controller_code.targets import Array, Target, about, vectors
from campaign.controller_code.transpile import Program
from campaign.physics import elementary

SINGLE = 1e-3
"""Tolerance of single precision, relative to the largest torque of the vectors."""
PRELUDE = """\
typedef double real;
static inline int64_t bits_of(double x) { int64_t b; memcpy(&b, &x, sizeof b); return b; }
static inline double double_of(int64_t b) { double x; memcpy(&x, &b, sizeof x); return x; }
"""
WHOLE: dict[type, str] = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.FloorDiv: "/", ast.BitAnd: "&",
    ast.BitOr: "|", ast.BitXor: "^", ast.LShift: "<<",
}  # fmt: skip


def syntax(*, single: bool = False) -> Syntax:
    """Syntax of C in doubles; single: in floats, with functions of the C library."""
    f = "f" if single else ""
    # Unsigned: signed overflow is undefined in C. Dividends are never below 0.
    whole = {op: f"((int64_t)((uint64_t){{}} {s} (uint64_t){{}}))" for op, s in WHOLE.items()}
    names = "exp", "expm1", "log", "sin", "cos", "tanh"
    library = {getattr(elementary, name): f"{name}f" for name in names}
    known = {
        "fma": f"fma{f}({{}}, {{}}, {{}})", "divide": "({} / {})", "nearest": f"rint{f}({{}})",
        "where": "({} ? {} : {})", "any_of": "{}", "abs": f"fabs{f}({{}})",
        "finite": "isfinite({})",
    }  # fmt: skip
    return Syntax(
        language="C",
        kinds={NUMBER: "real", INTEGER: "int64_t", TRUTH: "int"},
        literal=partial(_literal, suffix=f),
        integer=_integer,
        truths=("0", "1"),
        signs=signs(),
        whole={**whole, ast.RShift: "({} >> {})"},
        known=known if single else known | {n: f"{n}({{}})" for n in ("bits_of", "double_of")},
        functions={**library, elementary.power: "powf"} if single else {},
        comment=_comment,
        element="{}[{}]",
        assign="{} = {};",
        branch=("if ({}) {{", "}} else {{", "}}"),
        loop=("for ({0} = {1}; {0} < {2}; {0}++) {{", "}}"),
        result="return {1};",
        call=lambda name, to, given, written: f"{to} = {name}({', '.join(given.values())});",
        function=_function,
        struct=_struct,
        rows=lambda name, count: f"typedef real {name}[{count}];\n",
    )


def _literal(value: float, *, suffix: str) -> str:
    """Hexadecimal literal, exact to the last bit."""
    if math.isnan(value):
        return "NAN"
    if math.isinf(value):
        return "INFINITY" if value > 0 else "(-INFINITY)"
    text = float(value).hex() + suffix
    return f"({text})" if value < 0 else text


def _integer(value: int) -> str:
    if abs(value) < 2**31:
        return str(value)
    return "INT64_MIN" if value == -(2**63) else f"INT64_C({value})"


def _comment(line: str) -> str:
    """A comment line; text of a bench file cannot end it or begin another."""
    return "/* " + " ".join(line.split()).replace("*/", "* /").replace("/*", "/ *") + " */"


def _function(
    name: str, kind: str, arguments: Sequence[Argument], declared: Mapping[str, str],
    lines: Sequence[str],
) -> str:  # fmt: skip
    shown = ", ".join(
        f"{'const ' * (e.rows and not e.written)}{e.kind} {e.name}" for e in arguments
    )
    own = [f"    {own_kind} {each};" for each, own_kind in declared.items()]
    return "\n".join([f"static {kind} {name}({shown})", "{", *own, *lines, "}", ""])


def _struct(name: str, fields: Mapping[str, str]) -> str:
    return f"typedef struct {{ {' '.join(f'{k} {n};' for n, k in fields.items())} }} {name};\n"


def c_code(made: SampledCompensation, head: Sequence[str], *, single: bool = False) -> str:
    """Text of `NAME.c`; head: its first lines. single: in floats."""
    name, program = made.identifier, Program(syntax(single=single))
    main, rows = sample(program, made), rows_of(made)
    literal = program.syntax.literal
    numbers = [
        f"static const real {each.name}[] = {{{', '.join(map(literal, each.values))}}};"
        for each in rows
        if each.values
    ]
    states = [f"    real {e.name}[{max(1, e.size)}];" for e in rows if not e.values]
    given = [each.name if each.values else f"state->{each.name}" for each in rows]
    shown = ", ".join(f"real {each}" for each in INPUTS)
    return "\n".join([
        *map(_comment, about(made, head)),
        "#include <math.h>", "#include <stdint.h>", "#include <string.h>", "",
        "typedef float real;\n" if single else PRELUDE, *program.texts, *numbers,
        _comment(f"memory: {', '.join(MEMORY)}"),
        "typedef struct {", *states, f"}} {name}_state;", "",
        "/* As at power-up: at rest where the first sample finds it. */",
        f"void {name}_reset({name}_state *state)", "{",
        "    memset(state, 0, sizeof *state);", "}", "",
        f"real {name}_step({name}_state *state, {shown})", "{",
        f"    return {main.name}({', '.join([*given, *INPUTS])});", "}", "",
        "" if single else _selftest(name),
    ])  # fmt: skip


def _selftest(name: str) -> str:
    return f"""\
/* 0 where fma() rounds once and a product is rounded before it is added to. */
int {name}_selftest(void)
{{
    volatile double a = 0x1.0000001p+0, b = 0x1.fffffffp-1, product = a * b;
    volatile double apart = product - 1.0, together = fma(a, b, -1.0);
    double plain = a * b - 1.0;
    return !(apart != together && plain == apart);
}}
"""


def vectors_code(made: SampledCompensation, inputs: Array, *, single: bool = False) -> str:
    """Test program; exit code 0 if all torques agree with `SampledCompensation.torques`.

    All bits have to agree; in single precision the tolerance is `SINGLE` of the largest torque.
    """
    name, rows = made.identifier, vectors(made, inputs)
    table = ",\n".join("    {" + ", ".join(map(float.hex, row)) + "}" for row in rows.tolist())
    if single:
        most = SINGLE * float(np.max(np.abs(rows[:, 4])))
        promised, begins = f"all agree to {most:.3g} {made.unit('N m')}", ""
        differs = f"!(fabs(torque - rows[k][4]) <= {most.hex()})"
    else:
        promised, begins = "all bits agree", _begins(name)
        differs = "memcmp(&torque, &rows[k][4], sizeof torque) != 0"
    return f"""\
/* Test vectors of {name}.c: {", ".join(INPUTS)}, torque (SI). Ends with 0 where {promised}.
 * cc -std=c99 -O2 -ffp-contract=off {name}_test.c -lm && ./a.out
 */
#include <stdio.h>
#include "{name}.c"

static const double rows[][{rows.shape[1]}] = {{
{table}
}};

int main(void)
{{
    {name}_state state;
    size_t k, wrong = 0;
{begins}    {name}_reset(&state);
    for (k = 0; k < sizeof rows / sizeof rows[0]; k++) {{
        const double torque = (double){name}_step(&state, (real)rows[k][0], (real)rows[k][1],
            (real)rows[k][2], (real)rows[k][3]);
        wrong += {differs};
    }}
    printf("%u of %u samples differ\\n", (unsigned)wrong, (unsigned)k);
    return wrong != 0;
}}
"""


def _begins(name: str) -> str:
    return f"""\
    if ({name}_selftest() != 0) {{
        puts("fma is not fused, or arithmetic is contracted: compile with -ffp-contract=off");
        return 2;
    }}
"""


def _files(
    made: SampledCompensation, head: Sequence[str], inputs: Array, *, single: bool = False
) -> dict[str, str]:
    name = made.identifier
    precision = f"In single precision: to {SINGLE:g} of the largest torque of the test vectors."
    return {
        f"{name}.c": c_code(made, [*head, precision] if single else head, single=single),
        f"{name}_test.c": vectors_code(made, inputs, single=single),
    }


TARGETS = Target("c", _files), Target("c-single", partial(_files, single=True))
