"""Rigs that nobody tuned anything on, linear and rotating, simulated without this program.

Masses of kilograms and inertias of motors; encoders that count, encoders that are noisy, and
tachometers alone; forces with noise and late by up to two and a half samples; friction that differs
with direction, falls or rises as sliding sets in, and repeats over position; cable springs; a
constant load; disturbances that nobody recorded. Motions are a few sines, or trapezoids at several
speeds. Semi-implicit Euler in steps of 0.1 ms, with friction that holds what does not overcome it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from campaign.arrays import Array

Draw = np.random.Generator

RATE = 1000.0
FINE = 10
LINES = 6
SPEEDS = 5
SENSORS = ("counts", "noisy angle", "rate")


@dataclass(frozen=True)
class BlindRig:
    """A rig and a recording of it.

    Attributes:
        truth: its numbers by name (SI).
        facts: what kind of rig it is, for telling what intervals missed.
        angle, rate: as measured, the one or the other.
        wanted: position; None where nobody recorded it.
    """

    is_linear: bool
    truth: Mapping[str, float]
    facts: Mapping[str, object]
    time: Array
    force: Array
    angle: Array | None
    rate: Array | None
    wanted: Array | None


def blind_rigs(count: int, seed: int, *, seconds: float = 20.0) -> list[BlindRig]:
    """`count` rigs, every second one linear."""
    draw = np.random.default_rng(seed)
    linear = np.arange(count) % 2 == 0
    low, high = np.where(linear, -0.5, -4.0), np.where(linear, 2.7, 2.0)
    inertia = 10 ** draw.uniform(low, high)
    fastest = 10 ** np.where(linear, draw.uniform(-2, 0.3, count), draw.uniform(-1, 1.5, count))
    acceleration = fastest * 10 ** draw.uniform(0.4, 1.2, count)
    dry = inertia * acceleration * 10 ** draw.uniform(-0.8, 0.1, count)
    uneven = draw.random(count) < 0.6
    forward, backward = dry, dry * np.where(uneven, draw.uniform(0.75, 1.3, count), 1.0)
    viscous = dry / fastest * 10 ** draw.uniform(-0.7, 0.3, count)
    viscous_back = viscous * np.where(uneven, draw.uniform(0.65, 1.4, count), 1.0)
    shape = draw.integers(0, 3, count)
    rising, falling = draw.uniform(0.5, 0.9, count), draw.uniform(1.1, 1.6, count)
    ratio = np.choose(shape, [np.ones(count), rising, falling])
    slow = fastest * 10 ** draw.uniform(-2.0, -1.0, count)
    load = dry * np.where(draw.random(count) < 0.3, draw.uniform(-0.3, 0.3, count), 0.0)
    samples = round(seconds * RATE)
    time = np.arange(samples) / RATE
    wanted, wanted_rate, steps = _wanted(draw, time, fastest, acceleration)
    travel = np.ptp(wanted, axis=0)
    has_spring, has_ripple = draw.random(count) < 0.4, draw.random(count) < 0.4
    spring = np.where(has_spring, draw.uniform(0.3, 1.0, count), 0.0) * dry / travel
    ripple = np.where(has_ripple, draw.uniform(0.05, 0.2, count), 0.0)
    period, phase = travel / draw.uniform(3, 25, count), draw.uniform(0, 2 * np.pi, count)
    late = draw.integers(0, 3, count)
    sensor = draw.choice(3, count, p=[0.5, 0.3, 0.2])
    counted = travel * 10 ** draw.uniform(-6.5, -4, count)
    angle_noise = np.where(sensor == 1, travel * 10 ** draw.uniform(-6.5, -4.5, count), 0.0)
    rate_noise = fastest * 10 ** draw.uniform(-3.5, -2, count)
    shaking, hiss = dry * 10 ** draw.uniform(-2, -1, count), dry * 10 ** draw.uniform(-3, -1, count)
    told = draw.random(count) < 0.5
    omega = 2 * np.pi * 10 ** draw.uniform(0.8, 1.3, count)
    stiff, damped = inertia * omega**2, 1.8 * inertia * omega
    angle, rate, seen_rate, before, turned = (np.zeros(count) for _ in range(5))
    seen, seen_speed, force = (np.empty((samples, count)) for _ in range(3))
    step, rigs = 1.0 / (RATE * FINE), np.arange(count)
    for k in range(samples):
        encoder = angle + angle_noise * draw.standard_normal(count)
        encoder = np.where(sensor == 0, np.round(encoder / counted) * counted, encoder)
        speed = rate + rate_noise * draw.standard_normal(count)
        turned = turned + speed / RATE
        fresh = np.where(sensor == 2, speed, (encoder - before) * RATE)
        seen_rate = seen_rate + 0.2 * (fresh - seen_rate)
        before = encoder
        place = np.where(sensor == 2, turned, encoder)
        force[k] = stiff * (wanted[k] - place) + damped * (wanted_rate[k] - seen_rate)
        seen[k], seen_speed[k] = encoder, speed
        acting = force[np.maximum(k - late, 0), rigs] + shaking * draw.standard_normal(count)
        for _ in range(FINE):
            fall = 1.0 + (ratio - 1.0) * np.exp(-((rate / slow) ** 2))
            fall = fall + ripple * np.sin(2 * np.pi * angle / period + phase)
            sliding = np.where(
                rate > 0, forward * fall + viscous * rate, -backward * fall + viscous_back * rate
            )
            drive = acting - spring * angle - load
            up, down = forward * fall, backward * fall
            freed = np.where(drive > up, drive - up, np.where(drive < -down, drive + down, 0.0))
            new = rate + step * np.where(rate == 0.0, freed, drive - sliding) / inertia
            new = np.where(rate * new < 0.0, 0.0, new)
            angle, rate = angle + 0.5 * step * (rate + new), new
    force += hiss * draw.standard_normal((samples, count))
    return [
        BlindRig(
            bool(linear[i]),
            {
                "inertia": float(inertia[i]),
                # A constant load cannot be told from what differs with direction.
                "coulomb_positive": float(forward[i] + load[i]),
                "coulomb_negative": float(backward[i] - load[i]),
                "viscous_positive": float(viscous[i]),
                "viscous_negative": float(viscous_back[i]),
                "static_over_coulomb_positive": float(
                    (ratio[i] * forward[i] + load[i]) / (forward[i] + load[i])
                ),
                "static_over_coulomb_negative": float(
                    (ratio[i] * backward[i] - load[i]) / (backward[i] - load[i])
                ),
                "stribeck_velocity": float(slow[i]),
                "spring": float(spring[i]),
                "delay": (float(late[i]) + 0.5) / RATE,  # half a sample: the force is held
            },
            {
                "sensor": SENSORS[sensor[i]],
                "motion": "trapezoids" if steps[i] else "sines",
                "static": float(ratio[i]),
                "ripple": float(ripple[i]),
                "load": float(load[i]),
            },
            time,
            force[:, i],
            seen[:, i] if sensor[i] < 2 else None,
            seen_speed[:, i] if sensor[i] == 2 else None,
            wanted[:, i] if told[i] else None,
        )
        for i in range(count)
    ]


def _wanted(
    draw: Draw, time: Array, fastest: Array, acceleration: Array
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Positions and rates that are wanted, shape (n, rigs), and which are trapezoids."""
    sines = _sines(draw, time, fastest)
    steps = draw.random(len(fastest)) < 0.4
    ramps = _trapezoids(draw, time, fastest, acceleration)
    rate = np.where(steps, ramps, sines)
    angle = np.cumsum(rate, axis=0) / RATE
    return angle - angle[0], rate, steps


def _sines(draw: Draw, time: Array, fastest: Array) -> Array:
    """Rates: a few sines up to 1 Hz, which begin at rest."""
    count = len(fastest)
    frequency = 2 * np.pi * draw.uniform(0.1, 1.0, (LINES, count))
    phase, size = draw.uniform(0, 2 * np.pi, (LINES, count)), draw.uniform(0.3, 1.0, (LINES, count))
    rate = np.einsum("lc,tlc->tc", size, np.sin(frequency * time[:, None, None] + phase))
    rate *= np.minimum(time, 0.5)[:, None] / 0.5
    return np.asarray(rate * fastest / np.abs(rate).max(axis=0))


def _trapezoids(draw: Draw, time: Array, fastest: Array, acceleration: Array) -> Array:
    """Rates: forth and back at several speeds, as long for each, with ramps as steep for all."""
    stroke = time[-1] / (2 * SPEEDS)
    speeds = fastest * np.linspace(0.15, 1.0, SPEEDS)[:, None] * np.ones(len(fastest))
    speeds = draw.permuted(speeds, axis=0)
    which = np.minimum((time / (2 * stroke)).astype(int), SPEEDS - 1)
    within = time - 2 * stroke * which
    back = within >= stroke
    edge = np.minimum(within - back * stroke, (1 + back) * stroke - within)
    size = np.minimum(speeds[which], acceleration * np.maximum(edge, 0.0)[:, None])
    return np.asarray(np.where(back[:, None], -size, size))
