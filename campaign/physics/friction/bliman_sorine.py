"""Bliman-Sorine friction: a fast Dahl model minus a slow one (Eq. 3.12 to 3.14).

P.-A. Bliman and M. Sorine, *Easy-to-use realistic dry friction models for automatic control*, 3rd
European Control Conference (1995) 3788. The first order is Dahl's model.

**Caution.** As printed, the fast model settles at Fc and the slow one at Fs - Fc, so the torque of
sliding is 2 Fc - Fs. In the source and here the fast one settles at Fs:

    T = T1 - T2
    dT1/dq = sigma0 (1 - T1 sgn(v) / Ts)      dT2/dq = sigma0' (1 - T2 sgn(v) / (Ts - Tc))

and sliding has Tc. The torque depends only on the path: its peak after a reversal, which is below
Ts, is a function of the angle, and no Stribeck effect over the rate.

Scheme: closed form of both models for each part of a step in one direction; the mean torque is
trapezoidal, of second order in the step.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from campaign.options import Options
from campaign.physics.friction.coulomb import steady_state as coulomb_steady_state
from campaign.physics.friction.dahl import relaxed
from campaign.physics.friction.interface import Array, FrictionModel, FrictionOptions, SmallSignal
from campaign.physics.friction.path import parts_of
from campaign.physics.friction.stribeck import in_direction, mean_viscous, odd_viscous
from campaign.physics.friction.unknowns import (
    BENDING,
    PRESLIDE,
    STATIC,
    DerivedOption,
    FrictionUnknown,
    Sizes,
    Unknowns,
    line,
    static,
    stiffness,
)
from campaign.physics.step_function import Motion
from campaign.units import RotationalDamping, RotationalStiffness, Torque

CURVE = ("coulomb_torque", "static_torque", "viscous_friction")
LEAST_PEAK = 1.01
"""Lower bound of Ts over Tc in the identification."""
LEAST = 1e-12
"""Relative to Ts: lower bound of the slow part's torque, which is a divisor."""


class NegativeDirection(Options):
    """Parameters that differ in the negative direction; the others are as in the positive."""

    coulomb_torque: Torque | None = Field(default=None, gt=0)
    """Tc in the negative direction."""
    static_torque: Torque | None = Field(default=None, gt=0)
    """Ts in the negative direction."""
    viscous_friction: RotationalDamping | None = Field(default=None, ge=0)
    """sigma2 in the negative direction."""


class BlimanSorineOptions(FrictionOptions):
    """Parameters of Bliman-Sorine friction."""

    model: Literal["bliman-sorine"]
    """Bliman-Sorine friction."""
    order: Literal[1, 2] = 2
    """1: the fast part alone, with the final value Tc. 2: fast part minus slow part."""
    coulomb_torque: Torque = Field(gt=0)
    """Tc: friction of sliding, without the viscous part."""
    static_torque: Torque | None = Field(default=None, gt=0)
    """Ts: final value of the fast part; the peak of friction is below it. Second order only."""
    viscous_friction: RotationalDamping = Field(default=0.0, ge=0)
    """sigma2: friction proportional to velocity; the thesis' model has none."""
    negative: NegativeDirection = NegativeDirection()
    """Parameters that differ in the negative direction."""
    bristle_stiffness: RotationalStiffness = Field(gt=0)
    """sigma0 of the fast part; at the onset of presliding the slope is sigma0 - sigma0'."""
    slow_stiffness: RotationalStiffness | None = Field(default=None, gt=0)
    """sigma0' of the slow part. Second order only."""

    def without_effect(self) -> frozenset[str]:
        """Options of the slow part for the first order."""
        return frozenset(("static_torque", "slow_stiffness") if self.order == 1 else ())

    @model_validator(mode="after")
    def _peaks(self) -> Self:
        if self.order == 1:
            return self
        if self.static_torque is None or self.slow_stiffness is None:
            raise ValueError("order = 2 needs static_torque and slow_stiffness")
        for sign in (1.0, -1.0):
            fast, slow = _settling(self, sign)
            if slow <= LEAST * fast:
                raise ValueError("static_torque must be more than coulomb_torque")
            if self.slow_stiffness * fast >= self.bristle_stiffness * slow:
                raise ValueError(
                    "slow_stiffness must be less than bristle_stiffness times (Ts - Tc) / Ts: "
                    "friction would have no peak"
                )
        return self


def _settling(options: BlimanSorineOptions, way: float) -> tuple[float, float]:
    """Torques (N m) at which the fast and the slow part settle in a direction."""
    coulomb = in_direction(options, "coulomb_torque", way)
    if options.order == 1 or options.static_torque is None:
        return coulomb, 0.0
    static = in_direction(options, "static_torque", way)
    return static, static - coulomb


def _parameters(options: BlimanSorineOptions) -> Array:
    (fast, slow), (fast_back, slow_back) = (_settling(options, sign) for sign in (1.0, -1.0))
    half, stiffness = odd_viscous(options), options.bristle_stiffness
    if options.order == 1:
        return np.array([fast, fast_back, half, stiffness, 1.0, 1.0, 0.0])
    # Scatter can reduce the slow torque to zero or below; the bound then disables that part.
    slow, slow_back = max(slow, LEAST * fast), max(slow_back, LEAST * fast_back)
    return np.array([fast, fast_back, half, stiffness, slow, slow_back, options.slow_stiffness])


def _step(parameters: Any, state: Any, motion: Motion) -> tuple[float, float]:
    """See `campaign.physics.step_function`. The state is the torques of both parts (N m)."""
    parts, fast, slow = parts_of(motion), state[0], state[1]
    fast_at = relaxed(fast, parts.first, parameters[0], parameters[1], parameters[3])
    slow_at = relaxed(slow, parts.first, parameters[4], parameters[5], parameters[6])
    state[0] = relaxed(fast_at, parts.last, parameters[0], parameters[1], parameters[3])
    state[1] = relaxed(slow_at, parts.last, parameters[4], parameters[5], parameters[6])
    before, turned, after = fast - slow, fast_at - slow_at, state[0] - state[1]
    v0, v1, share = abs(motion.rate_start), abs(motion.rate_end), parts.share
    mean = 0.5 * (share * (before + turned) + (1.0 - share) * (turned + after))
    viscous = parameters[2]
    return mean + viscous * 0.5 * (v0 + v1), after - before + viscous * (v1 - v0)


def _small_signal(options: BlimanSorineOptions) -> SmallSignal:
    slow = 0.0 if options.order == 1 else options.slow_stiffness or 0.0
    return SmallSignal.of_bristles(options.bristle_stiffness - slow)


def _stored_energy(options: BlimanSorineOptions, state: Array) -> float:
    """Energy of Dahl's model for the first order; a difference of two has no known one."""
    if options.order == 2:
        return math.nan
    return float(0.5 * state[0] ** 2 / options.bristle_stiffness)


def _unknowns(sizes: Sizes, by_direction: bool) -> Unknowns:
    """Unknowns, with the slow stiffness relative to the largest for which friction has a peak."""
    peak = static(BENDING, by_direction=by_direction, ratio=(LEAST_PEAK, STATIC[1]), start=1.3)
    ratios = [each.name for each in peak if isinstance(each, FrictionUnknown)]

    def slow_stiffness(values: Mapping[str, float]) -> float:
        most = min(1.0 - 1.0 / values[name] for name in ratios)
        return values["slow_share"] * values["bristle_stiffness"] * most

    share = FrictionUnknown(
        "slow_share", "", "", "Slow stiffness, over the most with which friction has a peak.",
        1e-3, 0.99, 0.3, PRESLIDE, logarithmic=True, rests_on=(("bristle_stiffness",),),
        lasts=BENDING,
    )  # fmt: skip
    slow = DerivedOption(
        "slow_stiffness", "slow_stiffness", "N m/rad", "Stiffness of the slow part.", PRESLIDE,
        slow_stiffness,
    )  # fmt: skip
    own = line(sizes, by_direction)
    return (*own, *peak, stiffness(sizes), share, slow)


FRICTION = FrictionModel(
    name="bliman-sorine",
    summary="dynamic: two Dahl models, with a peak over the angle after a reversal (Eq. 3.12)",
    options=BlimanSorineOptions,
    parameters=_parameters,
    state_size=lambda options, step: 2,
    step=_step,
    viscous=mean_viscous,
    steady_state=coulomb_steady_state,
    switches=lambda options: 1,
    changeable=(*CURVE, "bristle_stiffness", "slow_stiffness"),
    added=("viscous_friction",),
    small_signal=_small_signal,
    stored_energy=_stored_energy,
    unknowns=_unknowns,
)
