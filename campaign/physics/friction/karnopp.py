"""Karnopp friction: static friction with a band of rates around zero (section 3.3.2.2).

D. Karnopp, *Computer simulation of stick-slip friction in mechanical dynamic systems*, J. Dyn.
Sys., Meas., Control 107 (1985) 100. Within |v| < DV friction is the smaller of the torque that
keeps the load at rest and the breakaway torque Ts; outside it is s(v) sgn(v) + sigma2 v (Eq. 3.3).

**Caution.** In the print the band's output rate is zero while the internal rate is not: the
integrator keeps a momentum below J DV, and the angle is constant. Here a load has one rate, so
friction first has to bring it to rest: while it moves within the band, friction is the breakaway
torque Ts; at rest it balances the applied torque, up to Ts. Both agree as DV goes to 0, where they
are Equation 3.3. The engine determines stopping and breakaway within a step, as for every dry
model (`campaign.physics.dry_step`). So there is no chatter, and numerics need no band. A step that
crosses the jump of s at DV is of first order.

It states no unknowns: the residual of a fit jumps with DV, searches end in local optima, and over
24 rigs 4 of 13 intervals of Ts included the true value, of vs none.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydantic import Field

from campaign.physics.compilation import pasted
from campaign.physics.elementary import where
from campaign.physics.friction.interface import Array, DryFriction, FrictionModel, SmallSignal
from campaign.physics.friction.path import sign_of
from campaign.physics.friction.stribeck import (
    CURVE,
    CurveOptions,
    curve_parameters,
    curve_torque,
    in_direction,
    mean_viscous,
)
from campaign.physics.friction.stribeck import steady_state as stribeck_steady_state
from campaign.physics.step_function import Motion
from campaign.units import AngularRate


class KarnoppOptions(CurveOptions):
    """Parameters of Karnopp friction."""

    model: Literal["karnopp"]
    """Karnopp friction."""
    zero_band: AngularRate = Field(gt=0)
    """DV: below this rate friction stops the load and holds it, with at most Ts."""


def _parameters(options: KarnoppOptions) -> Array:
    return np.array([*curve_parameters(options), options.zero_band])


@pasted
def _size(parameters: Any, direction: float, speed: float) -> Any:
    """Ts within the band, s(v) outside (N m)."""
    static = where(direction >= 0.0, parameters[1], parameters[5])
    within = speed < parameters[9]
    return where(within, static, curve_torque(parameters, direction, speed))


def _step(parameters: Any, state: Any, motion: Motion) -> tuple[float, float]:
    """See `campaign.physics.step_function`: for a prescribed motion, at its mean rate."""
    v0, v1 = motion.rate_start, motion.rate_end
    v, path = 0.5 * (v0 + v1), abs(v0) + abs(v1)
    size = _size(parameters, where(v >= 0.0, 1.0, -1.0), abs(v))
    sign = where(v0 * v1 < 0.0, (v0 + v1) / where(path > 0.0, path, 1.0), sign_of(v))
    return size * sign + parameters[8] * abs(v), 0.0


def _sliding(parameters: Any, direction: float, speed: float) -> float:
    """See `campaign.physics.sliding_torque`."""
    torque: float = _size(parameters, direction, speed) + direction * parameters[8] * speed
    return torque


def steady_state(options: KarnoppOptions, velocity: Array) -> Array:
    """Friction torque (N m) at `velocity` (rad/s), shape (n,): Ts within the band."""
    torque = stribeck_steady_state(options, velocity)
    for sign in (+1.0, -1.0):
        within = (velocity * sign > 0) & (np.abs(velocity) < options.zero_band)
        viscous = in_direction(options, "viscous_friction", sign) * velocity[within]
        torque[within] = sign * in_direction(options, "static_torque", sign) + viscous
    return torque


FRICTION = FrictionModel(
    name="karnopp",
    summary="static: Stribeck friction with a rate band in which it stops and holds the load",
    options=KarnoppOptions,
    parameters=_parameters,
    state_size=lambda options, step: 0,
    step=_step,
    viscous=mean_viscous,
    steady_state=steady_state,
    switches=lambda options: 3,
    changeable=(*CURVE, "zero_band"),
    small_signal=lambda options: SmallSignal(stuck=None, stuck_compensation=None),
    stored_energy=lambda options, state: 0.0,
    dry=DryFriction(
        sliding=_sliding,
        static_torque=lambda options, direction: in_direction(options, "static_torque", direction),
    ),
    no_compensation=(
        "within its band it is the torque that acts on the load, which a controller does not know; "
        "outside it is 'stribeck'"
    ),
)
