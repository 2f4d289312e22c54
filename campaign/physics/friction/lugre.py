"""LuGre friction: T = sigma0 z + sigma1 dz/dt + sigma2 v, dz/dt = v - sigma0 |v| z / s(v).

Equations 4.2 to 4.4; Canudas de Wit, Olsson, Astrom and Lischinsky (1995). The state z is the mean
deflection of the bristles. Over one step the equation of z is linear for a given velocity, so z is
advanced with its closed form, which is stable at any velocity and step: an explicit update at 1 kHz
is not (above 3.4 rad/s with the thesis' parameters).
"""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
from pydantic import Field

from campaign.physics.friction.interface import (
    Array,
    FrictionModel,
    FrictionOptions,
    Presliding,
    SmallSignal,
)
from campaign.physics.friction.stribeck import (
    CURVE,
    NegativeDirection,
    curve_parameters,
    mean_viscous,
    steady_state,
)
from campaign.units import AngularRate, RotationalDamping, RotationalStiffness, Torque


class LuGreOptions(FrictionOptions):
    """Parameters of LuGre friction (Table 4.2)."""

    model: Literal["lugre"]
    """LuGre friction."""
    coulomb_torque: Torque = Field(gt=0)
    """Tc: friction of fast sliding, without the viscous part."""
    static_torque: Torque = Field(gt=0)
    """Ts: largest friction of slow sliding. Real axes with Ts < Tc exist."""
    stribeck_velocity: AngularRate = Field(gt=0)
    """vs: velocity over which friction falls from Ts to Tc."""
    stribeck_exponent: float = Field(default=2.0, gt=0, le=10)
    """delta: shape of that fall."""
    viscous_friction: RotationalDamping = Field(default=0.0, ge=0)
    """sigma2: friction proportional to velocity."""
    negative: NegativeDirection = NegativeDirection()
    """What differs in the negative direction."""
    bristle_stiffness: RotationalStiffness = Field(gt=0)
    """sigma0: slope of torque over angle at the onset of presliding."""
    bristle_damping: RotationalDamping = Field(default=0.0, ge=0)
    """sigma1: damping of presliding."""


def _parameters(options: LuGreOptions) -> Array:
    return np.array(
        [*curve_parameters(options), options.bristle_stiffness, options.bristle_damping]
    )


def _step(
    parameters: Any, state: Any, v0: float, v1: float, h: float, compliance: float, line: Any
) -> None:
    """See `campaign.physics.step_function`. state[0] is z (rad)."""
    v = 0.5 * (v0 + v1)
    way = 0 if v >= 0.0 else 4
    coulomb, static = parameters[way], parameters[way + 1]
    stribeck_velocity, exponent = parameters[way + 2], parameters[way + 3]
    stiffness, damping = parameters[9], parameters[10]
    # The mean of |v| over a straight line from v0 to v1, exact also where the sign changes.
    mean_speed = abs(v) if v0 * v1 >= 0.0 else 0.5 * (v0 * v0 + v1 * v1) / (abs(v0) + abs(v1))
    ratio = mean_speed / stribeck_velocity
    fall = math.exp(-ratio * ratio) if exponent == 2.0 else math.exp(-(ratio**exponent))
    s = coulomb + (static - coulomb) * fall
    rate = stiffness * mean_speed / s
    x = rate * h
    z = state[0]
    # z relaxes towards v / rate; (1 - exp(-x)) / x is written so that x -> 0 is exact.
    change = (v - rate * z) * h * (-math.expm1(-x) / x if x > 1e-12 else 1.0)
    state[0] = z + change
    line[0] = stiffness * (z + 0.5 * change) + damping * change / h + parameters[8] * mean_speed
    line[1] = stiffness * change


def _small_signal(options: LuGreOptions) -> SmallSignal:
    """At rest dz/dt = v: a spring and a damper. In fast sliding z = s(v) / sigma0 stays put."""
    bristles = Presliding(options.bristle_stiffness, options.bristle_damping)
    return SmallSignal(stuck=bristles, stuck_compensation=bristles)


FRICTION = FrictionModel(
    name="lugre",
    summary="dynamic: bristles with presliding, Stribeck effect and friction lag (Eq. 4.2 to 4.4)",
    options=LuGreOptions,
    parameters=_parameters,
    state_size=1,
    step=_step,
    viscous=mean_viscous,
    steady_state=steady_state,
    changeable=(*CURVE, "bristle_stiffness", "bristle_damping"),
    small_signal=_small_signal,
)
