"""Coulomb and viscous friction: T = Tc sgn(v) + sigma2 v (Eq. 4.6 with Ts = Tc).

It is the friction of a motor's data sheet or no-load test. At rest it is a set, |T| <= Tc
(`DryFriction`), which the engine solves for; as a compensation its torque jumps with the sign.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydantic import Field

from campaign.options import Options
from campaign.physics.elementary import where
from campaign.physics.friction.interface import (
    Array,
    DryFriction,
    FrictionModel,
    FrictionOptions,
    SmallSignal,
)
from campaign.physics.friction.stribeck import in_direction, mean_viscous, odd_viscous
from campaign.physics.friction.unknowns import line
from campaign.physics.step_function import Motion
from campaign.units import RotationalDamping, Torque

CURVE = ("coulomb_torque", "viscous_friction")


class NegativeDirection(Options):
    """Parameters that differ in the negative direction; the others are as in the positive."""

    coulomb_torque: Torque | None = Field(default=None, gt=0)
    """Tc in the negative direction."""
    viscous_friction: RotationalDamping | None = Field(default=None, ge=0)
    """sigma2 in the negative direction."""


class CoulombOptions(FrictionOptions):
    """Parameters of Coulomb and viscous friction."""

    model: Literal["coulomb"]
    """Coulomb and viscous friction, without a Stribeck effect."""
    coulomb_torque: Torque = Field(ge=0)
    """Tc: friction at rest and in motion, without the viscous part."""
    viscous_friction: RotationalDamping = Field(default=0.0, ge=0)
    """sigma2: friction proportional to velocity."""
    negative: NegativeDirection = NegativeDirection()
    """Parameters that differ in the negative direction."""


def steady_state(options: Any, velocity: Array) -> Array:
    """Friction torque (N m) of steady sliding at `velocity` (rad/s), shape (n,)."""
    torque = np.zeros_like(velocity, dtype=float)
    for sign in (+1.0, -1.0):
        moving = velocity * sign > 0
        coulomb, viscous = (in_direction(options, name, sign) for name in CURVE)
        torque[moving] = sign * coulomb + viscous * velocity[moving]
    return torque


def _parameters(options: CoulombOptions) -> Array:
    """Tc forwards and backwards (N m), and half the difference of sigma2 (N m s/rad)."""
    torques = [in_direction(options, "coulomb_torque", sign) for sign in (1.0, -1.0)]
    return np.array([*torques, odd_viscous(options)])


def _step(parameters: Any, state: Any, motion: Motion) -> tuple[float, float]:
    """See `campaign.physics.step_function`. The sign is its mean over the step."""
    v0, v1 = motion.rate_start, motion.rate_end
    v = 0.5 * (v0 + v1)
    path = abs(v0) + abs(v1)
    sign = where(v > 0.0, 1.0, where(v < 0.0, -1.0, 0.0))
    sign = where(v0 * v1 < 0.0, (v0 + v1) / where(path > 0.0, path, 1.0), sign)
    size = where(v >= 0.0, parameters[0], parameters[1])
    return size * sign + parameters[2] * abs(v), 0.0


def _sliding(parameters: Any, direction: float, speed: float) -> float:
    """See `campaign.physics.sliding_torque`."""
    coulomb = where(direction >= 0.0, parameters[0], parameters[1])
    torque: float = coulomb + direction * parameters[2] * speed
    return torque


FRICTION = FrictionModel(
    name="coulomb",
    summary="static: Coulomb and viscous friction (Eq. 4.6 with Ts = Tc)",
    options=CoulombOptions,
    parameters=_parameters,
    state_size=lambda options, step: 0,
    step=_step,
    viscous=mean_viscous,
    steady_state=steady_state,
    switches=lambda options: 2,
    changeable=CURVE,
    small_signal=lambda options: SmallSignal(stuck=None, stuck_compensation=None),
    stored_energy=lambda options, state: 0.0,
    dry=DryFriction(
        sliding=_sliding,
        static_torque=lambda options, direction: in_direction(options, "coulomb_torque", direction),
    ),
    unknowns=line,
)
