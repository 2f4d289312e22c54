"""One step of dry friction: sliding, stuck, or an event, to second order.

Dry friction is a set at rest, |T| <= Ts, and s(v) sgn(v) in sliding (Equation 4.6). Parallel dry
interfaces share one relative rate, so they slide and stick together: the sum of their curves is
one curve, the sum of their static torques one static torque. The state from step to step is the
direction of sliding: 1, -1, or 0 for stuck.

Inputs of a step are the relative rate v0 at its start, rate v1 and motion q at its end without this
friction, and the response of both to a torque that is a straight line over the step:

    v(h) = v1 - (a mean + b change)      q(h) = q - (c mean + d change)       (`Response`)

Solved for the line, this gives the *holding line*, which results in a given rate and motion. It is
the applied torque with its mean and first moment over the step. There are three cases:

- Continued sliding. The line goes from s(v0) to s(v(h)), the trapezoidal rule, with v(h) predicted
  from s(v0) and corrected once.
- Stopping at the share p of the step: v(h) would change its sign. p is the zero of the parabola
  through v0, v(h) and the motion. If friction can hold the applied torque, the rest of the step is
  stuck: the holding line to rate 0 and motion v0 p h / 2, so that rate and angle are right although
  the torque jumps inside the step. If it cannot, friction reverses at p: two constants, represented
  by the line of their mean and first moment.
- Stuck: the holding line to rate 0 and motion 0. If that line leaves -Ts .. Ts, the load breaks
  away. The part beyond Ts is subtracted, again by its mean and first moment. If the slowest sliding
  has less torque than rest, the difference is subtracted from then on, too.

With both moments, the error of a step with an event is of third order, like that of the trapezoidal
rule in a step without. A constant that brings the rate to zero at the end of the step (Moreau's
time stepping) has an error of second order in the angle.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from campaign.physics.compilation import called


class Response(NamedTuple):
    """Decrease of relative rate and angle at the end of a step per N m of friction."""

    rate_mean: float
    rate_change: float
    angle_mean: float
    angle_change: float


class Limits(NamedTuple):
    """Torques (N m, unsigned) near rest, in the direction of sliding (if stuck, forwards).

    holds: largest torque before sliding.   starts: torque of the slowest sliding.
    ..._back: the same in the other direction.
    """

    holds: float
    holds_back: float
    starts: float
    starts_back: float


class DryStep(NamedTuple):
    """Result of dry friction for one step.

    Attributes:
        mean, change: the torque line (N m), without the linear viscous part.
        start, end: torque at the start and end of the step (N m), never beyond Ts; the ends of a
            line that represents a jump can be. A recorder uses the mean of the end of one step and
            the start of the next: the straight lines of the inputs cause a lag of each.
        direction: of sliding at the end of the step; 0: stuck.
        rate_end: relative rate then (rad/s); 0 if stuck.
        motion: change of the relative angle over the step (rad).
        leaves: share of the step at which the initial direction ends; 1 if it does not.
        begins: share of the step at which the final direction begins.
    """

    mean: float
    change: float
    start: float
    end: float
    direction: float
    rate_end: float
    motion: float
    leaves: float
    begins: float


@called
def holding_line(rate: float, motion: float, response: Response) -> tuple[float, float]:
    """Mean and change of the torque line that reduces rate and motion by `rate` and `motion`."""
    per = 1.0 / (
        response.rate_mean * response.angle_change - response.rate_change * response.angle_mean
    )
    return (
        per * (response.angle_change * rate - response.rate_change * motion),
        per * (response.rate_mean * motion - response.angle_mean * rate),
    )


@called
def crossing(v0: float, v1: float, mean_rate: float) -> float:
    """Share of a step at which a rate from v0 to v1, of opposite sign, is zero; in 0 .. 1.

    Root of v0 + (v1 - v0) u - bend u (1 - u), by one Newton step from the root of the straight
    line; the error is of third order in the step.
    """
    fall = v1 - v0
    part = -v0 / (fall if fall != 0.0 else 1.0)
    bend = 3.0 * (v0 + v1) - 6.0 * mean_rate
    tangent = fall - bend * (1.0 - 2.0 * part)
    part += bend * part * (1.0 - part) / (tangent if tangent != 0.0 else 1.0)
    return min(max(part, 0.0), 1.0)


@called
def beyond(
    first: float, last: float, least: float, most: float
) -> tuple[float, float, float, float]:
    """Part of a line from `first` to `last` beyond least .. most.

    Returns mean and change of the line with the same first moment; its sign, 0 without such a part;
    and the share of the step at which it begins.
    """
    over_first = first - min(max(first, least), most)
    over_last = last - min(max(last, least), most)
    over = over_last if over_last != 0.0 else over_first
    whole = over_first != 0.0 and over_last != 0.0
    span = abs(last - first)
    share = 1.0 if whole else abs(over) / (span if span > 0.0 else 1.0)
    mean = 0.5 * (over_first + over_last) * share
    change = (over_last - over_first) * share * (3.0 - 2.0 * share)
    sign = math.copysign(1.0, mean) if over != 0.0 else 0.0
    return mean, change, sign, 1.0 - share if over_first == 0.0 else 0.0


@called
def step_of(
    direction: float,
    v0: float,
    v1: float,
    motion: float,
    step: float,
    response: Response,
    limits: Limits,
    start: float,
    end: float,
) -> DryStep:
    """Solve a step from relative rate v0; v1 and `motion`: its end without this friction.

    start, end: sliding torques (N m, unsigned) at v0 and at the end of continued sliding. Every
    branch is a choice between computed numbers.
    """
    stuck = direction == 0.0
    way = -1.0 if direction < 0.0 else 1.0
    low = limits.holds_back if way > 0.0 else limits.holds
    high = limits.holds if way > 0.0 else limits.holds_back

    # Continued sliding.
    mean, change = way * 0.5 * (start + end), way * (end - start)
    reached = v1 - response.rate_mean * mean - response.rate_change * change
    moved = motion - response.angle_mean * mean - response.angle_change * change
    slides = not stuck and way * reached > 0.0

    # Stopping, and holding over the rest of the step.
    part = 0.0 if stuck else crossing(v0, reached, moved / step)
    stopped = 0.5 * v0 * part * step
    hold, slope = holding_line(v1, motion - stopped, response)

    # Reversal, if the rest of the step needs more torque than friction can hold.
    until = way * 0.5 * (start + limits.starts)
    left = way * (hold - until * part)
    too_much = left < -limits.holds_back * (1.0 - part) or left > limits.holds * (1.0 - part)
    turns = not stuck and not slides and too_much
    after = -way * limits.starts_back if left < 0.0 else way * limits.starts
    turned = until * part + after * (1.0 - part)
    jump = 6.0 * (after - until) * part * (1.0 - part)

    # Breakaway: torque beyond the limits is not held, and sliding can need less than rest.
    first, last = hold - 0.5 * slope, hold + 0.5 * slope
    excess, bent, broken, began = beyond(first, last, -low, high)
    least = limits.holds - limits.starts if broken > 0.0 else limits.holds_back - limits.starts_back
    drop = broken * least * (1.0 - began)
    excess, bent = (excess + drop, bent + 6.0 * drop * began) if stuck else (0.0, 0.0)
    held = last if stuck else way * left / max(1.0 - part, 1e-9)
    held = min(max(held, -low), high) - (broken * least if stuck else 0.0)

    mean = mean if slides else (turned if turns else hold - excess)
    change = change if slides else (jump if turns else slope - bent)
    moves = slides or turns or (stuck and broken != 0.0)
    onward = direction if slides else (broken if stuck else math.copysign(1.0, after))
    reached = v1 - response.rate_mean * mean - response.rate_change * change
    moved = motion - response.angle_mean * mean - response.angle_change * change
    return DryStep(
        mean=mean,
        change=change,
        start=min(max(first, -low), high) if stuck else way * start,
        end=way * end if slides else held,
        direction=onward if moves else 0.0,
        rate_end=reached if moves else 0.0,
        motion=moved if moves else stopped,
        leaves=1.0 if slides else part,
        begins=began if stuck else (part if turns else 1.0),
    )
