"""Generalized Maxwell-slip friction: N parallel elements that stick or slip (Eq. 3.23 to 3.25).

V. Lampaert, F. Al-Bender and J. Swevers, *A generalized Maxwell-slip friction model appropriate for
control purposes*, Physics and Control (2003) 1170; F. Al-Bender, V. Lampaert and J. Swevers, IEEE
Trans. Automatic Control 50 (2005) 1883.

    sticks:  dTi/dt = ki v                        until |Ti| > alpha_i |s(v)| in the direction of v
    slips:   dTi/dt = C (alpha_i sgn(v) - Ti / |s(v)|)       until v goes through zero

**Caution.** Equation 3.25 prints sgn(v) C (alpha_i - Ti / s(v)), which needs the signed s of
Equation 3.4; with the unsigned s of Equation 3.18 it diverges while v < 0. Equation 3.24 prints
Ti > alpha_i s(v), which needs |Ti|. The alpha have to sum to 1, else sliding deviates from s(v).

With Ts = Tc an element never leaves its level, and these are Maxwell-slip elements: the torque
follows Masing's rules, and only the springs store energy. With Ts > Tc no storage function is
known: an attracted element can stretch its spring faster than the motion does.

Scheme: s is a straight line over each part of a step in one direction. So is the torque of a
sticking element; slipping is an exponential; a slip can begin inside the part. Second order, stable
for any C.
"""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
from pydantic import Field

from campaign.physics.compilation import called
from campaign.physics.elementary import exp, where
from campaign.physics.friction.elements import ElementOptions, count_of, shares_of
from campaign.physics.friction.interface import Array, FrictionModel, SmallSignal
from campaign.physics.friction.path import decayed, parts_of, sign_of
from campaign.physics.friction.stribeck import (
    CURVE,
    CurveOptions,
    curve_parameters,
    curve_torque,
    in_direction,
    mean_viscous,
    steady_state,
)
from campaign.physics.friction.unknowns import (
    SLIDE,
    FrictionUnknown,
    Sizes,
    Unknowns,
    curve,
    stiffness,
)
from campaign.physics.step_function import Motion
from campaign.units import RotationalStiffness, TorqueRate

OWN = 11
"""Number of parameters before those of the elements."""


class GmsOptions(CurveOptions, ElementOptions):
    """Parameters of generalized Maxwell-slip friction."""

    model: Literal["gms"]
    """Generalized Maxwell-slip friction."""
    bristle_stiffness: RotationalStiffness = Field(gt=0)
    """sigma0: sum of the stiffnesses of all elements."""
    attraction: TorqueRate = Field(gt=0)
    """C: speed at which slipping elements approach the Stribeck curve; the lag is s(v) / C."""


def _parameters(options: GmsOptions) -> Array:
    torques, stiffnesses = shares_of(options)
    own = [*curve_parameters(options), options.attraction, float(count_of(options))]
    return np.array([*own, *torques, *(options.bristle_stiffness * stiffnesses)])


def _step(parameters: Any, state: Any, motion: Motion) -> tuple[float, float]:
    """See `campaign.physics.step_function`.

    The state: torques of the elements (N m), followed by their directions of slip, 0 if stuck.
    """
    parts, v0, v1 = parts_of(motion), abs(motion.rate_start), abs(motion.rate_end)
    rest, before = 1.0 - parts.share, 0.0 * v0
    for i in range(state.shape[0] // 2):
        before = before + state[i]
    between, lasts = where(parts.turns, 0.0, v1), parts.share * motion.step
    mean, after = _slid(parameters, state, parts.first, lasts, v0, between, before)
    last, ends = _slid(parameters, state, parts.last, rest * motion.step, between, v1, after)
    mean = where(parts.turns, parts.share * mean + rest * last, mean)
    after = where(parts.turns, ends, after)
    viscous = parameters[8]
    return mean + viscous * 0.5 * (v0 + v1), after - before + viscous * (v1 - v0)


@called
def _slid(
    parameters: Any, state: Any, moved: float, time: float, v0: float, v1: float, held: float
) -> tuple[float, float]:
    """Advance all elements over a part of a step; mean torque and torque at its end.

    v0, v1: speeds at the start and the end (rad/s).   held: torque at the start (N m), which is
    unchanged without motion.
    """
    moves, direction, count = moved != 0.0, sign_of(moved), state.shape[0] // 2
    starts, ends = curve_torque(parameters, direction, v0), curve_torque(parameters, direction, v1)
    lasts = parameters[9] * time / (0.5 * (starts + ends))
    gone, mean_gone = 1.0 - exp(-lasts), 1.0 - decayed(lasts)
    mean, total = 0.0 * held, 0.0 * held
    for i in range(count):
        share, torque, slips = parameters[OWN + i], state[i], state[count + i]
        pulled, w = parameters[OWN + count + i] * abs(moved), direction * torque
        level, rise = share * starts, share * (ends - starts)
        slipping, trial = slips * direction > 0.0, w + pulled
        free = slipping | (trial > level + rise)
        # It sticks for `part` until it reaches its level, and then decays towards it.
        sticks = where(slipping | (w > level), 0.0, level - w)
        closing = pulled - rise
        part = where(closing > sticks, sticks / where(closing > sticks, closing, 1.0), 0.0)
        begins = w + part * pulled
        target = level + rise * (0.5 + 0.5 * part)
        new = begins + (target - begins) * gone * (1.0 - part)
        slid = begins + (target - begins) * mean_gone * (1.0 - part)
        slid = 0.5 * part * (w + begins) + (1.0 - part) * slid
        state[i] = where(moves, direction * where(free, new, trial), torque)
        state[count + i] = where(moves, where(free, direction, 0.0), slips)
        mean = mean + direction * where(free, slid, 0.5 * (w + trial))
        total = total + state[i]
    return where(moves, mean, held), where(moves, total, held)


def _stored_energy(options: GmsOptions, state: Array) -> float:
    """Energy of the springs for a flat curve; else NaN."""
    signs = (1.0, -1.0)
    names = ("coulomb_torque", "static_torque")
    coulomb, static = ([in_direction(options, name, sign) for sign in signs] for name in names)
    if coulomb != static:
        return math.nan
    stiffnesses = options.bristle_stiffness * shares_of(options)[1]
    return float(0.5 * np.sum(state[: len(stiffnesses)] ** 2 / stiffnesses))


def _unknowns(sizes: Sizes, by_direction: bool) -> Unknowns:
    """Unknowns, with a lag s(v) / C from 1e-6 to 1e3 times the time of a whole stroke."""
    usual = sizes.torque * sizes.rate / sizes.travel
    attraction = FrictionUnknown(
        "attraction", "attraction", "N m/s", "How fast slipping elements approach the curve.",
        1e-3 * usual, 1e6 * usual, 1e2 * usual, SLIDE, logarithmic=True,
    )  # fmt: skip
    return (*curve(sizes, by_direction), stiffness(sizes), attraction)


FRICTION = FrictionModel(
    name="gms",
    summary="dynamic: N Maxwell-slip elements with a Stribeck curve and lag (Eq. 3.23 to 3.25)",
    options=GmsOptions,
    parameters=_parameters,
    state_size=lambda options, step: 2 * count_of(options),
    step=_step,
    viscous=mean_viscous,
    steady_state=steady_state,
    switches=lambda options: 1 + count_of(options),
    changeable=(*CURVE, "bristle_stiffness", "attraction"),
    small_signal=lambda options: SmallSignal.of_bristles(options.bristle_stiffness),
    stored_energy=_stored_energy,
    unknowns=_unknowns,
)
