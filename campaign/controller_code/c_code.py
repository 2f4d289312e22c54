"""C99 of a compensation: one struct of state, one function a sample, the bits of the engine."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from campaign.controller_code.compensation import INPUTS, Sampled
from campaign.controller_code.transpile import (
    MOTION,
    NUMBER,
    PRELUDE,
    ROWS,
    SINGLE_PRELUDE,
    Program,
)
from campaign.physics import elementary
from campaign.physics.friction_elements import Interface
from campaign.physics.step_function import AN_INSTANT, ROOM_TEMPERATURE, Motion

Array = NDArray[np.float64]
Literal = Callable[[float], str]
TYPES = f"typedef struct {{ real {', '.join(Motion._fields)}; }} motion;\n"


SINGLE = 1e-3
"""Share of the largest torque of the vectors by which single precision may be off."""


def c_code(made: Sampled, head: Sequence[str], *, single: bool = False) -> str:
    """The whole of `NAME.c`; head: lines that stand above it. single: in floats."""
    name, program = made.identifier, Program(single=single)
    interfaces = tuple(made.interfaces)
    called = [_step(program, each) for each in interfaces]
    sine = _sine(program) if any(each.ripple[0] for each in interfaces) else ""
    numbers = [
        f"static const real parameters_{e}[] = {_row(program, each.parameters)};"
        for e, each in enumerate(interfaces)
    ]
    parts = [
        "/*", *(f" * {_comment(line)}".rstrip() for line in head), " */",
        "#include <math.h>", "#include <stdint.h>", "#include <string.h>", "",
        SINGLE_PRELUDE if single else PRELUDE, TYPES, *program.texts, *numbers, "",
        _state(name, made), _reset(name),
        _sample(name, program, made, called, sine), "" if single else _selftest(name),
    ]  # fmt: skip
    return "\n".join(parts)


def _comment(line: str) -> str:
    """Text of a bench file, which may end no comment and begin none."""
    return " ".join(line.split()).replace("*/", "* /").replace("/*", "/ *")


def vectors_code(made: Sampled, inputs: Array, *, single: bool = False) -> str:
    """A program that ends with 0 where the code gives the torques of `Sampled.torques`.

    To the bit; in single precision to `SINGLE` of the largest.
    """
    name = made.identifier
    torques = made.torques(inputs)
    rows = np.column_stack([inputs, torques])
    told = ",\n".join("    {" + ", ".join(map(float.hex, map(float, row))) + "}" for row in rows)
    if single:
        most = SINGLE * float(np.max(np.abs(torques)))
        promised, begins = f"all agree to {most:.3g} N m", ""
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
{told}
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


def _row(program: Program, values: Sequence[float] | Array) -> str:
    return "{" + ", ".join(map(program.literal, map(float, values))) + "}"


def _step(program: Program, interface: Interface) -> str:
    rows = len(interface.parameters), interface.state_size
    return program.function(interface.step, [ROWS, ROWS, MOTION], rows)[0]


def _sine(program: Program) -> str:
    if program.single:
        return "sinf"
    return program.function(elementary.sin, [NUMBER])[0]


def _state(name: str, made: Sampled) -> str:
    order = made.controller.c.shape[0]
    fields = ["real load_rate, motor_rate, load_angle, motor_angle, torque;"]
    fields += [f"real linear[{order}];"] if order else []
    sizes = (max(1, each.state_size) for each in made.interfaces)
    fields += [f"real friction_{e}[{size}];" for e, size in enumerate(sizes)]
    lines = "\n".join(f"    {each}" for each in (*fields, "int started;"))
    return f"typedef struct {{\n{lines}\n}} {name}_state;\n"


def _reset(name: str) -> str:
    return f"""\
/* As at power-up: at rest where the first sample finds it. */
void {name}_reset({name}_state *state)
{{
    memset(state, 0, sizeof *state);
}}
"""


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


def _sample(name: str, program: Program, made: Sampled, called: Sequence[str], sine: str) -> str:
    literal = program.literal
    its = made.controller
    pole, period = float(its.filter_pole[0]), float(its.period[0])
    share = (1.0 - pole) / period
    rate = "state->load_rate" if its.fed_by_encoder else "gyro_rate"
    d = its.d[:, 0]
    limit = made.bench.limits.torque
    lines = [
        "    if (!(isfinite(gyro_rate) && isfinite(load_angle) && isfinite(motor_angle)",
        "          && isfinite(motor_current)))",
        "        return state->torque;  /* a reading that is none: as in the sample before */",
        "    if (!state->started) {",
        "        state->load_angle = load_angle;",
        "        state->motor_angle = motor_angle;",
        "        state->started = 1;",
        "    }",
        *(
            f"    state->{of}_rate = {literal(pole)} * state->{of}_rate"
            f" + {literal(share)} * ({of}_angle - state->{of}_angle);"
            for of in ("load", "motor")
        ),
        "    state->load_angle = load_angle;",
        "    state->motor_angle = motor_angle;",
        f"    const real rate = {rate}, relative = state->load_rate;",
        f"    const real motor_torque = {literal(its.torque_per_current[0])} * motor_current;",
        (
            f"    real torque = {literal(d[0])} * rate + {literal(d[1])} * motor_torque"
            f" + {literal(d[2])} * relative;"
        ),
        *_linear(made, literal),
        *_friction(made, called, sine, literal),
        f"    const real limit = {literal(limit)};  /* N m at the load: limits.torque */",
        "    torque = torque > limit ? limit : torque < -limit ? -limit : torque;",
        "    state->torque = torque;",
        "    return torque;",
    ]
    return f"""\
/* The torque to add (N m at the load), once every {period!r} s ({1.0 / period:.9g} Hz).
 * gyro_rate: rad/s. load_angle: rad, relative. motor_angle: rad at the load (the motor's, by the
 * gear ratio). motor_current: A.
 */
real {name}_step({name}_state *state, real gyro_rate, real load_angle, real motor_angle,
    real motor_current)
{{
{chr(10).join(lines)}
}}
"""


def _linear(made: Sampled, literal: Literal) -> Iterator[str]:
    its = made.controller
    order = its.c.shape[0]
    if not order:
        return
    yield f"    real next[{order}];"
    for row in range(order):
        yield f"    torque = torque + {literal(its.c[row, 0])} * state->linear[{row}];"
        b = its.b[row, :, 0]
        yield (
            f"    next[{row}] = {literal(b[0])} * rate + {literal(b[1])} * motor_torque"
            f" + {literal(b[2])} * relative;"
        )
        for column in range(order):
            a = literal(its.a[row, column, 0])
            yield f"    next[{row}] = next[{row}] + {a} * state->linear[{column}];"
    yield "    memcpy(state->linear, next, sizeof next);"


def _friction(made: Sampled, called: Sequence[str], sine: str, literal: Literal) -> Iterator[str]:
    """States over the sample that has ended, then the torque that stands now."""
    if not made.interfaces:
        return
    period = float(made.controller.period[0])
    yield "    real friction = 0;"
    for over in (period, AN_INSTANT):
        for e, each in enumerate(made.interfaces):
            side = "motor" if made.motor_side[e] else "load"
            yield "    {"
            if over == AN_INSTANT:
                yield from _gain(each, sine, literal)
            yield f"        const real met = state->{side}_rate * {literal(each.rate)};"
            told = [
                "met",
                "met",
                "met",
                literal(0.0),
                "load_angle",
                literal(ROOM_TEMPERATURE),
                literal(1.0),
            ]
            told += [literal(over), literal(1.0 / over), literal(0.0)]
            yield f"        const motion now = {{{', '.join(told)}}};"
            call = f"{called[e]}((real *)parameters_{e}, state->friction_{e}, &now)"
            if over == AN_INSTANT:
                yield f"        friction = friction + {call}.v0 * gain;"
            else:
                yield f"        (void){call};"
            yield "    }"
    yield "    torque = torque + friction;"
    for e, each in enumerate(made.interfaces):
        side = "motor" if made.motor_side[e] else "load"
        yield f"    torque = torque + {literal(each.viscous)} * state->{side}_rate;"


def _gain(each: Interface, sine: str, literal: Literal) -> Iterator[str]:
    amplitude, periods, phase = each.ripple
    if not amplitude:
        yield f"        const real gain = {literal(each.torque)};"
        return
    wave = f"{sine}({literal(periods)} * load_angle + {literal(phase)})"
    yield f"        const real ripple = {literal(1.0)} + {literal(amplitude)} * {wave};"
    yield f"        const real gain = {literal(each.torque)} * ripple;"
