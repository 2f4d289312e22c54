"""The motion that a model makes of the force that drove it: from one second to the next.

A small residual of forces may still move wrongly. The axis is released from where it was measured
to be, again and again, and goes its own way under the recorded force; dry friction holds it where
the force does not overcome it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from campaign.identification.inverse.motion import Array, Motion, later
from campaign.identification.inverse.terms import Terms, columns

STRETCH = 1.0
"""s that the axis goes its own way."""


def simulated_rate(
    motion: Motion, terms: Terms, values: Array, delay: float = 0.0, stretch: float = STRETCH
) -> tuple[NDArray[np.int64], Array]:
    """Samples of whole stretches, (m,) indices, and the rate that is simulated there, (m,).

    values: of the terms, the first of which is the inertia. Semi-implicit Euler at the sample rate:
    good to the step, as the force is held over it. Raises ValueError without a positive inertia or
    a whole stretch.
    """
    if terms[0].name != "inertia" or not values[0] > 0:
        raise ValueError("without a positive inertia nothing can be simulated")
    rate = motion.sample_rate
    steps = round(stretch * rate)
    count = len(motion.time) // steps
    if count < 1 or steps < 2:
        raise ValueError(f"the motion is shorter than {stretch:g} s")
    force = later(motion.force, delay, rate)[: count * steps].reshape(count, steps)
    warm = None
    if motion.temperature is not None:
        warm = motion.temperature[: count * steps].reshape(count, steps)
    q = motion.position[: count * steps : steps].copy()
    v = motion.rate[: count * steps : steps].copy()
    found = np.empty((count, steps))
    tiny = 1e-9 * max(float(np.abs(motion.rate).max()), 1e-300)

    def resisting(place: Array, at: Array, heat: Array | None) -> Array:
        """What the model's other terms ask for at a place and a rate, (count,)."""
        here = Motion(at, place, at, np.zeros_like(at), at, heat)
        return np.asarray(columns(here, terms[1:]) @ values[1:])

    for step in range(steps):
        found[:, step] = v
        heat, drive = None if warm is None else warm[:, step], force[:, step]
        forward = resisting(q, np.full_like(v, tiny), heat)
        backward = resisting(q, np.full_like(v, -tiny), heat)
        still = np.abs(v) <= tiny
        sign = np.where(drive > forward, 1.0, np.where(drive < backward, -1.0, 0.0))
        net = drive - resisting(q, np.where(still, sign * tiny, v), heat)
        new = v + np.where(still & (sign == 0.0), 0.0, net / values[0]) / rate
        # Whoever turns back stops first: whether it goes on is asked at the next step.
        new = np.where(v * new < 0.0, 0.0, new)
        q, v = q + 0.5 * (v + new) / rate, new
    return np.arange(count * steps, dtype=np.int64), found.ravel()


def relative_rate_error(
    motions: Sequence[Motion], terms: Terms, values: Array, delay: float = 0.0
) -> float:
    """RMS of simulated less measured rate over that of the measured one."""
    over, under = 0.0, 0.0
    for motion in motions:
        where, rate = simulated_rate(motion, terms, values, delay)
        over += float(np.sum((rate - motion.rate[where]) ** 2))
        under += float(np.sum(motion.rate[where] ** 2))
    return float(np.sqrt(over / under))
