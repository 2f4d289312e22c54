"""Simulated motion of an inverse model under its recorded force or command.

A small residual of forces may still move wrongly. The axis is released from where it was measured
to be, again and again, and goes its own way under the recorded force; dry friction holds it where
the force does not overcome it. Where it is known what motion was wanted, a loop follows that, and
nothing that was measured is in the simulated motion but the model's few numbers.
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
"""s that the axis goes its own way."""
LEAD = 1.0
"""s before each stretch in which a loop forgets where it was released."""
STEPS = 4.0
"""Steps at least within the fastest time of a loop."""
MOST_STEPS = 50
"""within a sample: a loop that is faster is none of this axis."""
FOLLOWS = 0.5
"""of the force's variance: below that it does not follow from what was wanted."""

Drive = Callable[[int, Array, Array], Array]


@dataclass(frozen=True)
class Loop:
    """What a loop makes of what is wanted and of what is.

    Attributes:
        stiffness, damping: force over error of position, and of rate.
        ahead: the rest of the force, decided by the wanted motion alone, shape (n,).
        explained: share of the force's variance that all of it makes up.
    """

    stiffness: float
    damping: float
    ahead: Array
    explained: float


def find_loop(motion: Motion, wanted: Motion, low_pass: float) -> Loop:
    """The loop that made the force of a wanted motion, by least squares.

    The force passes the same low-pass (Hz) as the motions did. Integral action goes with what it
    works against: place, rate and direction that were wanted. Raises ValueError where the
    force does not follow from the errors.
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
    """Whole stretches of a motion as the model makes them of the recorded force.

    values: of the terms, the first of which is the inertia. Semi-implicit Euler at the sample rate:
    good to the step, as the force is held over it. Raises ValueError without a positive inertia or
    a whole stretch.
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
    """Whole stretches of a motion as the model makes them within a loop, of what was wanted alone.

    Raises ValueError as `driven_motion` does.
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
    """Stretches one after the other, without what led to each."""
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
    """Position, rate and acceleration of stretches beside each other, each (count, steps)."""
    if terms[0].name != "inertia" or not values[0] > 0:
        raise ValueError("without a positive inertia nothing can be simulated")
    step = 1.0 / (motion.sample_rate * fine)
    q, v = (each.copy() for each in released)
    place, rate, change = (np.empty((len(q), steps)) for _ in range(3))
    tiny = 1e-9 * max(float(np.abs(motion.rate).max()), 1e-300)

    still, asked = np.zeros(len(q)), np.empty((len(q), len(terms) - 1))

    def resisting(place: Array, at: Array, heat: Array | None) -> Array:
        """What the model's other terms ask for at a place and a rate, (count,)."""
        if len(terms) == 1:
            return still
        here = Motion(at, place, at, still, at, heat)
        for column, term in enumerate(terms[1:]):
            asked[:, column] = term.column(here)
        return np.asarray(asked @ values[1:])

    for k in range(steps):
        place[:, k], rate[:, k] = q, v
        heat = None if warm is None else warm[:, k]
        for _ in range(fine):
            force = drive(k, q, v)
            held = np.abs(v) <= tiny
            going = v
            if held.any():  # what holds an axis is asked for in both directions
                forward = resisting(q, np.full_like(v, tiny), heat)
                backward = resisting(q, np.full_like(v, -tiny), heat)
                sign = np.where(force > forward, 1.0, np.where(force < backward, -1.0, 0.0))
                going = np.where(held, sign * tiny, v)
                held &= sign == 0.0
            net = force - resisting(q, going, heat)
            new = v + np.where(held, 0.0, net / values[0]) * step
            # Whoever turns back stops first: whether it goes on is asked at the next step.
            new = np.where(v * new < 0.0, 0.0, new)
            q, v = q + 0.5 * (v + new) * step, new
        change[:, k] = (v - rate[:, k]) * motion.sample_rate
    return place, rate, change


def relative_rate_error(
    motions: Sequence[Motion], terms: Terms, values: Array, delay: float = 0.0
) -> float:
    """RMS of simulated less measured rate over that of the measured one."""
    over, under = 0.0, 0.0
    for motion in motions:
        # Friction that drives, as a swapped sign makes it, runs away: infinite, and no warning.
        with np.errstate(over="ignore", invalid="ignore"):
            rate = driven_motion(motion, terms, values, delay).rate
            over += float(np.sum((rate - motion.rate[: len(rate)]) ** 2))
        under += float(np.sum(motion.rate[: len(rate)] ** 2))
    return float(np.sqrt(over / under))
