"""Leuven friction: LuGre's equation over a hysteresis with memory of reversals (Eq. 3.19 to 3.22).

    T = Th(z) + sigma1 dz/dt + sigma2 v    dz/dt = v (1 - sgn(r) |r|^d)    r = Th(z) / s(v)

V. Lampaert, J. Swevers and F. Al-Bender, *Modification of the Leuven integrated friction model
structure*, IEEE Trans. Automatic Control 47 (2002) 683: Th is N parallel Maxwell-slip elements of
z, without a stack of reversals. It corrects J. Swevers et al., IEEE TAC 45 (2000) 675.

**Caution.** s(v) in Equation 3.19 is the signed one of Equation 3.4. With the unsigned one of
Equation 3.18, z diverges while v < 0 and the hysteresis saturates at the wrong level. Friction of
sliding is s(v) only if the elements can hold it: the sum of all W is `hysteresis_reserve` times the
largest s; a reserve below 1 is refused.

No storage function is known.

Scheme: for each part of a step in one direction, with s at its mean rate, dz/dq = (1 - r) Q(r) with
Q = (1 - sgn(r) |r|^d) / (1 - r). Q and the stiffness are those after half of the path; the linear
equation then has a closed form: the exponential midpoint rule, second order in the step. It never
overshoots r = 1, at any length of the path. N = 1 with d = 1 is LuGre to rounding.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydantic import Field

from campaign.physics.compilation import called, pasted
from campaign.physics.elementary import power, where
from campaign.physics.friction.elements import ElementOptions, count_of, shares_of
from campaign.physics.friction.interface import Array, FrictionModel
from campaign.physics.friction.lugre import FRICTION as LUGRE
from campaign.physics.friction.lugre import LuGreOptions
from campaign.physics.friction.path import decayed, parts_of, sign_of
from campaign.physics.friction.stribeck import (
    curve_parameters,
    curve_torque,
    in_direction,
    mean_viscous,
    steady_state,
)
from campaign.physics.step_function import Motion

OWN = 11
"""Number of parameters before those of the elements."""
NEAR = 1e-6
"""Distance from r = 1 within which Q is its limit d."""


class LeuvenOptions(LuGreOptions, ElementOptions):
    """Parameters of Leuven friction; `bristle_stiffness` is the sum over all elements."""

    model: Literal["leuven"]  # type: ignore[assignment]
    """Leuven friction."""
    transition_exponent: float = Field(default=1.0, gt=0, le=10)
    """d of Equation 3.19: sharpness of the transition from hysteresis to sliding."""
    hysteresis_reserve: float = Field(default=1.0, ge=1, le=10)
    """Torque that all elements hold, relative to the largest of all Tc and Ts; at least 1."""


def _parameters(options: LeuvenOptions) -> Array:
    torques, stiffnesses = shares_of(options)
    most = options.hysteresis_reserve * max(
        in_direction(options, name, sign)
        for name in ("coulomb_torque", "static_torque")
        for sign in (1.0, -1.0)
    )
    own = [*curve_parameters(options), options.bristle_damping, options.transition_exponent]
    return np.array([*own, *(most * torques), *(options.bristle_stiffness * stiffnesses)])


def _step(parameters: Any, state: Any, motion: Motion) -> tuple[float, float]:
    """See `campaign.physics.step_function`. The state is the torques of the elements (N m)."""
    parts, v0, v1 = parts_of(motion), motion.rate_start, motion.rate_end
    share, rest = parts.share, 1.0 - parts.share
    before = 0.0 * v0
    for i in range(state.shape[0]):
        before = before + state[i]
    bent, turned, starts, ends = _bent(parameters, state, parts.first, share * motion.step, before)
    more, after, _, last = _bent(parameters, state, parts.last, rest * motion.step, turned)
    ends = where(parts.turns, last, ends)
    damping, viscous = parameters[9], parameters[8]
    mean = 0.5 * (share * (before + turned) + rest * (turned + after))
    mean = mean + damping * motion.per_step * (bent + more)
    gained = damping * (v1 * ends - v0 * starts) + viscous * (abs(v1) - abs(v0))
    return mean + 0.5 * viscous * (abs(v0) + abs(v1)), after - before + gained


@called
def _bent(
    parameters: Any, state: Any, moved: float, time: float, held: float
) -> tuple[float, float, float, float]:
    """Advance all elements over a part of a step: displacement of z (rad), torque at the end (N m),
    and dz/dq at the start and at the end.

    held: torque at the start (N m).
    """
    moves, direction, way = moved != 0.0, sign_of(moved), abs(moved)
    speed = way / where(time > 0.0, time, 1.0)
    s = curve_torque(parameters, direction, speed)
    ratio = direction * held / s
    # If s is below the torque, z moves back.
    forth = where(ratio > 1.0, -direction, direction)
    count, stiffness = state.shape[0], 0.0 * way
    for i in range(count):
        sticks = forth * state[i] < parameters[OWN + i]
        stiffness = stiffness + where(sticks, parameters[OWN + count + i], 0.0)
    slope = _slope(ratio, parameters[10])
    half = _moved(ratio, slope, stiffness, 0.5 * way, s)
    reached = 0.0 * way
    for i in range(count):
        z = direction * half * parameters[OWN + count + i]
        reached = reached + _held(state[i] + z, parameters[OWN + i])
    gain = direction * (reached - held)
    stiffness = where(half != 0.0, gain / where(half != 0.0, half, 1.0), stiffness)
    middle = _slope(direction * reached / s, parameters[10])
    far = direction * _moved(ratio, middle, stiffness, way, s)
    after = 0.0 * way
    for i in range(count):
        new = _held(state[i] + far * parameters[OWN + count + i], parameters[OWN + i])
        state[i] = where(moves, new, state[i])
        after = after + state[i]
    starts = (1.0 - ratio) * slope
    ended = direction * after / s
    ends = (1.0 - ended) * _slope(ended, parameters[10])
    return where(moves, far, 0.0), where(moves, after, held), starts, ends


@called
def _slope(ratio: float, exponent: float) -> float:
    """Q(r)."""
    sign = where(ratio < 0.0, -1.0, 1.0)
    near = abs(1.0 - ratio) < NEAR
    curve = 1.0 - sign * power(abs(ratio), exponent)
    slope: float = where(near, exponent, curve / where(near, 1.0, 1.0 - ratio))
    return slope


@pasted
def _moved(ratio: float, slope: float, stiffness: float, way: float, s: float) -> Any:
    """Displacement of z in the direction of motion, with constant Q and stiffness."""
    return (1.0 - ratio) * slope * way * decayed(stiffness * slope * way / s)


@pasted
def _held(torque: float, most: float) -> float:
    """Torque of an element, limited to what it can hold."""
    held: float = where(torque > most, most, where(torque < -most, -most, torque))
    return held


FRICTION = FrictionModel(
    name="leuven",
    summary="dynamic: LuGre's equation over N Maxwell-slip elements (Eq. 3.19 to 3.22)",
    options=LeuvenOptions,
    parameters=_parameters,
    state_size=lambda options, step: count_of(options),
    step=_step,
    viscous=mean_viscous,
    steady_state=steady_state,
    switches=lambda options: 2 + count_of(options),
    changeable=LUGRE.changeable,
    small_signal=LUGRE.small_signal,
    unknowns=LUGRE.unknowns,
)
