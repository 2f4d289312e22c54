"""One step of dry friction: sliding, stuck, or an event, to second order.

Dry friction is a set at rest, |T| <= Ts, and s(v) sgn(v) when sliding (Equation 4.6). Parallel dry
interfaces share one relative rate, so they slide and stick together: the sum of their curves is
one curve, the sum of their static torques one static torque. What is kept from step to step is the
direction of sliding: 1, -1, or 0 for stuck.

A step knows the relative rate v0 where it begins, what rate v1 and motion q it would end with
without this friction, and how both answer to a torque that is a straight line over the step:

    v(h) = v1 - (a mean + b change)      q(h) = q - (c mean + d change)       (`Response`)

Solved for the line, this gives the *holding line*: the one that leads to a wanted rate and motion.
It is the applied torque with its mean and first moment over the step. Three things can happen:

- Sliding on. The line goes from s(v0) to s(v(h)), the trapezoidal rule, with v(h) predicted from
  s(v0) and corrected once.
- Stopping, at the share p of the step: v(h) would change its sign. p is where the parabola through
  v0, v(h) and the motion crosses zero. If friction can hold what then acts, the rest of the step is
  stuck: it is the holding line to rate 0 and motion v0 p h / 2, so that rate and angle are right
  although the torque jumps inside the step. If it can not, friction turns round at p: two
  constants, entered as the line of their mean and first moment.
- Stuck: the holding line to rate 0 and motion 0. Where that line leaves -Ts .. Ts, it breaks away:
  what lies beyond Ts is taken off, again by its mean and first moment, and where the slowest
  sliding has less torque than rest, so is the difference from then on.

With both moments right, a step with an event is off by third order, as the trapezoidal rule is in
a step without. A constant that brings the rate to zero by the end of the step (Moreau's time
stepping) is off by second order in the angle.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from campaign.physics.compilation import called


class Response(NamedTuple):
    """How much the relative rate and angle at the end of a step fall per N m of friction."""

    rate_mean: float
    rate_change: float
    angle_mean: float
    angle_change: float


class Limits(NamedTuple):
    """Torques (N m, unsigned) about rest, in the direction of sliding (when stuck, forwards).

    holds: the most before it slides that way.   starts: of the slowest sliding.
    ..._back: the same the other way.
    """

    holds: float
    holds_back: float
    starts: float
    starts_back: float


class DryStep(NamedTuple):
    """What dry friction does over one step.

    Attributes:
        mean, change: the torque line (N m), without the linear viscous part.
        start, end: torque when the step begins and when it ends (N m), never beyond Ts; the line's
            own ends may be where the line stands for a jump. A recorder takes the mean of the end
            of one step and the start of the next: the inputs' straight lines make each lag.
        direction: of sliding when the step ends; 0: stuck.
        rate_end: relative rate then (rad/s); 0 when stuck.
        motion: relative angle that the step moves by (rad).
        leaves: share of the step at which the direction that it began with ends; 1 if it does not.
        begins: share of the step at which the direction that it ends with begins.
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
    """Mean and change of the torque line that takes `rate` and `motion` off the end of a step."""
    per = 1.0 / (
        response.rate_mean * response.angle_change - response.rate_change * response.angle_mean
    )
    return (
        per * (response.angle_change * rate - response.rate_change * motion),
        per * (response.rate_mean * motion - response.angle_mean * rate),
    )


@called
def crossing(v0: float, v1: float, mean_rate: float) -> float:
    """Share of a step at which a rate from v0 to v1, of other sign, is zero; in 0 .. 1.

    The root of v0 + (v1 - v0) u - bend u (1 - u), by Newton's method from the straight line's: one
    step leaves what is of third order in the step.
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
    """What of a line from `first` to `last` lies beyond least .. most.

    Its mean and its change, as of the line with the same first moment; its sign, 0 if nothing does;
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
    """The step from relative rate v0; v1 and `motion` are what it ends with without this friction.

    start, end: sliding torques (N m, unsigned) at v0 and at the rate that sliding on leads to. No
    branch that could not be a choice between numbers that are there already.
    """
    stuck = direction == 0.0
    way = -1.0 if direction < 0.0 else 1.0
    low = limits.holds_back if way > 0.0 else limits.holds
    high = limits.holds if way > 0.0 else limits.holds_back

    # Sliding on.
    mean, change = way * 0.5 * (start + end), way * (end - start)
    reached = v1 - response.rate_mean * mean - response.rate_change * change
    moved = motion - response.angle_mean * mean - response.angle_change * change
    slides = not stuck and way * reached > 0.0

    # Stopping, and holding what is left.
    part = 0.0 if stuck else crossing(v0, reached, moved / step)
    stopped = 0.5 * v0 * part * step
    hold, slope = holding_line(v1, motion - stopped, response)

    # Turning round, where in the rest of the step that would be more than friction can hold.
    until = way * 0.5 * (start + limits.starts)
    left = way * (hold - until * part)
    too_much = left < -limits.holds_back * (1.0 - part) or left > limits.holds * (1.0 - part)
    turns = not stuck and not slides and too_much
    after = -way * limits.starts_back if left < 0.0 else way * limits.starts
    turned = until * part + after * (1.0 - part)
    jump = 6.0 * (after - until) * part * (1.0 - part)

    # Breaking away: what is beyond the limits is not held, and sliding may take less than rest.
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
