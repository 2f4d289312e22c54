"""LuGre friction: T = sigma0 z + sigma1 dz/dt + sigma2 v, dz/dt = v - sigma0 |v| z / s(v).

Equations 4.2 to 4.4; Canudas de Wit, Olsson, Astrom and Lischinsky (1995). The state z is the mean
deflection of the bristles. For a given velocity, its equation is linear over a step. Its closed
form is stable at any velocity and step; an explicit update at 1 kHz is not (above 3.4 rad/s with
the thesis' parameters).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import numpy as np
from pydantic import Field

from campaign.physics.compilation import pasted
from campaign.physics.elementary import any_of, exp, expm1, power, where
from campaign.physics.friction.interface import Array, FrictionModel, FrictionOptions, SmallSignal
from campaign.physics.friction.stribeck import (
    CURVE,
    NegativeDirection,
    curve_parameters,
    in_direction,
    mean_viscous,
    steady_state,
)
from campaign.physics.friction.unknowns import bristles
from campaign.physics.step_function import Motion
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
    """Parameters that differ in the negative direction."""
    bristle_stiffness: RotationalStiffness = Field(gt=0)
    """sigma0: slope of torque over angle at the onset of presliding."""
    bristle_damping: RotationalDamping = Field(default=0.0, ge=0)
    """sigma1: damping of presliding."""


def _parameters(options: LuGreOptions) -> Array:
    curve = curve_parameters(options)
    curve[2], curve[6] = 1.0 / curve[2], 1.0 / curve[6]
    stiffness = options.bristle_stiffness
    return np.array([*curve, stiffness, options.bristle_damping / stiffness])


def _step(parameters: Any, state: Any, motion: Motion) -> tuple[float, float]:
    """See `campaign.physics.step_function`. state[0] is sigma0 z (N m)."""
    v, speed, direction = _mean_rates(motion)
    exponent_forwards, exponent_backwards = parameters[3], parameters[7]
    exponent = where(v >= 0.0, exponent_forwards, exponent_backwards)
    powered = power(_ratio(parameters, v, speed), exponent)
    return _advance(parameters, state, motion, v, speed, direction, powered)


def _gaussian_step(parameters: Any, state: Any, motion: Motion) -> tuple[float, float]:
    """The same with delta = 2, in half the time."""
    v, speed, direction = _mean_rates(motion)
    ratio = _ratio(parameters, v, speed)
    return _advance(parameters, state, motion, v, speed, direction, ratio * ratio)


@pasted
def _mean_rates(motion: Motion) -> tuple[float, float, float]:
    """Means of v and |v|, and their quotient: the direction, reduced by a reversal.

    If the sign of v changes, |v| follows from a straight line.
    """
    v0, v1, v = motion.rate_start, motion.rate_end, motion.rate_mean
    speed = abs(v)
    direction = where(speed > 0.0, where(v > 0.0, 1.0, -1.0), v)
    turns = v0 * v1 < 0.0
    if any_of(turns):
        turning = 0.5 * (v0 * v0 + v1 * v1) / where(turns, abs(v0) + abs(v1), 1.0)
        speed = where(turns, turning, speed)
        direction = v / where(speed > 0.0, speed, 1.0)
    return v, speed, direction


@pasted
def _ratio(parameters: Any, v: float, speed: float) -> Any:
    """|v| / vs in the direction of v."""
    forwards, backwards = parameters[2], parameters[6]
    return speed * where(v >= 0.0, forwards, backwards)


@pasted
def _advance(
    parameters: Any,
    state: Any,
    motion: Motion,
    v: float,
    speed: float,
    direction: float,
    power_of_ratio: float,
) -> tuple[float, float]:
    """Advance the bristles; mean torque and its change."""
    tc_forwards, ts_forwards = parameters[0], parameters[1]
    tc_backwards, ts_backwards = parameters[4], parameters[5]
    viscous, stiffness, damping_time = parameters[8], parameters[9], parameters[10]
    coulomb = where(v >= 0.0, tc_forwards, tc_backwards)
    static = where(v >= 0.0, ts_forwards, ts_backwards)
    s = coulomb + (static - coulomb) * exp(-power_of_ratio)
    per_s = 1.0 / s
    # z relaxes towards (v / |v|) s / stiffness, by exp(-x) over the step.
    x = stiffness * motion.step * speed * per_s
    before = state[0]
    change = (direction * s - before) * -expm1(-x)
    after = before + change
    state[0] = after
    mean = before + 0.5 * change + damping_time * motion.per_step * change + viscous * speed
    # Change of dz/dt over the step: the line includes the change of the damping torque.
    v0, v1 = motion.rate_start, motion.rate_end
    gained = v1 - v0 - (abs(v1) * after - abs(v0) * before) * per_s
    slope = stiffness * damping_time * gained + viscous * (abs(v1) - abs(v0))
    return mean, change + slope


def _step_for(options: LuGreOptions) -> Callable[..., Any]:
    exponents = {in_direction(options, "stribeck_exponent", sign) for sign in (+1.0, -1.0)}
    return _gaussian_step if exponents == {2.0} else _step


def _small_signal(options: LuGreOptions) -> SmallSignal:
    """At rest dz/dt = v: a spring and a damper. In fast sliding z = s(v) / sigma0 is constant."""
    return SmallSignal.of_bristles(options.bristle_stiffness, options.bristle_damping)


def _stored_energy(options: LuGreOptions, state: Array) -> float:
    """sigma0 z^2 / 2 of the bristles; the state is sigma0 z."""
    return float(0.5 * state[0] ** 2 / options.bristle_stiffness)


FRICTION = FrictionModel(
    name="lugre",
    summary="dynamic: bristles with presliding, Stribeck effect and friction lag (Eq. 4.2 to 4.4)",
    options=LuGreOptions,
    parameters=_parameters,
    state_size=lambda options, step: 1,
    step=_step,
    viscous=mean_viscous,
    steady_state=steady_state,
    switches=lambda options: 1,
    changeable=(*CURVE, "bristle_stiffness", "bristle_damping"),
    small_signal=_small_signal,
    stored_energy=_stored_energy,
    step_for=_step_for,
    unknowns=bristles,
)
