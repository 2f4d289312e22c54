"""Simulated motion of an inverse model under its recorded force or command.

A model with a small force residual may still have a large error of motion. The simulation restarts
at intervals from the measured state and continues under the recorded force. Dry friction holds the
axis unless the force exceeds it. With a known commanded motion, the simulation is a closed loop
that follows it. Then it depends on measured data only through the model's parameters.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from campaign.arrays import Array
from campaign.estimation.inverse.motion import Motion, later, zero_phase
from campaign.estimation.inverse.terms import Terms

STRETCH = 1.0
"""Length of a simulated stretch (s)."""
LEAD = 1.0
"""Time before each stretch in which a loop settles from its initial state (s)."""
STEPS = 4.0
"""Fewest steps in the shortest time constant of a loop."""
MOST_STEPS = 50
"""Largest number of steps per sample; a loop that needs more is implausibly fast."""
FOLLOWS = 0.5
"""Least share of the force's variance that the commanded motion explains."""

Drive = Callable[[int, Array, Array], Array]


@dataclass(frozen=True)
class Loop:
    """Control law of a loop: force from the commanded and the actual motion.

    Attributes:
        stiffness, damping: force over error of position, and of rate.
        ahead: rest of the force, which depends only on the commanded motion, shape (n,).
        explained: share of the force's variance that the law explains.
    """

    stiffness: float
    damping: float
    ahead: Array
    explained: float


def find_loop(motion: Motion, wanted: Motion, low_pass: float) -> Loop:
    """Control law from force, motion and commanded motion, by least squares.

    The force has the same low-pass (Hz) as the motions. Terms of commanded position, rate and
    direction represent integral action. Raises ValueError if the errors do not explain the force.
    """
    error, slower = wanted.position - motion.position, wanted.rate - motion.rate
    own = (error, slower, np.ones_like(error), wanted.position, wanted.rate, wanted.acceleration,
           np.sign(wanted.rate))  # fmt: skip
    design = np.column_stack(own)
    size = np.linalg.norm(design, axis=0)
    size[size == 0.0] = 1.0
    force = zero_phase(motion.force, low_pass, motion.sample_rate)
    values = np.linalg.lstsq(design / size, force, rcond=None)[0] / size
    left = force - design @ values
    explained = 1.0 - float(np.var(left) / max(np.var(force), np.finfo(float).tiny))
    if explained < FOLLOWS or not (values[0] >= 0.0 and values[1] > 0.0):
        raise ValueError("the force does not follow from the setpoints as in a loop")
    ahead = np.asarray(design[:, 2:] @ values[2:])
    return Loop(float(values[0]), float(values[1]), ahead, explained)


def driven_motion(motion: Motion, terms: Terms, values: Array, delay: float = 0.0) -> Motion:
    """Simulated motion of whole stretches under the recorded force.

    values: of the terms; the first is the inertia. Each sample is one integration step with a
    constant force. Raises ValueError without a positive inertia or a whole stretch.
    """
    count, steps = _stretches(motion)
    force = later(motion.force, delay, motion.sample_rate)[: count * steps].reshape(count, steps)
    start = slice(0, count * steps, steps)
    warm = _heat(motion, np.arange(count * steps).reshape(count, steps))
    released = (motion.position[start], motion.rate[start])
    made = _going(
        motion, terms, values, released, steps, 1, warm, lambda k, place, rate: force[:, k]
    )
    return _joined(motion, made, 0)


def followed_motion(
    motion: Motion, wanted: Motion, loop: Loop, terms: Terms, values: Array
) -> Motion:
    """Simulated motion of whole stretches in a closed loop, from the commanded motion alone.

    Raises ValueError as `driven_motion` does, and for a loop that is too fast.
    """
    count, steps = _stretches(motion)
    lead = round(LEAD * motion.sample_rate)
    first = np.arange(count) * steps - lead
    where = np.clip(first[:, None] + np.arange(steps + lead), 0, None)
    place, rate, ahead = wanted.position[where], wanted.rate[where], loop.ahead[where]
    fastest = loop.damping / values[0] + math.sqrt(loop.stiffness / values[0])
    fine = math.ceil(STEPS * fastest / motion.sample_rate)
    if fine > MOST_STEPS:
        raise ValueError("the loop is faster than the recording")

    def drive(k: int, here: Array, now: Array) -> Array:
        error, slower = place[:, k] - here, rate[:, k] - now
        return np.asarray(loop.stiffness * error + loop.damping * slower + ahead[:, k])

    released = (place[:, 0], rate[:, 0])
    warm = _heat(motion, where)
    made = _going(motion, terms, values, released, steps + lead, max(fine, 1), warm, drive)
    return _joined(motion, made, lead)


def _stretches(motion: Motion) -> tuple[int, int]:
    steps = round(STRETCH * motion.sample_rate)
    count = len(motion.time) // max(steps, 1)
    if count < 1 or steps < 2:
        raise ValueError(f"the motion is shorter than {STRETCH:g} s")
    return count, steps


def _heat(motion: Motion, where: NDArray[np.int64]) -> Array | None:
    return None if motion.temperature is None else motion.temperature[where]


def _joined(motion: Motion, made: tuple[Array, Array, Array], lead: int) -> Motion:
    """Consecutive stretches as one motion, without their lead times."""
    place, rate, change = (each[:, lead:].ravel() for each in made)
    count = len(place)
    warm = None if motion.temperature is None else motion.temperature[:count]
    return Motion(motion.time[:count], place, rate, change, motion.force[:count], warm)


def _going(
    motion: Motion,
    terms: Terms,
    values: Array,
    released: tuple[Array, Array],
    steps: int,
    fine: int,
    warm: Array | None,
    drive: Drive,
) -> tuple[Array, Array, Array]:
    """Position, rate and acceleration of parallel stretches, each (count, steps)."""
    if terms[0].name != "inertia" or not values[0] > 0:
        raise ValueError("without a positive inertia nothing can be simulated")
    step = 1.0 / (motion.sample_rate * fine)
    q, v = (each.copy() for each in released)
    place, rate, change = (np.empty((len(q), steps)) for _ in range(3))
    tiny = 1e-9 * max(float(np.abs(motion.rate).max()), 1e-300)

    still, forces = np.zeros(len(q)), np.empty((len(q), len(terms) - 1))

    def resisting(place: Array, at: Array, heat: Array | None) -> Array:
        """Force of the other terms at a position and a rate, shape (count,)."""
        if len(terms) == 1:
            return still
        instant = Motion(at, place, at, still, at, heat)
        for column, term in enumerate(terms[1:]):
            forces[:, column] = term.column(instant)
        return np.asarray(forces @ values[1:])

    for k in range(steps):
        place[:, k], rate[:, k] = q, v
        heat = None if warm is None else warm[:, k]
        for _ in range(fine):
            force = drive(k, q, v)
            held = np.abs(v) <= tiny
            going = v
            if held.any():  # static friction acts in both directions
                forward = resisting(q, np.full_like(v, tiny), heat)
                backward = resisting(q, np.full_like(v, -tiny), heat)
                sign = np.where(force > forward, 1.0, np.where(force < backward, -1.0, 0.0))
                going = np.where(held, sign * tiny, v)
                held &= sign == 0.0
            net = force - resisting(q, going, heat)
            new = v + np.where(held, 0.0, net / values[0]) * step
            # At a reversal the axis stops; the next step decides whether it moves again.
            new = np.where(v * new < 0.0, 0.0, new)
            q, v = q + 0.5 * (v + new) * step, new
        change[:, k] = (v - rate[:, k]) * motion.sample_rate
    return place, rate, change


def relative_rate_error(
    motions: Sequence[Motion], terms: Terms, values: Array, delay: float = 0.0
) -> float:
    """RMS of simulated less measured rate over RMS of the measured rate."""
    over, under = 0.0, 0.0
    for motion in motions:
        # Negative friction, as by a wrong sign, diverges: the error is infinite, without a warning.
        with np.errstate(over="ignore", invalid="ignore"):
            rate = driven_motion(motion, terms, values, delay).rate
            over += float(np.sum((rate - motion.rate[: len(rate)]) ** 2))
        under += float(np.sum(motion.rate[: len(rate)] ** 2))
    return float(np.sqrt(over / under))
