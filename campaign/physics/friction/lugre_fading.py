"""LuGre friction whose bristle damping fades with the rate: sigma1(v) = sigma1 exp(-(v / vd)^2).

C. Canudas de Wit, H. Olsson, K. J. Astrom and P. Lischinsky, *Dynamic friction models and control
design*, American Control Conference (1993) 1920; H. Olsson, *Control systems with friction*, Lund
(1996). Otherwise Equations 3.15 to 3.18. With r = sigma0 z sgn(v) / s, the power loss is
|v| (s r^2 + |v| sigma1(v) (1 - r) + sigma2 |v|), not negative for any r if |v| sigma1(v) <= 4 s. So
the model is passive if sigma1 vd <= 4 sqrt(2 e) min(Tc, Ts), about 9.3 times that minimum. With a
constant sigma1 it is passive only if sigma1 (Ts - Tc) / Tc <= sigma2.

Scheme: closed form of z for each part of a step in one direction, with s at its mean rate; second
order.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydantic import Field

from campaign.physics.compilation import called, pasted
from campaign.physics.elementary import exp, where
from campaign.physics.friction.dahl import relaxed
from campaign.physics.friction.interface import Array, FrictionModel
from campaign.physics.friction.lugre import FRICTION as LUGRE
from campaign.physics.friction.lugre import LuGreOptions
from campaign.physics.friction.path import parts_of, sign_of
from campaign.physics.friction.stribeck import (
    curve_parameters,
    curve_torque,
    mean_viscous,
    steady_state,
)
from campaign.physics.friction.unknowns import (
    BENDING,
    PRESLIDE,
    FrictionUnknown,
    Sizes,
    Unknowns,
    bristles,
)
from campaign.physics.step_function import Motion
from campaign.units import AngularRate


class FadingOptions(LuGreOptions):
    """Parameters of LuGre friction with fading damping."""

    model: Literal["lugre-fading"]  # type: ignore[assignment]
    """LuGre friction with fading damping."""
    damping_velocity: AngularRate = Field(gt=0)
    """vd: rate at which sigma1 has fallen to 37 %."""


def _parameters(options: FadingOptions) -> Array:
    stiffness, own = options.bristle_stiffness, 1.0 / options.damping_velocity
    return np.array(
        [*curve_parameters(options), stiffness, options.bristle_damping / stiffness, own]
    )


def _step(parameters: Any, state: Any, motion: Motion) -> tuple[float, float]:
    """See `campaign.physics.step_function`. state[0] is sigma0 z (N m)."""
    parts, before = parts_of(motion), state[0]
    share, rest = parts.share, 1.0 - parts.share
    turned, starts, ends, damped = _bent(parameters, before, parts.first, share * motion.step)
    after, _, last, more = _bent(parameters, turned, parts.last, rest * motion.step)
    ends = where(parts.turns, last, ends)
    state[0] = after
    v0, v1, viscous = motion.rate_start, motion.rate_end, parameters[8]
    mean = 0.5 * (share * (before + turned) + rest * (turned + after))
    mean = mean + motion.per_step * (damped + more)
    gained = parameters[9] * (_damping(parameters, v1) * v1 * ends)
    gained = gained - parameters[9] * (_damping(parameters, v0) * v0 * starts)
    rise = viscous * (abs(v1) - abs(v0))
    return mean + 0.5 * viscous * (abs(v0) + abs(v1)), after - before + gained + rise


@pasted
def _damping(parameters: Any, rate: float) -> Any:
    """sigma1(v) / sigma0 (s)."""
    ratio = rate * parameters[11]
    return parameters[10] * exp(-(ratio * ratio))


@called
def _bent(
    parameters: Any, torque: float, moved: float, time: float
) -> tuple[float, float, float, float]:
    """sigma0 z after a part of a step; dz/dq at its start and at its end; and the integral of the
    damping torque (N m s).
    """
    direction = sign_of(moved)
    speed = abs(moved) / where(time > 0.0, time, 1.0)
    s = curve_torque(parameters, direction, speed)
    after = relaxed(torque, moved, s, s, parameters[9])
    starts, ends = 1.0 - direction * torque / s, 1.0 - direction * after / s
    return after, starts, ends, _damping(parameters, speed) * (after - torque)


def _unknowns(sizes: Sizes, by_direction: bool) -> Unknowns:
    fading = FrictionUnknown(
        "damping_velocity", "damping_velocity", "rad/s", "Rate at which sigma1 has fallen to 37 %.",
        1e-4 * sizes.rate, 10.0 * sizes.rate, 0.1 * sizes.rate, PRESLIDE, logarithmic=True,
        lasts=BENDING,
    )  # fmt: skip
    return (*bristles(sizes, by_direction), fading)


FRICTION = FrictionModel(
    name="lugre-fading",
    summary="dynamic: LuGre friction with a bristle damping that fades with the rate",
    options=FadingOptions,
    parameters=_parameters,
    state_size=lambda options, step: 1,
    step=_step,
    viscous=mean_viscous,
    steady_state=steady_state,
    switches=lambda options: 1,
    changeable=(*(LUGRE.changeable or ()), "damping_velocity"),
    small_signal=LUGRE.small_signal,
    stored_energy=LUGRE.stored_energy,
    unknowns=_unknowns,
)
