"""The engine without a plant: friction and compensation with a prescribed motion."""

from __future__ import annotations

from typing import Any

from campaign.physics.blocks import Array, Elements, Memory, elements_of, memory_of
from campaign.physics.compilation import entry
from campaign.physics.friction_lines import (
    ask,
    end_of_line,
    halfway,
    on_a_line,
    torque_as_it_begins,
)
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
from campaign.physics.vector import LANES, by_lanes, number_by_lanes


def _driving(lanes: int) -> Any:
    """`drive` for a number of lanes."""

    def drive(
        friction: Elements,
        compensation: Elements,
        memory: Memory,
        rate: Array,
        step: Array,
        every: int,
        out: Array,
    ) -> None:
        """Advance friction and compensation at a prescribed relative rate, without plant, motor.

        rate: (steps + 1,) rad/s at the step grid.   step: s.   out: (8, steps / every), rows as
        OUTPUTS; both rates are the prescribed one and there is no current.
        """
        memory = memory_of(lanes, memory)
        friction, compensation = elements_of(lanes, friction), elements_of(lanes, compensation)
        rate, step, out = by_lanes(rate, lanes), number_by_lanes(step, lanes), by_lanes(out, lanes)
        angle = memory.x[RATE]  # without a plant, the first row contains the angle
        for now in range(rate.shape[0] - 1):
            for met in (friction.met[0], compensation.met[0]):
                met[MEETS_RATE_START], met[MEETS_RATE_END] = rate[now], rate[now + 1]
                on_a_line(met)
                halfway(angle, met)
            ask(friction)
            ask(compensation)
            if now % every == 0:
                first, place = memory.counters[0] == 0, now // every
                out[OUT_GYRO, place] = rate[now]
                out[OUT_RELATIVE_RATE, place] = rate[now]
                out[OUT_LOAD_RATE, place] = rate[now]
                out[OUT_ANGLE, place] = angle
                out[OUT_POINTING, place] = angle
                out[OUT_CURRENT, place] = 0.0
                out[OUT_FRICTION, place] = torque_as_it_begins(friction, memory.ended[0], first)
                out[OUT_COMPENSATION, place] = torque_as_it_begins(
                    compensation, memory.ended[1], first
                )
            memory.counters[0] += 1
            memory.ended[0], memory.ended[1] = end_of_line(friction), end_of_line(compensation)
            angle = angle + 0.5 * step * (rate[now] + rate[now + 1])
        memory.x[RATE] = angle

    drive.__qualname__ = "drive_one" if lanes == 1 else "drive_block"  # names its file
    return entry(drive)


drive_one, drive_block = _driving(1), _driving(LANES)
