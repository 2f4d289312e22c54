"""One sample of a compensation as Python text, the source of each target's main function.

Operations and their order are those of `campaign.physics.sampled_controller`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from campaign.controller_code.compensation import INPUTS, SampledCompensation
from campaign.controller_code.syntax import NUMBER, ROWS, finite
from campaign.controller_code.transpile import Program, TargetFunction
from campaign.physics import elementary
from campaign.physics.friction_elements import Interface
from campaign.physics.step_function import AN_INSTANT, ROOM_TEMPERATURE, Motion

MEMORY = ("load_rate", "motor_rate", "load_angle", "motor_angle", "torque", "started")


class Rows(NamedTuple):
    """Array argument of the main function: parameters (`values`), or states, which it changes."""

    name: str
    size: int
    values: tuple[float, ...] = ()


def rows_of(made: SampledCompensation) -> list[Rows]:
    """All states (0 at power-up) and the parameters of the friction models."""
    order = made.controller.c.shape[0]
    states = [Rows("memory", len(MEMORY)), *([Rows("linear", order)] if order else [])]
    for e, each in enumerate(made.interfaces):
        values = tuple(map(float, each.parameters))
        states += [Rows(f"friction_{e}", each.state_size)]
        states += [Rows(f"parameters_{e}", len(values), values)]
    return states


def sample(program: Program, made: SampledCompensation) -> TargetFunction:
    """The main function: torque (N m at the load) from `rows_of` and `INPUTS`."""
    rows = rows_of(made)
    scope = {"Motion": Motion, "sin": elementary.sin, "finite": finite}
    scope |= {f"step_{e}": each.step for e, each in enumerate(made.interfaces)}
    head = f"def sample({', '.join([*(each.name for each in rows), *INPUTS])}):"
    source = "\n    ".join([head, *_lines(made)])
    types = [*[ROWS] * len(rows), *[NUMBER] * len(INPUTS)]
    return program.text_function(source, scope, types, [each.size for each in rows])


def _lines(made: SampledCompensation) -> Iterator[str]:
    its = made.controller
    pole, period = float(its.filter_pole[0]), float(its.period[0])
    share, d = (1.0 - pole) / period, its.d[:, 0].tolist()
    yield f"if not ({' and '.join(f'finite({each})' for each in INPUTS)}):"
    yield "    'A reading that is none: torque and states of the sample before.'"
    yield "    return memory[4]"
    yield "if memory[5] == 0.0:"
    yield "    memory[2] = load_angle"
    yield "    memory[3] = motor_angle"
    yield "    memory[5] = 1.0"
    for place, of in enumerate(("load", "motor")):
        moved = f"{share!r} * ({of}_angle - memory[{2 + place}])"
        yield f"memory[{place}] = {pole!r} * memory[{place}] + {moved}"
    yield "memory[2] = load_angle"
    yield "memory[3] = motor_angle"
    yield "relative = memory[0]"
    yield f"rate = {'relative' if its.fed_by_encoder else 'gyro_rate'}"
    yield f"motor_torque = {float(its.torque_per_current[0])!r} * motor_current"
    yield f"torque = {d[0]!r} * rate + {d[1]!r} * motor_torque + {d[2]!r} * relative"
    yield from _linear(made)
    yield from _friction(made)
    limit = made.bench.limits.torque
    yield f"'{made.unit('N m')} at the load: limits.torque'"
    yield f"limit = {float(limit)!r}"
    yield "torque = limit if torque > limit else (-limit if torque < -limit else torque)"
    yield "memory[4] = torque"
    yield "return torque"


def _linear(made: SampledCompensation) -> Iterator[str]:
    a, b, c = (getattr(made.controller, each)[..., 0].tolist() for each in "abc")
    for row, inputs in enumerate(b):
        yield f"torque = torque + {c[row]!r} * linear[{row}]"
        total = f"{inputs[0]!r} * rate + {inputs[1]!r} * motor_torque + {inputs[2]!r} * relative"
        yield f"next_{row} = {total}"
        for column in range(len(b)):
            yield f"next_{row} = next_{row} + {a[row][column]!r} * linear[{column}]"
    for row in range(len(b)):
        yield f"linear[{row}] = next_{row}"


def _friction(made: SampledCompensation) -> Iterator[str]:
    """Update states over the past sample, then evaluate the present torque."""
    if not made.interfaces:
        return
    period = float(made.controller.period[0])
    rates = [f"memory[{int(motor)}]" for motor in made.motor_side]
    yield "friction = 0.0"
    for over in (period, AN_INSTANT):
        for e, each in enumerate(made.interfaces):
            yield f"met = {rates[e]} * {float(each.rate)!r}"
            fields = f"met, met, met, 0.0, load_angle, {ROOM_TEMPERATURE!r}, 1.0"
            yield f"now = Motion({fields}, {over!r}, {1.0 / over!r}, 0.0)"
            yield f"mean, change_{e} = step_{e}(parameters_{e}, friction_{e}, now)"
            if over == AN_INSTANT:
                yield f"friction = friction + mean * {_gain(each)}"
    yield "torque = torque + friction"
    for rate, each in zip(rates, made.interfaces, strict=True):
        yield f"torque = torque + {float(each.viscous)!r} * {rate}"


def _gain(each: Interface) -> str:
    amplitude, periods, phase = map(float, each.ripple)
    if not amplitude:
        return repr(float(each.torque))
    wave = f"sin({periods!r} * load_angle + {phase!r})"
    return f"({float(each.torque)!r} * (1.0 + {amplitude!r} * {wave}))"
