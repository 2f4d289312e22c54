"""Friction of steady sliding, summed over the interfaces at the load."""

from __future__ import annotations

import numpy as np

from campaign.arrays import Array
from campaign.physics.bench import Bench
from campaign.physics.friction import model_of
from campaign.physics.variation import of_its_day


def steady_friction(bench: Bench, rate: Array) -> tuple[Array, Array]:
    """Torque at the load (N m) at constant relative `rate` (rad/s): dry part, viscous part; (n,).

    The dry part has the sign of the rate: s(v) sgn(v) of Equation 4.6. Friction is that of the
    bench's day and preload, at the mean of the ripple over position.
    """
    dry, viscous = np.zeros_like(rate), np.zeros_like(rate)
    for friction in of_its_day(bench).friction.values():
        model = model_of(friction)
        torque, rate_ratio = bench.at_load(friction)
        speed = rate * rate_ratio
        linear = model.viscous(friction) * speed
        viscous += torque * linear
        dry += torque * (model.steady_state(friction, speed) - linear)
    return dry, viscous
