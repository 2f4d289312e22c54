"""Dry friction of all lanes: in the plant, and as a compensation.

`campaign.physics.dry_step` has the scheme; this module applies it to the engine's arrays. The
functions are in the order of the engine's calls:

1. Solve the plant's dry friction with all other torques as at the start of the step. The resulting
   rate and motion are the inputs of all other models: equal torques cancel only with one common
   prediction.
2. Compute the lines of the others, including a dry compensation.
3. Recompute the holding line of a step that ends stuck, from all lines; the rest is unchanged.
4. After such a step set the load's rate to the hull's: rounding must not cause sliding.

Each lane branches separately. The engine gets a model's sliding torque by address, like its step
function (`campaign.physics.sliding_torque`).
"""

from __future__ import annotations

import math

from campaign.physics.blocks import Array, Dry, Elements, System
from campaign.physics.compilation import called, inlined
from campaign.physics.dry_step import Limits, Response, crossing, holding_line, step_of
from campaign.physics.elementary import any_of, fma, sin, where
from campaign.physics.friction_lines import AMPLITUDE, PERIODS, PHASE
from campaign.physics.rows import (
    ASKED_DIRECTION,
    ASKED_SPEED,
    CHANGE,
    DRY_BEFORE,
    DRY_BEGINS,
    DRY_CHANGE,
    DRY_DIRECTION,
    DRY_END,
    DRY_ENDED,
    DRY_GAIN,
    DRY_HOLDS_BACKWARDS,
    DRY_HOLDS_FORWARDS,
    DRY_LEAVES,
    DRY_MEAN,
    DRY_MOTION,
    DRY_START,
    DRY_STARTS_BACKWARDS,
    DRY_STARTS_FORWARDS,
    HELD,
    LIMITS,
    MEAN,
    MEETS_PER_STEP,
    MEETS_POSITION,
    MEETS_PUSH,
    MEETS_RATE_END,
    MEETS_RATE_MEAN,
    MEETS_RATE_START,
    MEETS_STEP,
    RATE,
    RELATIVE_ANGLE,
)
from campaign.physics.step_function import call_step
from campaign.physics.vector import each_lane


@inlined
def expect_dry(lanes: int, friction: Elements, by: Array) -> None:
    """Solve dry friction over the step, with all other torques as at its start.

    by: `System.by_friction`. Updates the rates in `friction.met` from those without this friction.
    """
    solve_dry(lanes, friction.dry, each_lane(by), each_lane(friction.met[0]))


@called
def solve_dry(lanes: int, dry: Dry, by: Array, met: Array) -> None:
    """`expect_dry`, lane by lane."""
    state = dry.state
    _limits(lanes, dry, met)
    for k in range(lanes):
        way = -1.0 if state[DRY_DIRECTION, k] < 0.0 else 1.0
        dry.asked[ASKED_DIRECTION, k] = way
        dry.asked[ASKED_SPEED, k] = max(way * met[MEETS_RATE_START, k], 0.0)
    _slide(lanes, dry)
    for k in range(lanes):
        way, v0 = dry.asked[ASKED_DIRECTION, k], met[MEETS_RATE_START, k]
        start = dry.answer[0, k]
        gain = way * (met[MEETS_RATE_END, k] - v0) + by[MEAN, RATE, k] * start
        state[DRY_START, k], state[DRY_GAIN, k] = start, gain
        dry.asked[ASKED_SPEED, k] = max(way * v0 + gain, 0.0)
    _slide(lanes, dry)
    for k in range(lanes):
        # If friction rises with the rate, the corrected rate is linearly implicit: even a steep
        # rise does not carry the rate across zero.
        way, gain = dry.asked[ASKED_DIRECTION, k], state[DRY_GAIN, k]
        rise = dry.answer[0, k] - state[DRY_START, k]
        slope = -0.5 * by[MEAN, RATE, k] * rise / (gain if gain != 0.0 else 1.0)
        gain = gain / (1.0 + slope) if slope > 0.0 else gain * (1.0 - slope)
        dry.asked[ASKED_SPEED, k] = max(way * met[MEETS_RATE_START, k] + gain, 0.0)
    _slide(lanes, dry)
    for k in range(lanes):
        done = step_of(
            state[DRY_DIRECTION, k],
            met[MEETS_RATE_START, k],
            met[MEETS_RATE_END, k],
            met[MEETS_RATE_MEAN, k] * met[MEETS_STEP, k],
            met[MEETS_STEP, k],
            _response(k, by),
            _limits_towards(k, state),
            state[DRY_START, k],
            dry.answer[0, k],
        )
        state[DRY_BEFORE, k], state[DRY_DIRECTION, k] = state[DRY_DIRECTION, k], done.direction
        state[DRY_MEAN, k], state[DRY_CHANGE, k] = done.mean, done.change
        state[DRY_START, k], state[DRY_END, k] = done.start, done.end
        state[DRY_LEAVES, k], state[DRY_BEGINS, k] = done.leaves, done.begins
        state[DRY_MOTION, k] = done.motion
        met[MEETS_RATE_END, k] = done.rate_end
        met[MEETS_RATE_MEAN, k] = done.motion * met[MEETS_PER_STEP, k]
        met[MEETS_PUSH, k] -= done.mean


@inlined
def expect_filtered(system: System, plant: Array, met: Array) -> None:
    """`expect_dry` for compensation behind a low-pass. plant: `Dry.numbers` of its friction."""
    by, seen = system.by_friction, system.seen
    more = fma(by[CHANGE, seen], plant[DRY_CHANGE], by[MEAN, seen] * plant[DRY_MEAN])
    met[MEETS_RATE_END] = met[MEETS_RATE_END] + more
    held_back = system.low_pass * more * met[MEETS_PER_STEP]
    met[MEETS_RATE_MEAN] = met[MEETS_RATE_MEAN] - held_back


@inlined
def feed_forward(lanes: int, follows: bool, plant: Dry, compensation: Elements) -> None:
    """Equation 4.6 as a compensation, s(v) sgn(v) with sgn(0) = 0.

    follows: the plant is dry and compensation uses its rate. Then the directions are those of the
    plant, and compensation is zero while it sticks. Else they are the signs of the rate. A jump
    inside the step enters by its mean and first moment.
    """
    met, answer = each_lane(compensation.met[0]), each_lane(compensation.answer)
    _feed_forward(lanes, follows, plant.state, compensation.dry, met, answer)


@called
def _feed_forward(
    lanes: int, follows: bool, plant: Array, fed: Dry, met: Array, answer: Array
) -> None:
    state = fed.state
    _limits(lanes, fed, met)
    for k in range(lanes):
        v0, v1 = met[MEETS_RATE_START, k], met[MEETS_RATE_END, k]
        if follows:
            before, after = plant[DRY_BEFORE, k], plant[DRY_DIRECTION, k]
            leaves, begins = plant[DRY_LEAVES, k], plant[DRY_BEGINS, k]
        else:
            before, after = _sign(v0), _sign(v1)
            crossed = crossing(v0, v1, met[MEETS_RATE_MEAN, k])
            leaves = crossed if before != after else 1.0
            begins = leaves
        state[DRY_BEFORE, k], state[DRY_DIRECTION, k] = before, after
        state[DRY_LEAVES, k], state[DRY_BEGINS, k] = leaves, begins
        fed.asked[ASKED_DIRECTION, k] = -1.0 if before < 0.0 else 1.0
        fed.asked[ASKED_SPEED, k] = max(before * v0, 0.0)
    _slide(lanes, fed)
    for k in range(lanes):
        after = state[DRY_DIRECTION, k]
        state[DRY_START, k] = state[DRY_BEFORE, k] * fed.answer[0, k]
        fed.asked[ASKED_DIRECTION, k] = -1.0 if after < 0.0 else 1.0
        fed.asked[ASKED_SPEED, k] = max(after * met[MEETS_RATE_END, k], 0.0)
    _slide(lanes, fed)
    for k in range(lanes):
        before, after = state[DRY_BEFORE, k], state[DRY_DIRECTION, k]
        leaves, begins = state[DRY_LEAVES, k], state[DRY_BEGINS, k]
        start, end = state[DRY_START, k], after * fed.answer[0, k]
        state[DRY_END, k] = end
        first = 0.5 * (start + before * _starts(k, state, before)) * leaves
        last = 0.5 * (end + after * _starts(k, state, after)) * (1.0 - begins)
        jumps = before != after or leaves < 1.0
        state[DRY_MEAN, k] = first + last if jumps else 0.5 * (start + end)
        bent = 6.0 * (last * begins - first * (1.0 - leaves))
        state[DRY_CHANGE, k] = bent if jumps else end - start
        answer[HELD, k] += end


@inlined
def hold_again(
    system: System,
    friction: Elements,
    compensation: Elements,
    known: Array,
    new: Array,
    base_end: float,
) -> None:
    """Recompute the line of a step that ends stuck, from the lines of all other models.

    known, new: as in the engine.   base_end: rate of the hull at the end of the step (rad/s).
    """
    dry, fed = friction.dry.numbers, compensation.dry.numbers
    stuck = dry[DRY_DIRECTION] == 0.0
    if any_of(stuck):
        by, own = system.by_friction, friction.answer
        also, added = system.by_compensation, compensation.answer
        mean, change = added[MEAN] + fed[DRY_MEAN], added[CHANGE] + fed[DRY_CHANGE]
        ended = _with_line(RATE, by, own[MEAN], own[CHANGE], new[RATE])
        ended = _with_line(RATE, also, mean, change, ended) - base_end
        angle = _with_line(RELATIVE_ANGLE, by, own[MEAN], own[CHANGE], new[RELATIVE_ANGLE])
        angle = _with_line(RELATIVE_ANGLE, also, mean, change, angle)
        turned = angle - known[RELATIVE_ANGLE] - dry[DRY_MOTION]
        response = Response(
            -by[MEAN, RATE],
            -by[CHANGE, RATE],
            -by[MEAN, RELATIVE_ANGLE],
            -by[CHANGE, RELATIVE_ANGLE],
        )
        mean, change = holding_line(ended, turned, response)
        dry[DRY_MEAN] = where(stuck, mean, dry[DRY_MEAN])
        dry[DRY_CHANGE] = where(stuck, change, dry[DRY_CHANGE])
        throughout = stuck & (dry[DRY_BEFORE] == 0.0)
        dry[DRY_START] = where(throughout, mean - 0.5 * change, dry[DRY_START])
        dry[DRY_END] = where(throughout, mean + 0.5 * change, dry[DRY_END])


@inlined
def dry_torque_as_it_begins(dry: Array, first: bool) -> float:
    """Torque at the start of a step (N m). dry: `Dry.numbers`.   first: it is the first step."""
    start = dry[DRY_START]
    torque: float = where(first, start, 0.5 * (start + dry[DRY_ENDED]))
    return torque


@inlined
def add_line(elements: Elements) -> None:
    """Add the dry line to the lines of the other models; keep its end for the next record."""
    answer, dry = elements.answer, elements.dry.numbers
    answer[MEAN] = answer[MEAN] + dry[DRY_MEAN]
    answer[CHANGE] = answer[CHANGE] + dry[DRY_CHANGE]
    dry[DRY_ENDED] = dry[DRY_END]


@inlined
def rest(dry: Array, base_end: float, known: Array) -> None:
    """Set the rate of a stuck load to the hull's rate, except in a lane that has diverged."""
    stuck = (dry[DRY_DIRECTION] == 0.0) & (abs(known[RATE] - base_end) < math.inf)
    known[RATE] = where(stuck, base_end, known[RATE])


@inlined
def _slide(lanes: int, dry: Dry) -> None:
    """Sum all sliding torques into `dry.answer`, for direction and speed in `dry.asked`."""
    for k in range(lanes):
        dry.answer[0, k] = 0.0
    for e in range(dry.address.shape[0]):
        call_step(
            dry.address[e], dry.fixed_at[e], dry.wave_at[e], dry.asked_at, dry.answer_at
        )  # fmt: skip


@inlined
def _limits(lanes: int, dry: Dry, met: Array) -> None:
    """Sum all limits at the position in the middle of the step, with ripples."""
    for row in range(LIMITS):
        for k in range(lanes):
            dry.state[DRY_HOLDS_FORWARDS + row, k] = 0.0
    for e in range(dry.address.shape[0]):
        if dry.rippled[e] > 0:
            for k in range(lanes):
                turned = dry.ripple[e, PERIODS, k] * met[MEETS_POSITION, k]
                wave = sin(turned + dry.ripple[e, PHASE, k])
                dry.wave[e, 0, k] = 1.0 + dry.ripple[e, AMPLITUDE, k] * wave
        for row in range(LIMITS):
            for k in range(lanes):
                dry.state[DRY_HOLDS_FORWARDS + row, k] += dry.wave[e, 0, k] * dry.limits[e, row, k]


@inlined
def _limits_towards(k: int, state: Array) -> Limits:
    """Limits of lane `k`, in its direction."""
    back = state[DRY_DIRECTION, k] < 0.0
    holds, holds_back = state[DRY_HOLDS_FORWARDS, k], state[DRY_HOLDS_BACKWARDS, k]
    starts, starts_back = state[DRY_STARTS_FORWARDS, k], state[DRY_STARTS_BACKWARDS, k]
    return Limits(
        holds_back if back else holds,
        holds if back else holds_back,
        starts_back if back else starts,
        starts if back else starts_back,
    )


@inlined
def _starts(k: int, state: Array, direction: float) -> float:
    """Torque of the slowest sliding in a direction (N m, unsigned)."""
    backwards = direction < 0.0
    row = DRY_STARTS_BACKWARDS if backwards else DRY_STARTS_FORWARDS
    return float(state[row, k])


@inlined
def _response(k: int, by: Array) -> Response:
    """Response of lane `k`; friction opposes the motion, so the columns are negative."""
    return Response(
        -by[MEAN, RATE, k],
        -by[CHANGE, RATE, k],
        -by[MEAN, RELATIVE_ANGLE, k],
        -by[CHANGE, RELATIVE_ANGLE, k],
    )


@inlined
def _with_line(row: int, by: Array, mean: float, change: float, ended: float) -> float:
    """State at the end of the step, with an additional torque line."""
    total: float = fma(by[CHANGE, row], change, fma(by[MEAN, row], mean, ended))
    return total


@inlined
def _sign(v: float) -> float:
    return 1.0 if v > 0.0 else (-1.0 if v < 0.0 else 0.0)
