"""Rigs of random sizes, simulated without this program: what identification has not seen.

Inertia, Coulomb, static and viscous friction of each direction, driven by a loop of its own on a
quantised encoder; the force acts up to two and a half samples after it is recorded, and a
disturbance that nobody recorded acts besides. Semi-implicit Euler in steps of 0.1 ms, with friction
that holds what does not overcome it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from campaign.arrays import Array

RATE = 1000.0
FINE = 10
LINES = 6


@dataclass(frozen=True)
class Rig:
    """A rig and a recording of it; `truth` has its numbers by name (SI)."""

    truth: dict[str, float]
    time: Array
    angle: Array
    force: Array
    wanted: Array


def random_rigs(
    count: int, seed: int, *, stribeck: bool = False, seconds: float = 20.0
) -> list[Rig]:
    """`count` rigs, side by side in each array."""
    draw = np.random.default_rng(seed)
    inertia = 10 ** draw.uniform(-2, 2, count)
    fastest = 10 ** draw.uniform(-1.5, 0.5, count)
    acceleration = fastest * 10 ** draw.uniform(0.4, 1.2, count)
    forward = inertia * acceleration * 10 ** draw.uniform(-0.8, 0.1, count)
    backward = forward * draw.uniform(0.75, 1.3, count)
    ratio = draw.uniform(0.5, 1.6, count) if stribeck else np.ones(count)
    slow = fastest * 10 ** draw.uniform(-1.7, -0.8, count)
    viscous = forward / fastest * 10 ** draw.uniform(-0.7, 0.3, count)
    viscous_back = viscous * draw.uniform(0.65, 1.4, count)
    late = np.zeros(count, dtype=int) if stribeck else draw.integers(0, 3, count)
    samples = round(seconds * RATE)
    time = np.arange(samples) / RATE
    wanted, wanted_rate = _wanted(draw, time, fastest)
    omega = 2 * np.pi * 10 ** draw.uniform(0.8, 1.3, count)
    stiff, damped = inertia * omega**2, 1.8 * inertia * omega
    travel = np.ptp(wanted, axis=0)
    count_size = travel * 10 ** draw.uniform(-6.5, -5 if stribeck else -4, count)
    shaking = forward * 10 ** draw.uniform(-2, -1, count)
    seen, force = _run(
        wanted,
        wanted_rate,
        stiff,
        damped,
        count_size,
        shaking[:, None] * draw.standard_normal((samples, count)).T,
        late,
        inertia,
        ratio,
        slow,
        np.stack([forward, viscous, backward, viscous_back], axis=1),
    )
    return [
        Rig(
            {
                "inertia": float(inertia[i]),
                "coulomb_positive": float(forward[i]),
                "coulomb_negative": float(backward[i]),
                "viscous_positive": float(viscous[i]),
                "viscous_negative": float(viscous_back[i]),
                "static_over_coulomb": float(ratio[i]),
                "stribeck_velocity": float(slow[i]),
                "delay": (float(late[i]) + 0.5) / RATE,  # half a sample: the force is held
            },
            time,
            seen[i],
            force[i],
            wanted[:, i],
        )
        for i in range(count)
    ]


@numba.njit(error_model="numpy")
def _run(
    wanted: Array,
    wanted_rate: Array,
    stiff: Array,
    damped: Array,
    count_size: Array,
    shaking: Array,
    late: Array,
    inertia: Array,
    ratio: Array,
    slow: Array,
    friction: Array,
) -> tuple[Array, Array]:
    """Angle that the encoder shows and force that is recorded, (rigs, n) each.

    `friction`: Coulomb and viscous of both directions, shape (rigs, 4); the others of each rig.
    """
    samples, count = wanted.shape
    seen, force = np.empty((count, samples)), np.empty((count, samples))
    step = 1.0 / (RATE * FINE)
    for rig in range(count):
        angle, rate, seen_rate, before = 0.0, 0.0, 0.0, 0.0
        forward, viscous, backward, viscous_back = friction[rig]
        up, down = forward * ratio[rig], backward * ratio[rig]
        for k in range(samples):
            encoder = np.rint(angle / count_size[rig]) * count_size[rig]
            seen_rate = seen_rate + 0.2 * ((encoder - before) * RATE - seen_rate)
            before = encoder
            force[rig, k] = stiff[rig] * (wanted[k, rig] - encoder) + damped[rig] * (
                wanted_rate[k, rig] - seen_rate
            )
            seen[rig, k] = encoder
            acting = force[rig, max(k - late[rig], 0)] + shaking[rig, k]
            for _ in range(FINE):
                if rate == 0.0:
                    left = acting - up if acting > up else min(acting + down, 0.0)
                else:
                    fall = 1.0
                    if ratio[rig] != 1.0:
                        fall += (ratio[rig] - 1.0) * np.exp(-((rate / slow[rig]) ** 2))
                    if rate > 0.0:
                        left = acting - (forward * fall + viscous * rate)
                    else:
                        left = acting - (viscous_back * rate - backward * fall)
                new = rate + step * left / inertia[rig]
                if rate * new < 0.0:
                    new = 0.0
                angle, rate = angle + 0.5 * step * (rate + new), new
    return seen, force


def _wanted(draw: np.random.Generator, time: Array, fastest: Array) -> tuple[Array, Array]:
    """Angles and rates that are wanted: a few sines up to 1 Hz, shape (n, rigs)."""
    count = len(fastest)
    frequency = 2 * np.pi * draw.uniform(0.1, 1.0, (LINES, count))
    phase, size = draw.uniform(0, 2 * np.pi, (LINES, count)), draw.uniform(0.3, 1.0, (LINES, count))
    turned = frequency[None] * time[:, None, None] + phase
    rate = (size * np.sin(turned)).sum(axis=1)
    angle = (size / frequency * (np.cos(phase) - np.cos(turned))).sum(axis=1)
    scale = fastest / np.abs(rate).max(axis=0)
    return angle * scale, rate * scale
