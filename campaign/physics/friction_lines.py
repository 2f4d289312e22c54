"""Torque lines of all friction models of a block over a step."""

from __future__ import annotations

from campaign.physics.blocks import Array, Elements
from campaign.physics.compilation import inlined
from campaign.physics.elementary import fma, sin, where
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
def ask(elements: Elements) -> None:
    """Sum all torque lines into `elements.answer`, for the motion in `elements.met`."""
    answer = elements.answer
    answer[MEAN], answer[CHANGE], answer[HELD] = 0.0, 0.0, 0.0
    for e in range(elements.address.shape[0]):
        side = elements.motor_side[e]
        met, ripple = elements.met[side], elements.ripple[e]
        if elements.rippled[e] > 0:
            wave = sin(ripple[PERIODS] * met[MEETS_POSITION] + ripple[PHASE])
            met[MEETS_RIPPLE] = 1.0 + ripple[AMPLITUDE] * wave
        call_step(
            elements.address[e],
            elements.fixed_at[e],
            elements.kept_at[e],
            elements.met_at[side],
            elements.answer_at,
        )
        if elements.rippled[e] > 0:
            met[MEETS_RIPPLE] = 1.0


@inlined
def on_a_line(met: Array) -> None:
    """Set the mean of a rate that is a straight line over the step."""
    met[MEETS_RATE_MEAN] = 0.5 * (met[MEETS_RATE_START] + met[MEETS_RATE_END])


@inlined
def halfway(angle: float, met: Array) -> None:
    """Set the angle in the middle of the step, from the angle at its start (rad)."""
    way = 3.0 * met[MEETS_RATE_START] + met[MEETS_RATE_END]
    met[MEETS_POSITION] = angle + 0.125 * met[MEETS_STEP] * way


@inlined
def torque_as_it_begins(elements: Elements, ended: float, first: bool) -> float:
    """Torque of all models, linear part included, at the start of a step (N m).

    ended: end of the previous line; in the first step the initial torque, or NaN if it is unknown.
    The two lines need not meet at this point: their mean has no lag.
    """
    answer, met = elements.answer, elements.met[0]
    start = answer[MEAN] - 0.5 * answer[CHANGE]
    between = where(first, ended, 0.5 * (ended + start))
    torque: float = where(ended == ended, between, start)
    for e in range(elements.viscous.shape[0]):
        torque = fma(elements.viscous[e], met[MEETS_RATE_START], torque)
    return torque


@inlined
def end_of_line(elements: Elements) -> float:
    """End of the torque line, for the next record (N m)."""
    end: float = elements.answer[MEAN] + 0.5 * elements.answer[CHANGE]
    return end
