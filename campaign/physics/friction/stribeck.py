"""Static Stribeck friction: T = (Tc + (Ts - Tc) exp(-|v/vs|^delta)) sgn(v) + sigma2 v (Eq. 4.6).

At rest the model is a set, |T| <= Ts. As a plant's friction it is therefore solved implicitly over
a step (Moreau's time stepping: T is what brings the velocity to zero, if the friction can give
that much); as a compensation, where the velocity does not answer within the step, it is Eq. 4.6.
"""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
from pydantic import Field

from campaign.physics.friction.interface import Array, FrictionModel, FrictionOptions
from campaign.units import AngularRate, RotationalDamping, Torque


class StribeckOptions(FrictionOptions):
    """Parameters of static Stribeck friction."""

    model: Literal["stribeck"]
    """Static Stribeck friction."""
    coulomb_torque: Torque = Field(ge=0)
    """Tc: friction of fast sliding, without the viscous part."""
    static_torque: Torque = Field(ge=0)
    """Ts: friction at the onset of sliding. Real axes with Ts < Tc exist."""
    stribeck_velocity: AngularRate = Field(gt=0)
    """vs: velocity over which friction falls from Ts to Tc."""
    stribeck_exponent: float = Field(default=2.0, gt=0, le=10)
    """delta: shape of that fall."""
    viscous_friction: RotationalDamping = Field(default=0.0, ge=0)
    """sigma2: friction proportional to velocity."""
    sign_smoothing: AngularRate = Field(default=0.0, ge=0)
    """Velocity over which sgn(v) is smoothed to tanh(v / this); 0 for a jump."""


def stribeck_curve(options: Any, velocity: Array) -> Array:
    """s(v) of Eq. 4.4 (N m), shape (n,): friction of steady sliding, unsigned, without sigma2."""
    fall = np.exp(-(np.abs(velocity / options.stribeck_velocity) ** options.stribeck_exponent))
    return np.asarray(
        options.coulomb_torque + (options.static_torque - options.coulomb_torque) * fall
    )


def _parameters(options: StribeckOptions) -> Array:
    return np.array(
        [
            options.coulomb_torque,
            options.static_torque,
            options.stribeck_velocity,
            options.stribeck_exponent,
            options.sign_smoothing,
        ]
    )


def _step(
    parameters: Any, state: Any, v0: float, v1: float, h: float, compliance: float, line: Any
) -> None:
    """See `campaign.physics.step_function`. No state is kept."""
    coulomb, static, stribeck_velocity = parameters[0], parameters[1], parameters[2]
    exponent, smoothing = parameters[3], parameters[4]
    v = 0.5 * (v0 + v1)
    speed = abs(v) / stribeck_velocity
    size = coulomb + (static - coulomb) * math.exp(-(speed**exponent))
    if compliance > 0.0:
        # What would bring the velocity to zero by the end of the step; sliding if that is too much.
        stopping = v1 / compliance
        torque = min(max(stopping, -size), size)
    elif smoothing > 0.0:
        torque = size * math.tanh(v / smoothing)
    elif v0 * v1 < 0.0:
        # The sign changes inside the step: its mean over the step, not a whole step of either.
        torque = size * (v0 + v1) / (abs(v0) + abs(v1))
    else:
        torque = math.copysign(size, v) if v != 0.0 else 0.0
    line[0] = torque
    line[1] = 0.0


def _steady_state(options: StribeckOptions, velocity: Array) -> Array:
    viscous = options.viscous_friction * velocity
    return np.asarray(stribeck_curve(options, velocity) * np.sign(velocity) + viscous)


FRICTION = FrictionModel(
    name="stribeck",
    summary="static: Coulomb, Stribeck and viscous friction (Eq. 4.6)",
    options=StribeckOptions,
    parameters=_parameters,
    state_size=0,
    step=_step,
    viscous=lambda options: options.viscous_friction,
    steady_state=_steady_state,
)
