"""A loop with dry friction, switched at its events: the reference that the engine is held against.

Nothing of `campaign.physics` is used: symbols and gains are the thesis appendix', the rate error
is in deg/s, as the gyro constant 180/pi says, and friction is a set at rest. Between events
the right-hand side is smooth and scipy's order-8
Runge-Kutta solves it; an event is where the regime changes, and its instant is found as a root:

- sliding, until the relative rate is zero. Then it is stuck if the applied torque is within the
  static torques, and slides the other way if it is not;
- stuck, until the applied torque reaches a static torque. Then it slides that way.

The applied torque is what friction would have to take for the relative rate to stay zero.
Parallel dry interfaces on one rate are one: their curves add, and so do their static torques.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.integrate import solve_ivp

from tests.physics.benches import DEG, INERTIA, KE, KIC, KIV, KPC, KPV, KT, LOAD, MOTOR, RATIO, L, R

NAMES = ("load_rate", "pointing_angle", "relative_angle", "motor_current")
SCALE = np.array([1e-3, 1e-4, 1e-2, 1.0, 1e-2, 1e-2, 1e-3, 1e-5, 1e-3, 1e-5, 1e-3, 1e-3])
STATES = len(SCALE)
Function = Callable[[float], float]


@dataclass(frozen=True)
class Curve:
    """Sliding friction in one direction, at the load: N m over the load's relative rate."""

    coulomb: float
    static: float
    velocity: float = 0.03
    exponent: float = 2.0
    viscous: float = 0.0

    def __call__(self, speed: float) -> float:
        fall = math.exp(-((speed / self.velocity) ** self.exponent))
        return self.coulomb + (self.static - self.coulomb) * fall + self.viscous * speed


@dataclass(frozen=True)
class Dry:
    """One dry interface; `backward` where the other direction is different."""

    forward: Curve
    backward: Curve | None = None

    def towards(self, direction: int) -> Curve:
        return self.forward if direction > 0 or self.backward is None else self.backward


THESIS_DRY = (
    Dry(Curve(26.0, 32.0, viscous=4.0)),
    Dry(Curve(0.03 * RATIO, 0.04 * RATIO, viscous=0.001 * RATIO)),
)
"""Equation 4.6 with the appendix' parameters: load, and motor counted at the load."""


def still(_: float) -> float:
    return 0.0


def lugre(v: float, z: float, p: dict[str, float]) -> tuple[float, float]:
    """Torque and dz/dt of Equations 4.2 to 4.4."""
    s = p["tc"] + (p["ts"] - p["tc"]) * math.exp(-((v / p["vs"]) ** 2))
    dz = v - p["s0"] * abs(v) / s * z
    return p["s0"] * z + p["s1"] * dz + p["s2"] * v, dz


def bristles(v: float, load: float, motor: float) -> tuple[float, float, float]:
    """LuGre friction of load and motor at the load (N m), and both rates of their states."""
    load_torque, load_change = lugre(v, load, LOAD)
    motor_torque, motor_change = lugre(v, motor, MOTOR)
    return load_torque + RATIO * motor_torque, load_change, motor_change


@dataclass(frozen=True)
class DryLoop:
    """What is simulated. Rate mode, unless `torque` (N m at the load) or `spring` is given.

    Attributes:
        friction: dry interfaces; none with `bristles`, whose plant friction is LuGre's.
        compensation: interfaces of a static feedforward, Equation 4.6 with sgn(0) = 0.
        bristle_compensation: LuGre feedforward with the appendix' parameters.
        observer: N K0 (N m s/rad) of a disturbance observer that knows J.
        low_pass: s, of the rate that LuGre compensation sees.
        spring: stiffness (N m/rad); the load without its motor, `command` is the far end's angle.
    """

    friction: tuple[Dry, ...] = THESIS_DRY
    compensation: tuple[Dry, ...] = ()
    bristles: bool = False
    bristle_compensation: bool = False
    command: Function = still
    torque: Function | None = None
    observer: float = 0.0
    low_pass: float = 0.0
    spring: float | None = None
    base_rate: Function = still
    base_acceleration: Function = still
    inertia: float = INERTIA
    proportional: float = KPV  # A s/deg
    integral: float = KIV
    initial: tuple[float, ...] = field(default=(0.0,) * STATES)

    def sliding(self, interfaces: tuple[Dry, ...], direction: int, v: float) -> float:
        """Sum of sliding torques (N m) in `direction`, zero for direction 0."""
        speed = max(direction * v, 0.0)
        return direction * sum(item.towards(direction)(speed) for item in interfaces)

    def driving(self, t: float, y: np.ndarray) -> float:
        """Torque on the load (N m) besides friction."""
        if self.spring is not None:
            return self.spring * (self.command(t) - y[2])
        return RATIO * KT * y[3]

    def applied(self, t: float, y: np.ndarray) -> float:
        return self.driving(t, y) - self.inertia * self.base_acceleration(t)

    def friction_torque(self, t: float, y: np.ndarray, direction: int) -> float:
        if self.bristles:
            return bristles(y[0] - self.base_rate(t), y[6], y[7])[0]
        if direction == 0:
            return self.applied(t, y)
        return self.sliding(self.friction, direction, y[0] - self.base_rate(t))

    def rates(self, t: float, y: np.ndarray, direction: int) -> list[float]:
        """State: w, its integral, relative angle, i, both PI integrals, bristles of plant and
        compensation, w', filtered rate."""
        t, y = float(t), y.tolist()  # of Python: a quarter faster than those of numpy
        w, _, _, i, current_sum, rate_sum, zl, zm, zlc, zmc, observed, filtered = y
        v = w - self.base_rate(t)
        dw = (self.driving(t, y) - self.friction_torque(t, y, direction)) / self.inertia
        if direction == 0 and not self.bristles:
            v, dw = 0.0, self.base_acceleration(t)
        added, dzl, dzm, dzlc, dzmc = self.sliding(self.compensation, direction, v), *(0.0,) * 4
        if self.bristles:
            _, dzl, dzm = bristles(v, zl, zm)
        seen = filtered if self.low_pass else v
        df = (v - filtered) / self.low_pass if self.low_pass else 0.0
        if self.bristle_compensation:
            added, dzlc, dzmc = bristles(seen, zlc, zmc)
        if self.spring is not None:
            return [dw, w, v, 0.0, 0.0, 0.0, dzl, dzm, 0.0, 0.0, 0.0, 0.0]
        pulled = self.observer * (w - observed)
        added -= pulled
        dob = (RATIO * KT * i + pulled) / self.inertia
        error = (self.command(t) - w) * DEG
        wanted = self.proportional * (error + self.integral * rate_sum)
        if self.torque is not None:
            error, wanted = 0.0, self.torque(t) / (RATIO * KT)
        current_error = wanted + added / (RATIO * KT) - i
        voltage = KPC * current_error + KIC * current_sum
        di = (voltage - R * i - KE * RATIO * v) / L
        return [dw, w, v, di, current_error, error, dzl, dzm, dzlc, dzmc, dob, df]

    def regime(self, t: float, y: np.ndarray) -> int:
        """Direction of what follows a relative rate of zero; 0 is stuck."""
        applied = self.applied(t, y)
        if applied > self.sliding(self.friction, 1, 0.0):
            return 1
        return -1 if applied < self.sliding(self.friction, -1, 0.0) else 0


def simulate_events(
    loop: DryLoop, times: np.ndarray, rtol: float = 1e-10, max_step: float = 5e-3
) -> tuple[dict[str, np.ndarray], list[tuple[float, int]]]:
    """States by name and `friction_torque` over `times`; instants and directions of the regimes."""
    found, history, _ = _simulate(loop, times, *at_start(loop, float(times[0])), rtol, max_step)
    return found, history


def simulate_sampled(
    loop: DryLoop,
    samples: int,
    period: float = 1e-3,
    compensate: Function = still,
    *,
    fed_by_encoder: bool = False,
) -> dict[str, np.ndarray]:
    """As `simulate_events`, of a rate controller that reads ideal sensors and holds its output.

    It reads the gyro, or the newest relative rate where it is `fed_by_encoder`.

    Each period (s) is solved for itself; the integral is summed backwards. Values at the samples.
    compensate: torque (N m) over the newest relative rate, a backward difference of the encoder
    behind the discrete `low_pass` of the loop; it is called once a sample.
    """
    y, direction = at_start(loop, 0.0)
    gain, integral = loop.proportional * DEG, 0.0
    pole = math.exp(-period / loop.low_pass) if loop.low_pass else 0.0
    rate, angle = 0.0, y[2]
    found = []
    for n in range(samples):
        t = n * period
        rate = pole * rate + (1.0 - pole) * (y[2] - angle) / period
        angle, added = y[2], compensate(rate)
        error = loop.command(t) - (rate if fed_by_encoder else y[0])
        integral += gain * loop.integral * period * error
        torque = RATIO * KT * (gain * error + integral) + added
        held = replace(loop, torque=lambda _, torque=torque: torque)
        times = np.array([t, t + period])
        # Stuck, the new command is what decides.
        direction = direction or held.regime(t, y)
        out, history, y = _simulate(held, times, y, direction, 1e-10, period)
        direction = history[-1][1]
        found.append([*(values[0] for values in out.values()), rate, added])
    names = (*NAMES, "friction_torque", "relative_rate", "compensation_torque")
    return dict(zip(names, np.transpose(found), strict=True))


class SampledBristles:
    """LuGre feedforward of a sampled controller, for `simulate_sampled`: N m over the newest rate.

    dz/dt = v - sigma0 |v| z / s(v) has a closed form while v is constant, as it is over a `period`.
    """

    def __init__(self, period: float) -> None:
        self.period, self.deflections = period, [0.0, 0.0]

    def __call__(self, rate: float) -> float:
        for k, p in enumerate((LOAD, MOTOR)):
            s = p["tc"] + (p["ts"] - p["tc"]) * math.exp(-((rate / p["vs"]) ** 2))
            steady = math.copysign(s / p["s0"], rate)
            left = math.exp(-p["s0"] * abs(rate) * self.period / s)
            self.deflections[k] = steady + (self.deflections[k] - steady) * left
        return bristles(rate, *self.deflections)[0]


def at_start(loop: DryLoop, t: float) -> tuple[np.ndarray, int]:
    """State and direction of sliding."""
    y = np.array(loop.initial)
    v = y[0] - loop.base_rate(t)
    return y, int(np.sign(v)) if abs(v) > 1e-14 else (1 if loop.bristles else loop.regime(t, y))


def _simulate(
    loop: DryLoop, times: np.ndarray, y: np.ndarray, direction: int, rtol: float, max_step: float
) -> tuple[dict[str, np.ndarray], list[tuple[float, int]], np.ndarray]:
    t, end = float(times[0]), float(times[-1])
    history = [(t, direction)]
    found = np.empty((len(NAMES) + 1, len(times)))
    done = 0
    while done < len(times):
        ahead = times[done:]
        part = solve_ivp(
            loop.rates, (t, end), y, method="DOP853", dense_output=True, args=(direction,),
            events=_events(loop, direction), rtol=rtol, atol=rtol * SCALE, max_step=max_step,
        )  # fmt: skip
        assert part.success, part.message
        t = float(part.t[-1])
        here = ahead[ahead < t] if part.status == 1 else ahead
        if len(here):
            values = part.sol(here)
            columns = slice(done, done + len(here))
            found[:-1, columns] = values[: len(NAMES)]
            found[-1, columns] = [
                loop.friction_torque(at, state, direction)
                for at, state in zip(here, values.T, strict=True)
            ]
            done += len(here)
        if part.status != 1:
            y = part.y[:, -1]
            break
        y = part.y[:, -1].copy()
        which = next(k for k, hits in enumerate(part.t_events) if len(hits))
        if loop.bristles:
            direction = -direction
        elif direction == 0:
            direction = 1 if which == 0 else -1
        else:
            y[0] = loop.base_rate(t)
            direction = loop.regime(t, y)
        history.append((t, direction))
    return dict(zip((*NAMES, "friction_torque"), found, strict=True)), history, y


def _events(loop: DryLoop, direction: int) -> list[Callable[..., float]]:
    def rate(t: float, y: np.ndarray, _: int) -> float:
        return y[0] - loop.base_rate(t)

    def forward(t: float, y: np.ndarray, _: int) -> float:
        return loop.applied(t, y) - loop.sliding(loop.friction, 1, 0.0)

    def backward(t: float, y: np.ndarray, _: int) -> float:
        return loop.applied(t, y) - loop.sliding(loop.friction, -1, 0.0)

    ways = [(forward, 1), (backward, -1)]
    if direction or loop.bristles:
        ways = [(rate, -direction)]
    for event, way in ways:
        event.terminal, event.direction = True, way  # type: ignore[attr-defined]
    return [event for event, _ in ways]
