"""Rigs of random sizes, simulated without this program: what identification has not seen.

Inertia, Coulomb, static and viscous friction of each direction, driven by a loop of its own on a
quantised encoder; the force acts up to two and a half samples after it is recorded, and a
disturbance that nobody recorded acts besides. Semi-implicit Euler in steps of 0.1 ms, with friction
that holds what does not overcome it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

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
    angle, rate, seen_rate, before = (np.zeros(count) for _ in range(4))
    seen, force = np.empty((samples, count)), np.empty((samples, count))
    step, rigs = 1.0 / (RATE * FINE), np.arange(count)
    for k in range(samples):
        encoder = np.round(angle / count_size) * count_size
        seen_rate = seen_rate + 0.2 * ((encoder - before) * RATE - seen_rate)
        before = encoder
        force[k] = stiff * (wanted[k] - encoder) + damped * (wanted_rate[k] - seen_rate)
        seen[k] = encoder
        acting = force[np.maximum(k - late, 0), rigs] + shaking * draw.standard_normal(count)
        for _ in range(FINE):
            fall = 1.0 + (ratio - 1.0) * np.exp(-((rate / slow) ** 2))
            sliding = np.where(
                rate > 0, forward * fall + viscous * rate, -backward * fall + viscous_back * rate
            )
            up, down = forward * ratio, backward * ratio
            freed = np.where(acting > up, acting - up, np.where(acting < -down, acting + down, 0.0))
            new = rate + step * np.where(rate == 0.0, freed, acting - sliding) / inertia
            new = np.where(rate * new < 0.0, 0.0, new)
            angle, rate = angle + 0.5 * step * (rate + new), new
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
            seen[:, i],
            force[:, i],
            wanted[:, i],
        )
        for i in range(count)
    ]


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
