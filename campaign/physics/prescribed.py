"""The engine without a plant: friction and compensation at a motion that is prescribed."""

from __future__ import annotations

from campaign.physics.blocks import (
    Array,
    Elements,
    Memory,
    elements_of,
    memory_of,
    row_of,
    rows_of,
    tables_of,
)
from campaign.physics.compiled import compiled, inlined
from campaign.physics.friction_lines import ask, halfway, keep_ends, on_a_line, record_torque
from campaign.physics.rows import (
    MEETS_RATE_END,
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
)
from campaign.physics.step_function import LANES


@compiled
def drive_one(
    friction: Elements, compensation: Elements, memory: Memory, rate: Array, step: Array,
    every: int, out: Array,
) -> None:  # fmt: skip
    """`_drive` of one trial."""
    _drive(
        1,
        elements_of(1, friction),
        elements_of(1, compensation),
        memory_of(1, memory),
        rows_of(rate, 1),
        row_of(step),
        every,
        tables_of(out, 1),
    )


@compiled
def drive_block(
    friction: Elements, compensation: Elements, memory: Memory, rate: Array, step: Array,
    every: int, out: Array,
) -> None:  # fmt: skip
    """`_drive` of LANES trials at once."""
    _drive(
        rate.shape[1],  # not LANES: see `engine.advance_block`
        elements_of(LANES, friction),
        elements_of(LANES, compensation),
        memory_of(LANES, memory),
        rows_of(rate, LANES),
        row_of(step),
        every,
        tables_of(out, LANES),
    )


@inlined
def _drive(
    lanes: int,
    friction: Elements,
    compensation: Elements,
    memory: Memory,
    rate: Array,
    step: Array,
    every: int,
    out: Array,
) -> None:
    """Move friction and compensation at a prescribed relative rate, without plant or motor.

    rate: (steps + 1, lanes) rad/s at the step grid.   out: (8, steps / every, lanes), rows as
    OUTPUTS; both rates are the prescribed one and there is no current.
    """
    angle = memory.x[RATE]  # there is no plant, and the angle has the first row for itself
    met, added_to = friction.met[0], compensation.met[0]
    for now in range(rate.shape[0] - 1):
        for k in range(lanes):
            met[MEETS_RATE_START, k], met[MEETS_RATE_END, k] = rate[now, k], rate[now + 1, k]
            added_to[MEETS_RATE_START, k] = rate[now, k]
            added_to[MEETS_RATE_END, k] = rate[now + 1, k]
        for meets in (met, added_to):
            on_a_line(lanes, meets)
            halfway(lanes, angle, meets)
        ask(lanes, friction)
        ask(lanes, compensation)
        first = memory.counters[0] == 0
        if now % every == 0:
            sample = now // every
            for k in range(lanes):
                out[OUT_GYRO, sample, k] = rate[now, k]
                out[OUT_RELATIVE_RATE, sample, k] = rate[now, k]
                out[OUT_LOAD_RATE, sample, k] = rate[now, k]
                out[OUT_ANGLE, sample, k] = angle[k]
                out[OUT_POINTING, sample, k] = angle[k]
                out[OUT_CURRENT, sample, k] = 0.0
            record_torque(lanes, friction, memory.ended[0], first, out[OUT_FRICTION], sample)
            record_torque(
                lanes, compensation, memory.ended[1], first, out[OUT_COMPENSATION], sample
            )
        memory.counters[0] += 1
        keep_ends(lanes, friction, memory.ended[0])
        keep_ends(lanes, compensation, memory.ended[1])
        for k in range(lanes):
            angle[k] += 0.5 * step[k] * (rate[now, k] + rate[now + 1, k])
