"""C99 of a compensation: one struct of state, one function a sample, the bits of the engine."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from campaign.controller_code.compensation import INPUTS, Sampled
from campaign.controller_code.transpile import MOTION, PRELUDE, ROWS, Program
from campaign.physics import elementary
from campaign.physics.friction_elements import Interface
from campaign.physics.step_function import AN_INSTANT, ROOM_TEMPERATURE, Motion

Array = NDArray[np.float64]
TYPES = f"typedef struct {{ double {', '.join(Motion._fields)}; }} motion;\n"


def c_code(made: Sampled, head: Sequence[str]) -> str:
    """The whole of `NAME.c`; head: lines that stand above it."""
    name, program = f"compensation_{made.name.replace('-', '_')}", Program()
    interfaces = tuple(made.interfaces)
    called = [_step(program, each) for each in interfaces]
    sine = _sine(program) if any(each.ripple[0] for each in interfaces) else ""
    numbers = [
        f"static const double parameters_{e}[] = {_row(each.parameters)};"
        for e, each in enumerate(interfaces)
    ]
    parts = [
        "/*", *(f" * {line}".rstrip() for line in head), " */",
        "#include <math.h>", "#include <stdint.h>", "#include <string.h>", "",
        TYPES, PRELUDE, *program.texts, *numbers, "",
        _state(name, made), _reset(name),
        _sample(name, made, called, sine), _selftest(name),
    ]  # fmt: skip
    return "\n".join(parts)


def test_code(made: Sampled, inputs: Array) -> str:
    """A program that ends with 0 where the code gives the bits of `Sampled.torques`."""
    name = f"compensation_{made.name.replace('-', '_')}"
    rows = np.column_stack([inputs, made.torques(inputs)])
    told = ",\n".join(f"    {_row(row)}" for row in rows)
    return f"""\
/* Test vectors of {name}.c: {", ".join(INPUTS)}, torque (SI). Ends with 0 where all bits agree.
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
    if ({name}_selftest() != 0) {{
        puts("fma is not fused, or arithmetic is contracted: compile with -ffp-contract=off");
        return 2;
    }}
    {name}_reset(&state);
    for (k = 0; k < sizeof rows / sizeof rows[0]; k++) {{
        const double torque = {name}_step(&state, rows[k][0], rows[k][1], rows[k][2], rows[k][3]);
        wrong += memcmp(&torque, &rows[k][4], sizeof torque) != 0;
    }}
    printf("%u of %u samples differ\\n", (unsigned)wrong, (unsigned)k);
    return wrong != 0;
}}
"""


def _row(values: Sequence[float] | Array) -> str:
    return "{" + ", ".join(map(_literal, values)) + "}"


def _literal(value: float) -> str:
    return float(value).hex()


def _step(program: Program, interface: Interface) -> str:
    rows = len(interface.parameters), interface.state_size
    return program.function(interface.step, [ROWS, ROWS, MOTION], rows)[0]


def _sine(program: Program) -> str:
    return program.function(elementary.sin, ["double"])[0]


def _state(name: str, made: Sampled) -> str:
    order = made.controller.c.shape[0]
    fields = ["double load_rate, motor_rate, load_angle, motor_angle, torque;"]
    fields += [f"double linear[{order}];"] if order else []
    sizes = (max(1, each.state_size) for each in made.interfaces)
    fields += [f"double friction_{e}[{size}];" for e, size in enumerate(sizes)]
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


def _sample(name: str, made: Sampled, called: Sequence[str], sine: str) -> str:
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
            f"    state->{of}_rate = {_literal(pole)} * state->{of}_rate"
            f" + {_literal(share)} * ({of}_angle - state->{of}_angle);"
            for of in ("load", "motor")
        ),
        "    state->load_angle = load_angle;",
        "    state->motor_angle = motor_angle;",
        f"    const double rate = {rate}, relative = state->load_rate;",
        f"    const double motor_torque = {_literal(its.torque_per_current[0])} * motor_current;",
        (
            f"    double torque = {_literal(d[0])} * rate + {_literal(d[1])} * motor_torque"
            f" + {_literal(d[2])} * relative;"
        ),
        *_linear(made),
        *_friction(made, called, sine),
        f"    const double limit = {_literal(limit)};  /* N m at the load: limits.torque */",
        "    torque = torque > limit ? limit : torque < -limit ? -limit : torque;",
        "    state->torque = torque;",
        "    return torque;",
    ]
    return f"""\
/* The torque to add (N m at the load), once every {_literal(period)} s ({1.0 / period:.9g} Hz).
 * gyro_rate: rad/s. load_angle: rad, relative. motor_angle: rad at the load (the motor's, by the
 * gear ratio). motor_current: A.
 */
double {name}_step({name}_state *state, double gyro_rate, double load_angle, double motor_angle,
    double motor_current)
{{
{chr(10).join(lines)}
}}
"""


def _linear(made: Sampled) -> Iterator[str]:
    its = made.controller
    order = its.c.shape[0]
    if not order:
        return
    yield f"    double next[{order}];"
    for row in range(order):
        yield f"    torque = torque + {_literal(its.c[row, 0])} * state->linear[{row}];"
        b = its.b[row, :, 0]
        yield (
            f"    next[{row}] = {_literal(b[0])} * rate + {_literal(b[1])} * motor_torque"
            f" + {_literal(b[2])} * relative;"
        )
        for column in range(order):
            a = _literal(its.a[row, column, 0])
            yield f"    next[{row}] = next[{row}] + {a} * state->linear[{column}];"
    yield "    memcpy(state->linear, next, sizeof next);"


def _friction(made: Sampled, called: Sequence[str], sine: str) -> Iterator[str]:
    """States over the sample that has ended, then the torque that stands now."""
    if not made.interfaces:
        return
    period = float(made.controller.period[0])
    yield "    double friction = 0.0;"
    for over in (period, AN_INSTANT):
        for e, each in enumerate(made.interfaces):
            side = "motor" if made.motor_side[e] else "load"
            yield "    {"
            if over == AN_INSTANT:
                yield from _gain(each, e, sine)
            yield f"        const double met = state->{side}_rate * {_literal(each.rate)};"
            told = ["met", "met", "met", "0.0", "load_angle", _literal(ROOM_TEMPERATURE), "1.0"]
            told += [_literal(over), _literal(1.0 / over), "0.0"]
            yield f"        const motion now = {{{', '.join(told)}}};"
            call = f"{called[e]}((double *)parameters_{e}, state->friction_{e}, &now)"
            if over == AN_INSTANT:
                yield f"        friction = friction + {call}.v0 * gain;"
            else:
                yield f"        (void){call};"
            yield "    }"
    yield "    torque = torque + friction;"
    for e, each in enumerate(made.interfaces):
        side = "motor" if made.motor_side[e] else "load"
        yield f"    torque = torque + {_literal(each.viscous)} * state->{side}_rate;"


def _gain(each: Interface, place: int, sine: str) -> Iterator[str]:
    amplitude, periods, phase = each.ripple
    if not amplitude:
        yield f"        const double gain = {_literal(each.torque)};"
        return
    wave = f"{sine}({_literal(periods)} * load_angle + {_literal(phase)})"
    yield f"        const double ripple = 1.0 + {_literal(amplitude)} * {wave};"
    yield f"        const double gain = {_literal(each.torque)} * ripple;"
