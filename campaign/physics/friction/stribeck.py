"""Static Stribeck friction: T = (Tc + (Ts - Tc) exp(-|v/vs|^delta)) sgn(v) + sigma2 v (Eq. 4.6).

At rest the model is a set, |T| <= Ts (`DryFriction`): in the plant, the engine determines in each
step whether it sticks or slides. As a compensation it is Eq. 4.6 with sgn(0) = 0.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydantic import Field

from campaign.options import Options
from campaign.physics.compilation import pasted
from campaign.physics.elementary import exp, power, tanh, where
from campaign.physics.friction.interface import (
    Array,
    DryFriction,
    FrictionModel,
    FrictionOptions,
    Presliding,
    SmallSignal,
)
from campaign.physics.friction.unknowns import curve
from campaign.physics.step_function import Motion
from campaign.units import AngularRate, RotationalDamping, Torque

CURVE = (
    "coulomb_torque",
    "static_torque",
    "stribeck_velocity",
    "stribeck_exponent",
    "viscous_friction",
)
"""Parameters of steady sliding; each can differ by direction."""


class NegativeDirection(Options):
    """Parameters that differ in the negative direction; the others are as in the positive."""

    coulomb_torque: Torque | None = Field(default=None, gt=0)
    """Tc in the negative direction."""
    static_torque: Torque | None = Field(default=None, gt=0)
    """Ts in the negative direction."""
    stribeck_velocity: AngularRate | None = Field(default=None, gt=0)
    """vs in the negative direction."""
    stribeck_exponent: float | None = Field(default=None, gt=0, le=10)
    """delta in the negative direction."""
    viscous_friction: RotationalDamping | None = Field(default=None, ge=0)
    """sigma2 in the negative direction."""


class CurveOptions(FrictionOptions):
    """The Stribeck curve of a model, with viscous friction."""

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
    negative: NegativeDirection = NegativeDirection()
    """Parameters that differ in the negative direction."""
    sign_smoothing: AngularRate = Field(default=0.0, ge=0)
    """Velocity over which sgn(v) is smoothed to tanh(v / this); 0 for a jump."""


def in_direction(options: Any, name: str, sign: float) -> float:
    """A parameter for sliding in the direction of `sign`."""
    other = getattr(options.negative, name) if sign < 0 else None
    return float(getattr(options, name) if other is None else other)


def curve_parameters(options: Any) -> list[float]:
    """Tc, Ts, vs, delta forwards, the same backwards, and `odd_viscous`."""
    names = ("coulomb_torque", "static_torque", "stribeck_velocity", "stribeck_exponent")
    return [
        *(in_direction(options, name, +1.0) for name in names),
        *(in_direction(options, name, -1.0) for name in names),
        odd_viscous(options),
    ]


def mean_viscous(options: Any) -> float:
    """sigma2 (N m s/rad), the mean of both directions: the linear part."""
    forwards, backwards = (in_direction(options, "viscous_friction", sign) for sign in (1.0, -1.0))
    return 0.5 * (forwards + backwards)


def odd_viscous(options: Any) -> float:
    """Half the difference of sigma2 (N m s/rad); a step function adds it times |v|."""
    forwards, backwards = (in_direction(options, "viscous_friction", sign) for sign in (1.0, -1.0))
    return 0.5 * (forwards - backwards)


def stribeck_curve(options: Any, velocity: Array) -> Array:
    """s(v) of Eq. 4.4 (N m), shape (n,): friction of steady sliding, unsigned, without sigma2."""
    curve = np.empty_like(velocity, dtype=float)
    for sign in (+1.0, -1.0):
        mask = velocity >= 0 if sign > 0 else velocity < 0
        coulomb = in_direction(options, "coulomb_torque", sign)
        drop = in_direction(options, "static_torque", sign) - coulomb
        speed = np.abs(velocity[mask]) / in_direction(options, "stribeck_velocity", sign)
        fall = np.exp(-(speed ** in_direction(options, "stribeck_exponent", sign)))
        curve[mask] = coulomb + drop * fall
    return curve


def steady_state(options: Any, velocity: Array) -> Array:
    """Friction torque (N m) of steady sliding at `velocity` (rad/s), shape (n,) (Eq. 4.6)."""
    viscous = np.where(
        velocity >= 0,
        in_direction(options, "viscous_friction", +1.0),
        in_direction(options, "viscous_friction", -1.0),
    )
    return np.asarray(stribeck_curve(options, velocity) * np.sign(velocity) + viscous * velocity)


def _parameters(options: StribeckOptions) -> Array:
    return np.array([*curve_parameters(options), options.sign_smoothing])


def _step(parameters: Any, state: Any, motion: Motion) -> tuple[float, float]:
    """See `campaign.physics.step_function`: Eq. 4.6 at the mean rate, without a state."""
    v0, v1, smoothing = motion.rate_start, motion.rate_end, parameters[9]
    v = 0.5 * (v0 + v1)
    size = curve_torque(parameters, where(v >= 0.0, 1.0, -1.0), abs(v))
    smooth = size * tanh(v / where(smoothing > 0.0, smoothing, 1.0))
    # The sign can change inside the step: use its mean over the step.
    path = abs(v0) + abs(v1)
    sign = where(v > 0.0, 1.0, where(v < 0.0, -1.0, 0.0))
    sign = where(v0 * v1 < 0.0, (v0 + v1) / where(path > 0.0, path, 1.0), sign)
    return where(smoothing > 0.0, smooth, size * sign) + parameters[8] * abs(v), 0.0


def _sliding(parameters: Any, direction: float, speed: float) -> float:
    """See `campaign.physics.sliding_torque`: s(v), and the half difference of sigma2."""
    torque: float = curve_torque(parameters, direction, speed) + direction * parameters[8] * speed
    return torque


@pasted
def curve_torque(parameters: Any, direction: float, speed: float) -> Any:
    """s(v) of Equation 4.4 (N m)."""
    tc_forwards, ts_forwards, vs_forwards, exponent_forwards = (
        parameters[0], parameters[1], parameters[2], parameters[3],
    )  # fmt: skip
    tc_backwards, ts_backwards, vs_backwards, exponent_backwards = (
        parameters[4], parameters[5], parameters[6], parameters[7],
    )  # fmt: skip
    forwards = direction >= 0.0
    coulomb = where(forwards, tc_forwards, tc_backwards)
    static = where(forwards, ts_forwards, ts_backwards)
    stribeck_velocity = where(forwards, vs_forwards, vs_backwards)
    exponent = where(forwards, exponent_forwards, exponent_backwards)
    return coulomb + (static - coulomb) * exp(-power(speed / stribeck_velocity, exponent))


def _small_signal(options: StribeckOptions) -> SmallSignal:
    """Rigid at rest. A compensation has the slope of tanh, or jumps without smoothing.

    The slope is the mean of both directions, which differ only if their static torques do.
    """
    static = 0.5 * sum(in_direction(options, "static_torque", sign) for sign in (+1.0, -1.0))
    smooth = options.sign_smoothing
    slope = Presliding(0.0, static / smooth) if smooth > 0.0 else None
    return SmallSignal(stuck=None, stuck_compensation=slope)


FRICTION = FrictionModel(
    name="stribeck",
    summary="static: Coulomb, Stribeck and viscous friction (Eq. 4.6)",
    options=StribeckOptions,
    parameters=_parameters,
    state_size=lambda options, step: 0,
    step=_step,
    viscous=mean_viscous,
    steady_state=steady_state,
    switches=lambda options: 2,
    changeable=CURVE,
    small_signal=_small_signal,
    stored_energy=lambda options, state: 0.0,
    dry=DryFriction(
        sliding=_sliding,
        static_torque=lambda options, direction: in_direction(options, "static_torque", direction),
        jumps=lambda options: options.sign_smoothing == 0.0,
    ),
    unknowns=curve,
)
