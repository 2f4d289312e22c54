"""Elasto-plastic friction: LuGre's bristles, purely elastic up to a deflection z_ba.

    T = sigma0 z + sigma1 dz/dt + sigma2 v    dz/dt = v (1 - alpha(z, v) sigma0 z / s(v) sgn(v))

P. Dupont, V. Hayward, B. Armstrong and F. Altpeter, *Single state elastoplastic friction models*,
IEEE Trans. Automatic Control 47 (2002) 787 (there with an exponent i, here 1; the thesis has no
equation of it). alpha is 0 for |z| <= z_ba and if z and v have different signs, 1 beyond z_max =
s(v) / sigma0, and half a sine in between. So a load at |z| < z_ba does not drift under vibration;
beyond z_ba it drifts, as with LuGre at any z.

Scheme: with constant alpha, dz/dq is linear and has a closed form; alpha is that after half of the
path (exponential midpoint rule, second order, stable at any step). Below z_ba it is exact.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydantic import Field

from campaign.physics.compilation import called, pasted
from campaign.physics.elementary import sin, where
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

PI = np.pi


class ElastoPlasticOptions(LuGreOptions):
    """Parameters of elasto-plastic friction."""

    model: Literal["elasto-plastic"]  # type: ignore[assignment]
    """Elasto-plastic friction."""
    elastic_share: float = Field(default=0.7, ge=0, lt=1)
    """z_ba as a share of the least z_max, the smallest of all Tc and Ts / sigma0."""


def _parameters(options: ElastoPlasticOptions) -> Array:
    stiffness = options.bristle_stiffness
    least = min(
        in_direction(options, name, sign)
        for name in ("coulomb_torque", "static_torque")
        for sign in (1.0, -1.0)
    )
    elastic, damping_time = options.elastic_share * least, options.bristle_damping / stiffness
    return np.array([*curve_parameters(options), stiffness, damping_time, elastic])


def _step(parameters: Any, state: Any, motion: Motion) -> tuple[float, float]:
    """See `campaign.physics.step_function`. state[0] is sigma0 z (N m)."""
    parts, before = parts_of(motion), state[0]
    share, damping_time, viscous = parts.share, parameters[10], parameters[8]
    turned, starts, ends = _bent(parameters, before, parts.first, share * motion.step)
    after, _, last = _bent(parameters, turned, parts.last, (1.0 - share) * motion.step)
    ends = where(parts.turns, last, ends)
    state[0] = after
    v0, v1 = motion.rate_start, motion.rate_end
    mean = 0.5 * (share * (before + turned) + (1.0 - share) * (turned + after))
    mean = mean + damping_time * motion.per_step * (after - before)
    gained = parameters[9] * damping_time * (v1 * ends - v0 * starts)
    rise = viscous * (abs(v1) - abs(v0))
    return mean + 0.5 * viscous * (abs(v0) + abs(v1)), after - before + gained + rise


@pasted
def _plastic(w: float, s: float, elastic: float) -> float:
    """alpha, for a bristle torque w (N m) in the direction of motion."""
    span = where(s > elastic, s - elastic, 1.0)
    bend = 0.5 + 0.5 * sin(PI * ((w - 0.5 * (s + elastic)) / span))
    alpha: float = where(w >= s, 1.0, where(w <= elastic, 0.0, bend))
    return alpha


@called
def _bent(parameters: Any, torque: float, moved: float, time: float) -> tuple[float, float, float]:
    """sigma0 z after a part of a step; dz/dq at its start and at its end."""
    direction = sign_of(moved)
    s = curve_torque(parameters, direction, abs(moved) / where(time > 0.0, time, 1.0))
    way, elastic, w = parameters[9] * abs(moved), parameters[11], direction * torque
    alpha = _plastic(w, s, elastic)
    starts = 1.0 - alpha * w / s
    half = w + starts * 0.5 * way * decayed(0.5 * alpha * way / s)
    middle = _plastic(half, s, elastic)
    new = w + (1.0 - middle * w / s) * way * decayed(middle * way / s)
    new = where((w <= s) & (new > s), s, new)
    ends = 1.0 - _plastic(new, s, elastic) * new / s
    return where(moved != 0.0, direction * new, torque), starts, ends


FRICTION = FrictionModel(
    name="elasto-plastic",
    summary="dynamic: LuGre's bristles without drift below a deflection (Dupont et al. 2002)",
    options=ElastoPlasticOptions,
    parameters=_parameters,
    state_size=lambda options, step: 1,
    step=_step,
    viscous=mean_viscous,
    steady_state=steady_state,
    switches=lambda options: 3,
    changeable=LUGRE.changeable,
    small_signal=LUGRE.small_signal,
    stored_energy=LUGRE.stored_energy,
    unknowns=LUGRE.unknowns,
)
