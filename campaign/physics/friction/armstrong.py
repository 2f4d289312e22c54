"""Armstrong's friction of seven parameters: a spring at rest, a curve with memory (Eq. 3.5 to 3.7).

B. Armstrong-Helouvry, P. Dupont and C. Canudas de Wit, Automatica 30 (1994) 1083.

    sticks:  T = sigma0 x                   x from the position without spring torque
    slides:  T = (Tc + D / (1 + (v(t - tau_L) / vs)^2)) sgn(v)
    D = Da + (Ts - Tc - Da) t2 / (t2 + gamma)               at breakaway, then constant

and sigma2 v in both. It breaks away at |T| = Tc + D, and sticks at zero crossings of v with its
torque at that time. t2 is the dwell time, Da the Stribeck friction (over Tc) at the end of the
previous slide.

**Caution.** The static term of Equation 3.6 is the excess over Tc (here Ts is Tc + Fs,inf);
Equation 3.7 lacks a bracket; the text below calls the dwell time t2 and the lag tau_d, the
equations t_d and tau_L. The print has no viscous friction at rest; here sigma2 is in both regimes,
since it is small at a spring's rates and the engine integrates it exactly.

A trial begins rested: D = Ts - Tc. No storage function is known: D grows without motion.

Scheme: each part of a step in one direction either slides, or sticks until breakaway. The rate at
a time tau_L ago is interpolated between two stored rates. Second order.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydantic import Field

from campaign.options import Options
from campaign.physics.compilation import called, pasted
from campaign.physics.elementary import where
from campaign.physics.friction.interface import Array, FrictionModel, FrictionOptions, SmallSignal
from campaign.physics.friction.path import parts_of, sign_of
from campaign.physics.friction.stribeck import in_direction, mean_viscous, odd_viscous
from campaign.physics.friction.unknowns import (
    BENDING,
    REVERSE,
    FrictionUnknown,
    ReversalTime,
    Sizes,
    Unknowns,
    curve,
    stiffness,
)
from campaign.physics.step_function import AN_INSTANT, Motion
from campaign.units import AngularRate, RotationalDamping, RotationalStiffness, Time, Torque

CURVE = ("coulomb_torque", "static_torque", "stribeck_velocity", "viscous_friction")
MOST_LAG = 0.05
"""s; the state has a rate for each step within the lag."""
TORQUE, WAY, RECOVERS, DWELL, DELAYED, OWN = 0, 1, 2, 3, 4, 5
"""The state: torque; direction of sliding, 0 if stuck; missing share of D in Ts - Tc at breakaway
or at the start of sticking; dwell time; |v| one lag ago; then |v| at step ends, oldest first."""


class NegativeDirection(Options):
    """Parameters that differ in the negative direction; the others are as in the positive."""

    coulomb_torque: Torque | None = Field(default=None, gt=0)
    """Tc in the negative direction."""
    static_torque: Torque | None = Field(default=None, gt=0)
    """Ts in the negative direction."""
    stribeck_velocity: AngularRate | None = Field(default=None, gt=0)
    """vs in the negative direction."""
    viscous_friction: RotationalDamping | None = Field(default=None, ge=0)
    """sigma2 in the negative direction."""


class ArmstrongOptions(FrictionOptions):
    """Parameters of Armstrong's friction."""

    model: Literal["armstrong"]
    """Armstrong's friction of seven parameters."""
    coulomb_torque: Torque = Field(gt=0)
    """Tc: friction of fast sliding, without the viscous part."""
    static_torque: Torque = Field(gt=0)
    """Ts: breakaway torque after a long rest."""
    stribeck_velocity: AngularRate = Field(gt=0)
    """vs: rate at which half of the excess over Tc remains (Lorentzian curve)."""
    viscous_friction: RotationalDamping = Field(default=0.0, ge=0)
    """sigma2: friction proportional to velocity."""
    negative: NegativeDirection = NegativeDirection()
    """Parameters that differ in the negative direction."""
    bristle_stiffness: RotationalStiffness = Field(gt=0)
    """sigma0: stiffness of the spring while it sticks."""
    memory_lag: Time = Field(default=0.0, ge=0, le=MOST_LAG)
    """tau_L: delay of the torque after the rate."""
    dwell_time: Time = Field(gt=0, le=1e6)
    """gamma: time at rest that restores half of the static friction."""


def _parameters(options: ArmstrongOptions) -> Array:
    values = []
    for sign in (1.0, -1.0):
        coulomb, static, velocity, _ = (in_direction(options, name, sign) for name in CURVE)
        values += [coulomb, static - coulomb, 1.0 / velocity]
    own = [options.bristle_stiffness, options.memory_lag, options.dwell_time]
    return np.array([*values, odd_viscous(options), *own])


def _state_size(options: ArmstrongOptions, step: float) -> int:
    """Two rates more than whole steps in the lag; one of them is the newest."""
    return OWN + int(options.memory_lag / step + 1e-9) + 2


def _step(parameters: Any, state: Any, motion: Motion) -> tuple[float, float]:
    """See `campaign.physics.step_function`, and above for the state."""
    parts, v0, v1 = parts_of(motion), motion.rate_start, motion.rate_end
    share, rest, before = parts.share, 1.0 - parts.share, state[TORQUE]
    older = state[DELAYED]
    newer = _delayed(parameters[8], state, motion)
    between = older + (newer - older) * share
    first = _slid(parameters, state, parts.first, share * motion.step, older, between)
    last = _slid(parameters, state, parts.last, rest * motion.step, between, newer)
    mean = where(parts.turns, share * first + rest * last, first)
    viscous = parameters[6]
    speed, rise = 0.5 * (abs(v0) + abs(v1)), abs(v1) - abs(v0)
    return mean + viscous * speed, state[TORQUE] - before + viscous * rise


@pasted
def _delayed(lag: float, state: Any, motion: Motion) -> Any:
    """|v| one lag before the end of the step; unchanged for an instant of a sampled controller."""
    lasts, count = motion.step > 2.0 * AN_INSTANT, state.shape[0] - OWN
    for i in range(count - 1):
        state[OWN + i] = where(lasts, state[OWN + i + 1], state[OWN + i])
    state[OWN + count - 1] = where(lasts, abs(motion.rate_end), state[OWN + count - 1])
    part = lag * motion.per_step - (count - 2)
    new = state[OWN + 1] + part * (state[OWN] - state[OWN + 1])
    state[DELAYED] = where(lasts, new, state[DELAYED])
    return state[DELAYED]


@called
def _slid(
    parameters: Any, state: Any, moved: float, time: float, older: float, newer: float
) -> Any:
    """Advance over a part of a step; its mean torque (N m).

    older, newer: |v| one lag before the start and the end of the part.
    """
    stiffness, recovery, direction = parameters[7], parameters[9], sign_of(moved)
    torque, way, lacks, lasts = state[TORQUE], state[WAY], state[RECOVERS], time > 0.0
    slides = way * direction > 0.0
    stops = (way != 0.0) & (way * direction <= 0.0)
    # Stuck from now on: the rest of D at the end of the slide, and a new dwell time.
    _, _, per = _curve(parameters, way)
    lacks = where(stops, 1.0 - (1.0 - lacks) * _fallen(older * per), lacks)
    rested = where(stops, 0.0, state[DWELL])
    coulomb, excess, per = _curve(parameters, direction)
    pulled, w = stiffness * abs(moved), direction * torque
    # It breaks away if the spring reaches a level that grows with the dwell time.
    dwell = rested + time
    level = coulomb + excess * (1.0 - lacks * recovery / (recovery + dwell))
    breaks = (w + pulled > level) & (direction != 0.0)
    part = where(w < level, level - w, 0.0) / where(breaks & (pulled > 0.0), pulled, 1.0)
    dwell = where(breaks, rested + part * time, dwell)
    recovered = where(slides, lacks, lacks * recovery / (recovery + dwell))
    excess = excess * (1.0 - recovered)
    level, sliding = coulomb + excess, coulomb + excess * _fallen(newer * per)
    # If the rate one lag ago is not zero, the torque falls at breakaway.
    fallen = coulomb + excess * _fallen((older + part * (newer - older)) * per)
    free = slides | breaks
    new = where(free, sliding, w + pulled)
    broken = part * 0.5 * (w + level) + (1.0 - part) * 0.5 * (fallen + sliding)
    mean = where(slides, 0.5 * (w + sliding), where(breaks, broken, w + 0.5 * pulled))
    still = direction == 0.0
    state[TORQUE] = where(lasts, where(still, torque, direction * new), torque)
    state[WAY] = where(lasts, where(free, direction, 0.0), way)
    state[RECOVERS] = where(lasts, where(free, recovered, lacks), state[RECOVERS])
    state[DWELL] = where(lasts, dwell, state[DWELL])
    return where(still, torque, direction * mean)


@pasted
def _curve(parameters: Any, direction: float) -> tuple[float, float, float]:
    """Tc, Ts - Tc (N m) and 1 / vs in a direction."""
    forwards = direction >= 0.0
    coulomb = where(forwards, parameters[0], parameters[3])
    excess = where(forwards, parameters[1], parameters[4])
    return coulomb, excess, where(forwards, parameters[2], parameters[5])


@pasted
def _fallen(ratio: float) -> float:
    """1 / (1 + (v / vs)^2)."""
    return 1.0 / (1.0 + ratio * ratio)


def steady_state(options: ArmstrongOptions, velocity: Array) -> Array:
    """Friction torque (N m) at `velocity` (rad/s), shape (n,), of a slide after a long rest."""
    torque = np.zeros_like(velocity, dtype=float)
    for sign in (+1.0, -1.0):
        moving = velocity * sign > 0
        coulomb, static, width, viscous = (in_direction(options, name, sign) for name in CURVE)
        v = velocity[moving]
        torque[moving] = (
            sign * (coulomb + (static - coulomb) / (1.0 + (v / width) ** 2)) + viscous * v
        )
    return torque


def _unknowns(sizes: Sizes, by_direction: bool) -> Unknowns:
    late = ReversalTime("the memory lag", lambda options, turning: options["memory_lag"])
    lag = FrictionUnknown(
        "memory_lag", "memory_lag", "s", "How late the torque answers to the rate.",
        0.0, MOST_LAG, 0.2 * MOST_LAG, REVERSE, lasts=late,
    )  # fmt: skip
    dwell = FrictionUnknown(
        "dwell_time", "dwell_time", "s", "Time at rest after which half of stiction is back.",
        1e-3, 1e3, 0.1, "rest for different times before it breaks away", logarithmic=True,
        rests_on=(("bristle_stiffness",),), lasts=BENDING,
    )  # fmt: skip
    return (*curve(sizes, by_direction), stiffness(sizes), lag, dwell)


FRICTION = FrictionModel(
    name="armstrong",
    summary="static: a spring at rest, a curve with memory and dwell time (Eq. 3.5 to 3.7)",
    options=ArmstrongOptions,
    parameters=_parameters,
    state_size=_state_size,
    step=_step,
    viscous=mean_viscous,
    steady_state=steady_state,
    switches=lambda options: 2,
    changeable=(*CURVE, "bristle_stiffness", "memory_lag", "dwell_time"),
    small_signal=lambda options: SmallSignal.of_bristles(options.bristle_stiffness),
    fastest=lambda options: options.memory_lag,
    unknowns=_unknowns,
)
