"""The engine: advances loop, friction and controller step by step in compiled code.

Scheme: everything linear is exact (`campaign.physics.loop.discretise`). Each friction model is
asked once per step for its torque as a straight line over the step, from the relative rate at the
start, the rate expected at the end and their mean; that line is then an input of the linear part.
The result is of second order in the step for friction with a state.

Rates at the end of a step are expected from the torques as they were when it began: one prediction
for the plant's friction and for the models of it that compensate, so that what should cancel
cancels.

The engine knows no friction model, compensation or controller form by name. It advances one trial,
or a block of LANES trials of one structure: the same lines of code, compiled for either. Nothing
that a lane computes depends on its neighbours, and no rounding depends on how many there are: sums
have one order, and products are fused only where `fma` says so.
"""

from __future__ import annotations

from numba import carray

from campaign.physics.blocks import (
    MOST_COLUMNS,
    UNROLLED,
    Array,
    Controller,
    Elements,
    Memory,
    System,
    controller_of,
    elements_of,
    memory_of,
    system_of,
    tables_of,
)
from campaign.physics.compiled import compiled, inlined
from campaign.physics.elementary import fma
from campaign.physics.friction_lines import ask, halfway, keep_ends, record_torque
from campaign.physics.rows import (
    ANGLE,
    BASE_RATE,
    CHANGE,
    CURRENT,
    DRIVE,
    HELD,
    KEPT_CURRENT,
    KEPT_ENCODER,
    KEPT_GYRO,
    KEPT_LOAD_RATE,
    KEPT_POINTING,
    KEPT_TORQUE,
    MEAN,
    MEETS_COMPLIANCE,
    MEETS_PER_STEP,
    MEETS_PUSH,
    MEETS_RATE_END,
    MEETS_RATE_MEAN,
    MEETS_RATE_START,
    OUT_ANGLE,
    OUT_COMPENSATION,
    OUT_CURRENT,
    OUT_FRICTION,
    OUT_GYRO,
    OUT_LOAD_RATE,
    OUT_POINTING,
    OUT_RELATIVE_RATE,
    RATE,
    RELATIVE_ANGLE,
)
from campaign.physics.sampled import sample
from campaign.physics.stack import stack_doubles
from campaign.physics.step_function import LANES

AT_START, AT_END = 0, 1


@compiled
def advance_one(
    system: System,
    friction: Elements,
    compensation: Elements,
    controller: Controller,
    memory: Memory,
    signals: Array,
    noise: Array,
    every: int,
    out: Array,
) -> None:
    """`_advance` of one trial."""
    _advance(
        1,
        1,
        system_of(1, system),
        elements_of(1, friction),
        elements_of(1, compensation),
        controller_of(1, controller),
        memory_of(1, memory),
        tables_of(signals, 1),
        tables_of(noise, 1),
        every,
        tables_of(out, 1),
    )


@compiled
def advance_block(
    system: System,
    friction: Elements,
    compensation: Elements,
    controller: Controller,
    memory: Memory,
    signals: Array,
    noise: Array,
    every: int,
    out: Array,
) -> None:
    """`_advance` of LANES trials at once.

    That loops run over so many lanes is not said: of a short loop the compiler would make single
    instructions, one lane after the other, before it thinks of doing several at once.
    """
    _advance(
        LANES,
        system.step.shape[0],
        system_of(LANES, system),
        elements_of(LANES, friction),
        elements_of(LANES, compensation),
        controller_of(LANES, controller),
        memory_of(LANES, memory),
        tables_of(signals, LANES),
        tables_of(noise, LANES),
        every,
        tables_of(out, LANES),
    )


@inlined
def _advance(
    apart: int,
    lanes: int,
    system: System,
    friction: Elements,
    compensation: Elements,
    controller: Controller,
    memory: Memory,
    signals: Array,
    noise: Array,
    every: int,
    out: Array,
) -> None:
    """Advance over one stretch and record every `every`-th step.

    apart: lanes that lie side by side in memory.   lanes: those that are advanced: all of them.
    signals: (inputs, steps + 1, lanes) at the step grid, those that act on the plant first.
    noise: (samples, noisy sensors, lanes), in sensor units.
    out: (8, steps / every, lanes), rows as OUTPUTS; the sample at the start of each `every` steps.
    """
    sampled = controller.every > 0
    compensates = not sampled and compensation.viscous.shape[0] > 0
    # What is known when a step begins, the states first; and what follows of it alone.
    known = carray(stack_doubles(), (MOST_COLUMNS, apart))
    new = carray(stack_doubles(), (MOST_COLUMNS, apart))
    base = carray(stack_doubles(), (MOST_COLUMNS, apart))
    _begin(lanes, system, friction, memory, known, base)
    samples = 0
    for now in range(signals.shape[1] - 1):
        if sampled:
            place = memory.counters[0] % controller.every
            if place == 0:
                sample(
                    lanes, controller, compensation, memory, known, signals, system.acts[DRIVE],
                    now, noise, samples,
                )  # fmt: skip
                samples += 1
            _hold(lanes, system, memory, place == controller.output_offset, known)
        _read_inputs(lanes, system, signals, now, known, base)
        _times(lanes, system.known, known, new)
        _expect(lanes, system, friction, compensation, compensates, known, new, base)
        if compensates:
            _expect_seen(lanes, system, friction, compensation, known, new)
            halfway(lanes, known[RELATIVE_ANGLE], compensation.met[0])
            ask(lanes, compensation)
        halfway(lanes, known[RELATIVE_ANGLE], friction.met[0])
        ask(lanes, friction)
        if now % every == 0:
            first, place = memory.counters[0] == 0, now // every
            record_torque(lanes, friction, memory.ended[0], first, out[OUT_FRICTION], place)
            if sampled:
                _record_readings(lanes, memory.kept, out, place)
            else:
                added = out[OUT_COMPENSATION]
                record_torque(lanes, compensation, memory.ended[1], first, added, place)
                _record_states(lanes, system, known, base, out, place)
            for k in range(lanes):
                out[OUT_LOAD_RATE, place, k] = known[RATE, k]
        keep_ends(lanes, friction, memory.ended[0])
        _take(lanes, system.by_friction, friction, new, known)
        if compensates:
            keep_ends(lanes, compensation, memory.ended[1])
            _take(lanes, system.by_compensation, compensation, known, known)
        memory.counters[0] += 1
    for row in range(memory.x.shape[0]):
        for k in range(lanes):
            memory.x[row, k] = known[row, k]


@inlined
def _begin(
    lanes: int, system: System, friction: Elements, memory: Memory, known: Array, base: Array
) -> None:
    for row in range(MOST_COLUMNS):
        for k in range(lanes):
            known[row, k], base[row, k] = 0.0, 0.0
    for row in range(memory.x.shape[0]):
        for k in range(lanes):
            known[row, k] = memory.x[row, k]
    for k in range(lanes):
        friction.met[0, MEETS_COMPLIANCE, k] = -system.by_friction[MEAN, RATE, k]


@inlined
def _hold(lanes: int, system: System, memory: Memory, changes: bool, known: Array) -> None:
    """What a sampled controller puts out: it is held until the next one is due."""
    row = memory.x.shape[0] + 2 * system.plant_inputs
    for k in range(lanes):
        if changes:
            memory.held[1, k] = memory.held[0, k]
        known[row, k] = memory.held[1, k]


@inlined
def _read_inputs(
    lanes: int, system: System, signals: Array, now: int, known: Array, base: Array
) -> None:
    inputs, states, row = system.plant_inputs, system.known.shape[1], system.acts[BASE_RATE]
    for which in range(inputs):
        for k in range(lanes):
            known[states + which, k] = signals[which, now, k]
            known[states + inputs + which, k] = signals[which, now + 1, k]
    if row >= 0:
        for k in range(lanes):
            base[AT_START, k], base[AT_END, k] = signals[row, now, k], signals[row, now + 1, k]


@inlined
def _times(lanes: int, matrix: Array, known: Array, new: Array) -> None:
    """What follows of what is known: new = matrix known, by lanes."""
    columns, rows = matrix.shape[0], matrix.shape[1]
    for row in range(rows):
        for k in range(lanes):
            new[row, k] = 0.0
    for c in range(0, columns, UNROLLED):
        for row in range(rows):
            for k in range(lanes):
                total = fma(matrix[c, row, k], known[c, k], new[row, k])
                total = fma(matrix[c + 1, row, k], known[c + 1, k], total)
                total = fma(matrix[c + 2, row, k], known[c + 2, k], total)
                new[row, k] = fma(matrix[c + 3, row, k], known[c + 3, k], total)


@inlined
def _expect(
    lanes: int,
    system: System,
    friction: Elements,
    compensation: Elements,
    compensates: bool,
    x: Array,
    new: Array,
    base: Array,
) -> None:
    """The relative rate at the end of the step, should all torques stay as they are."""
    met = friction.met[0]
    for k in range(lanes):
        end = fma(system.by_friction[MEAN, RATE, k], friction.answer[HELD, k], new[RATE, k])
        if compensates:
            added = compensation.answer[HELD, k]
            end = fma(system.by_compensation[MEAN, RATE, k], added, end)
        met[MEETS_RATE_START, k] = x[RATE, k] - base[AT_START, k]
        met[MEETS_RATE_END, k] = end - base[AT_END, k]
    row = RELATIVE_ANGLE
    for k in range(lanes):
        angle = fma(system.by_friction[MEAN, row, k], friction.answer[HELD, k], new[row, k])
        if compensates:
            angle = fma(system.by_compensation[MEAN, row, k], compensation.answer[HELD, k], angle)
        met[MEETS_RATE_MEAN, k] = (angle - x[row, k]) * met[MEETS_PER_STEP, k]
    for k in range(lanes):
        gained = met[MEETS_RATE_END, k] - met[MEETS_RATE_START, k]
        met[MEETS_PUSH, k] = gained / met[MEETS_COMPLIANCE, k]


@inlined
def _expect_seen(
    lanes: int, system: System, friction: Elements, compensation: Elements, x: Array, new: Array
) -> None:
    """The same of the rate that continuous compensation sees, which may be filtered."""
    met, row = compensation.met[0], system.seen
    if row == RATE:
        for k in range(lanes):
            met[MEETS_RATE_START, k] = friction.met[0, MEETS_RATE_START, k]
            met[MEETS_RATE_END, k] = friction.met[0, MEETS_RATE_END, k]
            met[MEETS_RATE_MEAN, k] = friction.met[0, MEETS_RATE_MEAN, k]
    else:
        for k in range(lanes):
            end = fma(system.by_friction[MEAN, row, k], friction.answer[HELD, k], new[row, k])
            added = compensation.answer[HELD, k]
            end = fma(system.by_compensation[MEAN, row, k], added, end)
            met[MEETS_RATE_START, k], met[MEETS_RATE_END, k] = x[row, k], end
            # What the low-pass has let through: the way, less what it still holds back.
            held_back = system.low_pass[k] * (end - x[row, k]) * met[MEETS_PER_STEP, k]
            met[MEETS_RATE_MEAN, k] = friction.met[0, MEETS_RATE_MEAN, k] - held_back


@inlined
def _take(lanes: int, by: Array, elements: Elements, new: Array, x: Array) -> None:
    """Add to the new states what follows of a torque line."""
    answer = elements.answer
    for row in range(by.shape[1]):
        for k in range(lanes):
            total = fma(by[MEAN, row, k], answer[MEAN, k], new[row, k])
            x[row, k] = fma(by[CHANGE, row, k], answer[CHANGE, k], total)


@inlined
def _record_states(
    lanes: int, system: System, x: Array, base: Array, out: Array, place: int
) -> None:
    """A sample of a loop with a continuous controller, which reads the states themselves.

    The torque of the compensation's friction models is there already; its linear part is added.
    """
    hull = AT_START if system.seen == RATE else MOST_COLUMNS - 1  # the filter has taken it away
    for k in range(lanes):
        out[OUT_GYRO, place, k] = x[RATE, k]
        out[OUT_RELATIVE_RATE, place, k] = x[system.seen, k] - base[hull, k]
        out[OUT_ANGLE, place, k] = x[RELATIVE_ANGLE, k]
        out[OUT_CURRENT, place, k] = x[CURRENT, k]
        out[OUT_POINTING, place, k] = x[ANGLE, k]
    for row in range(system.linear_x.shape[0]):
        for k in range(lanes):
            added = out[OUT_COMPENSATION, place, k]
            out[OUT_COMPENSATION, place, k] = fma(system.linear_x[row, k], x[row, k], added)
    for k in range(lanes):
        added = out[OUT_COMPENSATION, place, k]
        out[OUT_COMPENSATION, place, k] = fma(system.linear_base[k], base[AT_START, k], added)


@inlined
def _record_readings(lanes: int, kept: Array, out: Array, place: int) -> None:
    """A sample of a loop with a sampled controller: what the controller knows."""
    for k in range(lanes):
        out[OUT_GYRO, place, k] = kept[KEPT_GYRO, k]
        out[OUT_RELATIVE_RATE, place, k] = kept[KEPT_LOAD_RATE, k]
        out[OUT_ANGLE, place, k] = kept[KEPT_ENCODER, k]
        out[OUT_CURRENT, place, k] = kept[KEPT_CURRENT, k]
        out[OUT_POINTING, place, k] = kept[KEPT_POINTING, k]
        out[OUT_COMPENSATION, place, k] = kept[KEPT_TORQUE, k]
