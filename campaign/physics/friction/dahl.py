"""Dahl friction: dT/dq = sigma0 |1 - T/Tc sgn(v)|^i sgn(1 - T/Tc sgn(v)) (Eq. 3.8 to 3.11).

P. R. Dahl, *A solid friction model*, Aerospace Corporation TOR-0158(3107-18)-1 (1968). Equation 3.8
prints i = 1 without the absolute value, which is the same while |T| <= Tc. The torque depends only
on path and direction, not on the rate.

Scheme: with y = 1 - T/Tc sgn(v) and a = sigma0 |q| / Tc, a closed form for each part of a step in
one direction: y = y0 exp(-a) at i = 1, else y^(1-i) = y0^(1-i) - (1-i) a, no less than 0. The path
is exact; the mean torque is trapezoidal, of second order in the step.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import numpy as np
from pydantic import Field

from campaign.physics.compilation import called, pasted
from campaign.physics.elementary import exp, expm1, power, where
from campaign.physics.friction.coulomb import CURVE, NegativeDirection
from campaign.physics.friction.coulomb import steady_state as coulomb_steady_state
from campaign.physics.friction.interface import Array, FrictionModel, FrictionOptions, SmallSignal
from campaign.physics.friction.path import parts_of, sign_of
from campaign.physics.friction.stribeck import in_direction, mean_viscous, odd_viscous
from campaign.physics.friction.unknowns import line, stiffness
from campaign.physics.step_function import Motion
from campaign.units import RotationalDamping, RotationalStiffness, Torque


class DahlOptions(FrictionOptions):
    """Parameters of Dahl friction."""

    model: Literal["dahl"]
    """Dahl friction."""
    coulomb_torque: Torque = Field(gt=0)
    """Tc: friction of sliding, without the viscous part."""
    viscous_friction: RotationalDamping = Field(default=0.0, ge=0)
    """sigma2: friction proportional to velocity; the thesis' Dahl model has none."""
    negative: NegativeDirection = NegativeDirection()
    """Parameters that differ in the negative direction."""
    bristle_stiffness: RotationalStiffness = Field(gt=0)
    """sigma0: slope of torque over angle where the torque is zero."""
    exponent: float = Field(default=1.0, gt=0, le=10)
    """i: shape of the presliding curve; below 1 it reaches Tc at a finite angle."""


def _parameters(options: DahlOptions) -> Array:
    forwards, backwards = (in_direction(options, "coulomb_torque", sign) for sign in (1.0, -1.0))
    own = [options.bristle_stiffness, options.exponent]
    return np.array([forwards, backwards, odd_viscous(options), *own])


def _step(parameters: Any, state: Any, motion: Motion) -> tuple[float, float]:
    """See `campaign.physics.step_function`. state[0] is the torque sigma0 z (N m)."""
    parts, before, i = parts_of(motion), state[0], parameters[4]
    turned = _general(parameters, before, parts.first, i)
    state[0] = _general(parameters, turned, parts.last, i)
    return _line(parameters, before, turned, state[0], parts.share, motion)


def _exponential_step(parameters: Any, state: Any, motion: Motion) -> tuple[float, float]:
    """The same with i = 1."""
    parts, before = parts_of(motion), state[0]
    turned = relaxed(before, parts.first, parameters[0], parameters[1], parameters[3])
    state[0] = relaxed(turned, parts.last, parameters[0], parameters[1], parameters[3])
    return _line(parameters, before, turned, state[0], parts.share, motion)


@pasted
def relaxed(
    torque: float, moved: float, forwards: float, backwards: float, stiffness: float
) -> Any:
    """Torque (N m) after `moved` (rad), from `torque`, with i = 1; its limit is `forwards` (N m),
    or -`backwards` in the negative direction.
    """
    settles = where(moved >= 0.0, forwards, backwards)
    way = stiffness * abs(moved) / settles
    return torque - (sign_of(moved) * settles - torque) * where(moved != 0.0, expm1(-way), 0.0)


@called
def _general(parameters: Any, torque: float, moved: float, i: float) -> Any:
    settles = where(moved >= 0.0, parameters[0], parameters[1])
    way, sign = parameters[3] * abs(moved) / settles, sign_of(moved)
    left = 1.0 - sign * torque / settles
    left = where(left > 0.0, left, 0.0)
    # For i below 1 and above; the result of the other case is not used.
    below = where(i < 1.0, 1.0 - i, 1.0)
    above = where(i > 1.0, i - 1.0, 1.0)
    remains = power(left, below) - below * way
    fast = power(where(remains > 0.0, remains, 0.0), 1.0 / below)
    slow = left / power(1.0 + above * way * power(left, above), 1.0 / above)
    remains = where(i == 1.0, left * exp(-way), where(i < 1.0, fast, slow))
    after = sign * settles * (1.0 - remains)
    return where(moved != 0.0, after, torque)


@pasted
def _line(
    parameters: Any, before: float, turned: float, after: float, share: float, motion: Motion
) -> tuple[float, float]:
    v0, v1 = abs(motion.rate_start), abs(motion.rate_end)
    mean = 0.5 * (share * (before + turned) + (1.0 - share) * (turned + after))
    viscous = parameters[2]
    return mean + viscous * 0.5 * (v0 + v1), after - before + viscous * (v1 - v0)


def _step_for(options: DahlOptions) -> Callable[..., Any]:
    return _exponential_step if options.exponent == 1.0 else _step


FRICTION = FrictionModel(
    name="dahl",
    summary="dynamic: Coulomb friction with presliding that depends on the path alone (Eq. 3.8)",
    options=DahlOptions,
    parameters=_parameters,
    state_size=lambda options, step: 1,
    step=_step,
    viscous=mean_viscous,
    steady_state=coulomb_steady_state,
    switches=lambda options: 1,
    changeable=(*CURVE, "bristle_stiffness"),
    added=("viscous_friction",),
    small_signal=lambda options: SmallSignal.of_bristles(options.bristle_stiffness),
    # The power loss is T v (1 - y^i), never negative: y < 1 if T has the sign of v, else > 1.
    stored_energy=lambda options, state: float(0.5 * state[0] ** 2 / options.bristle_stiffness),
    step_for=_step_for,
    unknowns=lambda sizes, by_direction: (*line(sizes, by_direction), stiffness(sizes)),
)
