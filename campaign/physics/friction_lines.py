"""Asking every friction model of a block for its torque line over a step."""

from __future__ import annotations

from campaign.physics.blocks import Array, Elements
from campaign.physics.compiled import inlined
from campaign.physics.elementary import fma, sin
from campaign.physics.rows import (
    CHANGE,
    HELD,
    MEAN,
    MEETS_POSITION,
    MEETS_RATE_END,
    MEETS_RATE_MEAN,
    MEETS_RATE_START,
    MEETS_RIPPLE,
    MEETS_STEP,
)
from campaign.physics.step_function import call_step

AMPLITUDE, PERIODS, PHASE = range(3)


@inlined
def ask(lanes: int, elements: Elements) -> None:
    """The sum of all lines, in `elements.answer`; what they meet stands in `elements.met`."""
    answer = elements.answer
    for k in range(lanes):
        answer[MEAN, k], answer[CHANGE, k], answer[HELD, k] = 0.0, 0.0, 0.0
    for e in range(elements.viscous.shape[0]):
        side = elements.motor_side[e]
        met = elements.met[side]
        if elements.rippled[e] > 0:
            for k in range(lanes):
                turned = elements.ripple[e, PERIODS, k] * met[MEETS_POSITION, k]
                wave = sin(turned + elements.ripple[e, PHASE, k])
                met[MEETS_RIPPLE, k] = 1.0 + elements.ripple[e, AMPLITUDE, k] * wave
        call_step(
            elements.address[e],
            elements.fixed_at[e],
            elements.kept_at[e],
            elements.met_at[side],
            elements.answer_at,
        )
        if elements.rippled[e] > 0:
            for k in range(lanes):
                met[MEETS_RIPPLE, k] = 1.0


@inlined
def on_a_line(lanes: int, met: Array) -> None:
    """The mean of a rate that is a straight line over the step."""
    for k in range(lanes):
        met[MEETS_RATE_MEAN, k] = 0.5 * (met[MEETS_RATE_START, k] + met[MEETS_RATE_END, k])


@inlined
def halfway(lanes: int, angle: Array, met: Array) -> None:
    """Put the angle (lanes,) in the middle of the step, from the one when it begins (rad)."""
    for k in range(lanes):
        way = 3.0 * met[MEETS_RATE_START, k] + met[MEETS_RATE_END, k]
        met[MEETS_POSITION, k] = angle[k] + 0.125 * met[MEETS_STEP, k] * way


@inlined
def record_torque(
    lanes: int, elements: Elements, ended: Array, first: bool, out: Array, sample: int
) -> None:
    """The torque of all models, its linear part included, as a step begins: into out[sample].

    ended: (lanes,) where the line before ended; in the first step, what the torque is when it
    begins, or NaN where nobody knows. The lines that end and begin here need not meet: their mean
    lags by nothing.
    """
    answer, met = elements.answer, elements.met[0]
    for k in range(lanes):
        start = answer[MEAN, k] - 0.5 * answer[CHANGE, k]
        known = ended[k] == ended[k]
        between = ended[k] if first else 0.5 * (ended[k] + start)
        out[sample, k] = between if known else start
    for e in range(elements.viscous.shape[0]):
        for k in range(lanes):
            out[sample, k] = fma(elements.viscous[e, k], met[MEETS_RATE_START, k], out[sample, k])


@inlined
def keep_ends(lanes: int, elements: Elements, ended: Array) -> None:
    """Where the lines end, for the next record."""
    answer = elements.answer
    for k in range(lanes):
        ended[k] = answer[MEAN, k] + 0.5 * answer[CHANGE, k]
