"""Two-mass drives and loops around them, simulated by scipy alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from campaign.arrays import Array


@dataclass(frozen=True)
class Drive:
    """Two inertias on a spring; states: motor rate, twist, load rate (SI)."""

    motor: float
    load: float
    stiffness: float
    damping: float
    motor_friction: float
    load_friction: float = 0.0

    @property
    def a(self) -> Array:
        j1, j2, k, d = self.motor, self.load, self.stiffness, self.damping
        b1, b2 = self.motor_friction, self.load_friction
        return np.array(
            [[-(b1 + d) / j1, -k / j1, d / j1], [1.0, 0.0, -1.0], [d / j2, k / j2, -(b2 + d) / j2]]
        )

    @property
    def b(self) -> Array:
        return np.array([[1.0 / self.motor], [0.0], [0.0]])

    @property
    def antiresonance(self) -> float:
        return np.sqrt(self.stiffness / self.load) / (2 * np.pi)

    @property
    def resonance(self) -> float:
        return np.sqrt(self.stiffness * (1 / self.motor + 1 / self.load)) / (2 * np.pi)

    @property
    def pole(self) -> complex:
        """Of the resonance (rad/s), friction included."""
        found = np.linalg.eigvals(self.a)
        return found[np.argmax(found.imag)]

    def response(self, frequency: Array, side: str) -> Array:
        """Rate over torque."""
        row = 0 if side == "motor" else 2
        eye = np.eye(3)
        at = [np.linalg.solve(2j * np.pi * f * eye - self.a, self.b)[row, 0] for f in frequency]
        return np.array(at)

    def rates(self, torque: Array, rate: float) -> Array:
        """Motor and load rate, shape (2, ..., n), from rest, of torque (..., n) at `rate` (Hz)."""
        return simulated(self.a, self.b, np.eye(3)[[0, 2]], torque[None], rate)


def random_drive(random: np.random.Generator) -> Drive:
    """Of any size, lightly damped, with both frequencies within some 5 to 55 Hz."""
    motor = 10 ** random.uniform(-3, 2)
    load = motor * 10 ** random.uniform(-0.7, 0.7)
    dip = random.uniform(6.0, 22.0)
    stiffness = load * (2 * np.pi * dip) ** 2
    damping = 2 * 10 ** random.uniform(-2.2, -1.1) * np.sqrt(stiffness * load)
    friction = (motor + load) * 2 * np.pi * random.uniform(0.05, 1.0)
    return Drive(motor, load, stiffness, damping, friction)


def simulated(a: Array, b: Array, c: Array, inputs: Array, rate: float) -> Array:
    """Outputs (p, ..., n) of x' = a x + b u, y = c x from rest; inputs (q, ..., n), linear between
    their samples. One mode at a time, so that no order of a filter costs digits.
    """
    poles, modes = np.linalg.eig(a)
    into, out = np.linalg.solve(modes, b.astype(complex)), c @ modes
    h = 1.0 / rate
    total = np.zeros((len(c), *inputs.shape[1:]))
    for k, pole in enumerate(poles):
        z = pole * h
        decay = np.exp(z)
        # Of a ramp from one sample to the next: weights of its beginning and its end.
        end = h * (decay - 1 - z) / z**2
        begin = h * (decay - 1) / z - end
        drive = np.tensordot(into[k], inputs, axes=(0, 0))
        state = lfilter([end, begin], [1.0, -decay], drive, axis=-1)
        total += np.real(np.multiply.outer(out[:, k], state))
    return total


def loop_of(drive: Drive, proportional: float, integral: float) -> tuple[Array, Array, Array]:
    """A PI rate loop on the motor: inputs reference, added torque, noise of the sensor; outputs
    torque, motor rate (as measured, less the noise, which is added afterwards). Fourth state: the
    integral of the error.
    """
    a = np.zeros((4, 4))
    a[:3, :3] = drive.a
    a[0, 0] -= proportional / drive.motor
    a[0, 3] = integral / drive.motor
    a[3, 0] = -1.0
    b = np.zeros((4, 3))
    b[0] = np.array([proportional, 1.0, -proportional]) / drive.motor
    b[3] = [1.0, 0.0, -1.0]
    c = np.array([[-proportional, 0.0, 0.0, integral], [1.0, 0.0, 0.0, 0.0]])
    return a, b, c


def with_coulomb(
    drives: Sequence[Drive],
    friction: float,
    torque: Callable[[float], Array],
    count: int,
    rate: float,
) -> Array:
    """Motor rates, shape (m, count), of drives whose motor has Coulomb friction (N m), from rest.

    Of one drive, or of one for each of the m torques. Runge and Kutta's method of fourth order at
    `rate` (Hz); the sign is smooth within 1e-3 of the rate that the friction's torque would reach
    in 0.1 s.
    """
    h = 1.0 / rate
    motor = np.array([each.motor for each in drives])
    width = 1e-3 * friction / (motor + [each.load for each in drives]) * 0.1 * 100
    a = np.stack([each.a for each in drives], axis=-1)

    def change(state: Array, time: float) -> Array:
        slope = (a * state).sum(axis=1)
        slope[0] += (torque(time) - friction * np.tanh(state[0] / width)) / motor
        return slope

    state = np.zeros((3, len(torque(0.0))))
    found = np.empty((count, state.shape[1]))
    for k in range(count):
        found[k] = state[0]
        t = k * h
        one = change(state, t)
        two = change(state + 0.5 * h * one, t + 0.5 * h)
        three = change(state + 0.5 * h * two, t + 0.5 * h)
        state = state + h / 6.0 * (one + 2.0 * (two + three) + change(state + h * three, t + h))
    return found.T
