"""The engine: loop, friction and controller, step by step, compiled.

Scheme: the linear part is exact (`campaign.physics.loop.discretise`). Each friction model returns
its torque once per step as a straight line over the step, from the relative rate at the start, the
predicted rate at the end and the mean rate. This line is an input of the linear part. The result
is of second order in the step for friction with a state.

Rates at the end of a step are predicted from the torques at its start. The plant's friction and its
models in the compensation share one prediction, so that equal torques cancel.

The engine knows no friction model, compensation or controller form by name. It advances one trial,
or a block of LANES trials of one structure, with the same code: a number is a double, or a vector
with a lane per trial (`campaign.physics.vector`). Results of a lane are independent of the other
lanes, and so is rounding: sums have one order, and products are fused only by `fma`.
"""

from __future__ import annotations

from typing import Any

from campaign.physics.blocks import (
    Array,
    Controller,
    Elements,
    Memory,
    System,
    controller_of,
    elements_of,
    memory_of,
    system_of,
)
from campaign.physics.compilation import entry, inlined
from campaign.physics.dry_friction import (
    add_line,
    dry_torque_as_it_begins,
    expect_dry,
    expect_filtered,
    feed_forward,
    hold_again,
    rest,
)
from campaign.physics.elementary import fma
from campaign.physics.friction_lines import ask, end_of_line, halfway, torque_as_it_begins
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
from campaign.physics.sampled_controller import sample
from campaign.physics.vector import LANES, by_lanes, in_columns, in_rows, rows_on_the_stack


@inlined
def _begin(system: System, friction: Elements, memory: Memory, known: Array) -> None:
    for row in range(known.shape[0]):
        known[row] = 0.0
    for row in range(memory.x.shape[0]):
        known[row] = memory.x[row]
    friction.met[0, MEETS_COMPLIANCE] = -system.by_friction[MEAN, RATE]


@inlined
def _hold(system: System, memory: Memory, changes: bool, known: Array) -> None:
    """Hold the output of a sampled controller until the next one is due."""
    if changes:
        memory.held[1] = memory.held[0]
    known[memory.x.shape[0] + 2 * system.plant_inputs] = memory.held[1]


@inlined
def _read_inputs(system: System, memory: Memory, signals: Array, now: int, known: Array) -> None:
    """Inputs of the plant at the start and at the end of the step."""
    inputs, states = system.plant_inputs, memory.x.shape[0]
    for which in range(inputs):
        known[states + which] = signals[which, now]
        known[states + inputs + which] = signals[which, now + 1]


@inlined
def _base_rates(system: System, signals: Array, now: int) -> tuple[float, float]:
    """Rates of the hull at the start and at the end of the step (rad/s)."""
    start, end, row = 0.0, 0.0, system.acts[BASE_RATE]
    if row >= 0:
        start, end = signals[row, now], signals[row, now + 1]
    return start, end


@inlined
def _times(matrix: Array, known: Array, new: Array) -> None:
    """Multiply: new = matrix known, several columns at a time."""
    rows = matrix.shape[2]
    for row in range(rows):
        new[row] = 0.0
    for some in range(matrix.shape[0]):
        k0, k1, k2, k3 = known[some, 0], known[some, 1], known[some, 2], known[some, 3]
        for row in range(rows):
            total = fma(matrix[some, 0, row], k0, new[row])
            total = fma(matrix[some, 1, row], k1, total)
            total = fma(matrix[some, 2, row], k2, total)
            new[row] = fma(matrix[some, 3, row], k3, total)


@inlined
def _expect(
    lanes: int,
    system: System,
    friction: Elements,
    compensation: Elements,
    compensates: bool,
    x: Array,
    new: Array,
    base_start: float,
    base_end: float,
) -> None:
    """Predict the inputs of friction over the step, with constant torques."""
    met, held = friction.met[0], friction.answer[HELD]
    end = fma(system.by_friction[MEAN, RATE], held, new[RATE])
    angle = fma(system.by_friction[MEAN, RELATIVE_ANGLE], held, new[RELATIVE_ANGLE])
    if compensates:
        added = compensation.answer[HELD]
        end = fma(system.by_compensation[MEAN, RATE], added, end)
        angle = fma(system.by_compensation[MEAN, RELATIVE_ANGLE], added, angle)
    start, end = x[RATE] - base_start, end - base_end
    met[MEETS_RATE_START], met[MEETS_RATE_END] = start, end
    met[MEETS_RATE_MEAN] = (angle - x[RELATIVE_ANGLE]) * met[MEETS_PER_STEP]
    met[MEETS_PUSH] = (end - start) / met[MEETS_COMPLIANCE]
    halfway(x[RELATIVE_ANGLE], met)
    if friction.dry.address.shape[0] > 0:
        expect_dry(lanes, friction, system.by_friction)
        halfway(x[RELATIVE_ANGLE], met)


@inlined
def _compensate(
    lanes: int, system: System, friction: Elements, compensation: Elements, x: Array, new: Array
) -> None:
    """Compute the torque lines of continuous compensation."""
    dry = friction.dry.address.shape[0] > 0
    _expect_seen(system, friction, compensation, x, new)
    if dry and system.seen != RATE:
        expect_filtered(system, friction.dry.numbers, compensation.met[0])
    halfway(x[RELATIVE_ANGLE], compensation.met[0])
    ask(compensation)
    if compensation.dry.address.shape[0] > 0:
        feed_forward(lanes, dry and system.seen == RATE, friction.dry, compensation)


@inlined
def _expect_seen(
    system: System, friction: Elements, compensation: Elements, x: Array, new: Array
) -> None:
    """Predict the rate that continuous compensation uses, which can be filtered."""
    met, plant, row = compensation.met[0], friction.met[0], system.seen
    if row == RATE:
        met[MEETS_RATE_START], met[MEETS_RATE_END] = plant[MEETS_RATE_START], plant[MEETS_RATE_END]
        met[MEETS_RATE_MEAN] = plant[MEETS_RATE_MEAN]
    else:
        end = fma(system.by_friction[MEAN, row], friction.answer[HELD], new[row])
        end = fma(system.by_compensation[MEAN, row], compensation.answer[HELD], end)
        met[MEETS_RATE_START], met[MEETS_RATE_END] = x[row], end
        # The output of the low-pass: the displacement minus the lag of the filter.
        held_back = system.low_pass * (end - x[row]) * met[MEETS_PER_STEP]
        met[MEETS_RATE_MEAN] = plant[MEETS_RATE_MEAN] - held_back


@inlined
def _take(
    system: System,
    friction: Elements,
    compensation: Elements,
    compensates: bool,
    new: Array,
    x: Array,
) -> None:
    """Add the effect of the torque lines to the new states."""
    by, mean, change = system.friction_rows, friction.answer[MEAN], friction.answer[CHANGE]
    also, added, rising = (
        system.compensation_rows, compensation.answer[MEAN], compensation.answer[CHANGE],
    )  # fmt: skip
    for row in range(by.shape[1]):
        total = fma(by[CHANGE, row], change, fma(by[MEAN, row], mean, new[row]))
        if compensates:
            total = fma(also[CHANGE, row], rising, fma(also[MEAN, row], added, total))
        x[row] = total


@inlined
def _ended_line(elements: Elements) -> float:
    """End of the line of all models without the dry ones; adds the dry line to the answer."""
    ended = end_of_line(elements)
    if elements.dry.address.shape[0] > 0:
        add_line(elements)
    return ended


@inlined
def _torque_as_it_begins(elements: Elements, ended: float, first: bool) -> float:
    """Torque of all models, dry ones included, at the start of a step (N m)."""
    torque = torque_as_it_begins(elements, ended, first)
    if elements.dry.address.shape[0] > 0:
        torque = torque + dry_torque_as_it_begins(elements.dry.numbers, first)
    return torque


@inlined
def _record_states(
    system: System, x: Array, base_rate: float, torque: float, out: Array, place: int
) -> None:
    """Record a sample of a loop with a continuous controller, from the states.

    torque: of the compensation's friction models, without its linear part.
    """
    out[OUT_GYRO, place] = x[RATE]
    # A filtered rate is already relative to the base.
    out[OUT_RELATIVE_RATE, place] = x[system.seen] - (base_rate if system.seen == RATE else 0.0)
    out[OUT_ANGLE, place] = x[RELATIVE_ANGLE]
    out[OUT_CURRENT, place] = x[CURRENT]
    out[OUT_POINTING, place] = x[ANGLE]
    for row in range(system.linear_x.shape[0]):
        torque = fma(system.linear_x[row], x[row], torque)
    out[OUT_COMPENSATION, place] = fma(system.linear_base, base_rate, torque)


@inlined
def _record_readings(kept: Array, out: Array, place: int) -> None:
    """Record a sample of a loop with a sampled controller, from its readings."""
    out[OUT_GYRO, place] = kept[KEPT_GYRO]
    out[OUT_RELATIVE_RATE, place] = kept[KEPT_LOAD_RATE]
    out[OUT_ANGLE, place] = kept[KEPT_ENCODER]
    out[OUT_CURRENT, place] = kept[KEPT_CURRENT]
    out[OUT_POINTING, place] = kept[KEPT_POINTING]
    out[OUT_COMPENSATION, place] = kept[KEPT_TORQUE]


def _advancing(lanes: int) -> Any:
    """`advance` for a number of lanes."""

    def advance(
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
        """Advance over one segment and record every `every`-th step.

        signals: (inputs, steps + 1) at the step grid, inputs of the plant first.
        noise: (samples, noisy sensors), in sensor units.
        out: (8, steps / every), rows as OUTPUTS; the sample at the start of each `every` steps.
        """
        system, memory = system_of(lanes, system), memory_of(lanes, memory)
        friction, compensation = elements_of(lanes, friction), elements_of(lanes, compensation)
        controller = controller_of(lanes, controller)
        signals, noise, out = by_lanes(signals, lanes), by_lanes(noise, lanes), by_lanes(out, lanes)
        sampled = controller.every > 0
        compensates = not sampled and compensation.viscous.shape[0] > 0
        dry = friction.dry.address.shape[0] > 0
        # Known values at the start of a step, states first; and the states that follow from them.
        known, new = rows_on_the_stack(lanes), rows_on_the_stack(lanes)
        known_rows, known_columns, new_rows = in_rows(known), in_columns(known), in_rows(new)
        _begin(system, friction, memory, known)
        since_sample = memory.counters[0] % controller.every if sampled else 0
        samples, since_record, place = 0, 0, 0
        for now in range(signals.shape[1] - 1):
            if sampled:
                if since_sample == 0:
                    command = signals[system.acts[DRIVE], now]
                    sample(lanes, controller, compensation, memory, known, command, noise, samples)
                    samples += 1
                _hold(system, memory, since_sample == controller.output_offset, known)
                since_sample = since_sample + 1 if since_sample + 1 < controller.every else 0
            _read_inputs(system, memory, signals, now, known)
            base_start, base_end = _base_rates(system, signals, now)
            _times(system.known, known_columns, new_rows)
            _expect(
                lanes, system, friction, compensation, compensates, known, new, base_start, base_end
            )
            if compensates:
                _compensate(lanes, system, friction, compensation, known, new)
            ask(friction)
            if dry:
                hold_again(system, friction, compensation, known, new, base_end)
            if since_record == 0:
                first = memory.counters[0] == 0
                out[OUT_LOAD_RATE, place] = known[RATE]
                out[OUT_FRICTION, place] = _torque_as_it_begins(friction, memory.ended[0], first)
                if sampled:
                    _record_readings(memory.kept, out, place)
                else:
                    torque = _torque_as_it_begins(compensation, memory.ended[1], first)
                    _record_states(system, known, base_start, torque, out, place)
                place += 1
            since_record = since_record + 1 if since_record + 1 < every else 0
            memory.ended[0] = _ended_line(friction)
            if compensates:
                memory.ended[1] = _ended_line(compensation)
            _take(system, friction, compensation, compensates, new_rows, known_rows)
            if dry:
                rest(friction.dry.numbers, base_end, known)
            memory.counters[0] += 1
        for row in range(memory.x.shape[0]):
            memory.x[row] = known[row]

    advance.__qualname__ = "advance_one" if lanes == 1 else "advance_block"  # names its file
    return entry(advance)


advance_one, advance_block = _advancing(1), _advancing(LANES)
