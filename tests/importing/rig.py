"""A small rig: motions and the torques they take; it shares no code with the program."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

INERTIA, VISCOUS, COULOMB = 0.8, 1.5, 3.0  # kg m^2, N m s/rad, N m
TORQUE_CONSTANT = 1.7  # N m/A, at the load


@dataclass(frozen=True)
class Motion:
    """SI, shape (n,) each; what sensors add is added, and the torque is the drive's."""

    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
    tau: np.ndarray
    i: np.ndarray
    target: np.ndarray


def rounded(values: np.ndarray, step: float) -> np.ndarray:
    return np.round(values / step) * step if step else values


def sines(seed: int, rate: float = 1000.0, length: float = 8.0, size: float = 1.0) -> Motion:
    """Several sines that begin and end at rest, with friction of Coulomb and viscous."""
    chance = np.random.default_rng(seed)
    t = np.arange(int(rate * length)) / rate
    window = np.sin(np.pi * t / length) ** 2
    q = np.zeros_like(t)
    for frequency in chance.uniform(0.3, 2.0, 3):
        q += np.sin(2 * np.pi * frequency * t + chance.uniform(0, 6)) / frequency
    return _driven(chance, t, size * q * window)


def trapezoids(seed: int, rate: float = 1000.0, length: float = 8.0, size: float = 1.0) -> Motion:
    """Constant rates, to and fro, with rests between: a friction test."""
    chance = np.random.default_rng(seed)
    t = np.arange(int(rate * length)) / rate
    levels = size * np.repeat(chance.uniform(0.2, 1.5, 4), 2) * np.tile([1, -1], 4)
    parts = 8
    v = np.zeros_like(t)
    for k, level in enumerate(levels):
        x = (t - k * length / parts) / (length / parts)
        v += level * np.clip(np.minimum(x, 1 - x) / 0.2 - 0.3, 0, 1) * ((x > 0) & (x < 1))
    return _driven(chance, t, np.cumsum(v) / rate)


def _driven(chance: np.random.Generator, t: np.ndarray, q: np.ndarray) -> Motion:
    step = t[1] - t[0]
    v = np.gradient(q, step)
    a = np.gradient(v, step)
    tau = INERTIA * a + VISCOUS * v + COULOMB * np.tanh(v / 0.01)
    noisy = tau + chance.normal(0, 0.02, len(t))
    current = noisy / TORQUE_CONSTANT
    return Motion(t, q, v + chance.normal(0, 1e-3, len(t)), noisy, current, q.copy())


def standstill(seed: int, rate: float = 1000.0, length: float = 4.0) -> Motion:
    """Noise around nothing, and an encoder that flickers between two counts."""
    chance = np.random.default_rng(seed)
    t = np.arange(int(rate * length)) / rate
    q = rounded(0.3 + chance.normal(0, 4e-5, len(t)), 1e-4)
    noise = chance.normal(0, 0.02, len(t))
    v = chance.normal(0, 1e-3, len(t))
    return Motion(t, q, v, noise, noise / TORQUE_CONSTANT, np.full_like(t, 0.3))


def stick_slip(seed: int, rate: float = 1000.0, length: float = 8.0) -> Motion:
    """A mass drawn by a spring whose end moves evenly: it sticks, and slips (Karnopp's way)."""
    chance = np.random.default_rng(seed)
    spring, speed = chance.uniform(20, 60), chance.uniform(0.05, 0.2)
    t = np.arange(int(rate * length)) / rate
    fine = 4
    q = v = 0.0
    there = np.zeros((len(t), 3))
    for k in range(len(t)):
        for part in range(fine):
            pull = spring * (speed * (t[k] + part / rate / fine) - q)
            if v == 0 and abs(pull) <= 1.6 * COULOMB:
                continue
            direction = np.sign(v) or np.sign(pull)
            after = v + (pull - COULOMB * direction - 0.2 * v) / INERTIA / rate / fine
            v = 0.0 if v and after * v <= 0 else after
            q += v / rate / fine
        there[k] = q, v, spring * (speed * t[k] - q)
    tau = there[:, 2] + chance.normal(0, 0.02, len(t))
    return Motion(t, there[:, 0], there[:, 1], tau, tau / TORQUE_CONSTANT, speed * t)
