"""Any bench with a continuous controller a second time: its equations, for scipy's solvers.

Of `campaign.physics` only the values of a `Bench` are read. The equations are those of
docs/developers/physics.md, written out here state by state; the relative rate v is a state itself,
so that the creep of a stuck load is not lost in the rate of the hull.

    J dv/dt = N Kt i - T + Td + k a + c da/dt - J dwb/dt       w = v + wb
    L di/dt = Kpc (i* - i) + Kic integral of (i* - i) - R i - Ke N v
    dz/dt = v - s0 |v| z / s(v),  T = s0 z + s1 dz/dt + s2 v   of every interface

J without the appendage, a the appendage's deflection, k and c its spring and damper.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np

from campaign.physics.bench import Bench
from campaign.signals import MultiSine, Polyline, Sine, Zero
from campaign.trial import Task

Array = np.ndarray
# States; one z for each friction model follows, of the bench and then of the compensation.
V, POINTING, Q, I, I_SUM, RATE_SUM, FILTERED, OBSERVED, DEFLECTION, DEFLECTION_RATE, Z = range(11)

# The numbers of a loop.
(
    INERTIA, RATIO, KT, KE, R, L, KPC, KIC, KPV, KIV, CLOSED, LOW_PASS, HIGH_PASS,
    OBSERVER_GAIN, OBSERVER_INERTIA, APPENDAGE_INERTIA, SPRING, DAMPER, INTERFACES,
    COMMAND, COMMAND_SLOPE, DISTURBANCE, DISTURBANCE_SLOPE, NUMBERS,
) = range(24)  # fmt: skip
# The numbers of a friction model.
(
    TORQUE, SPEED, TC, TS, VS, DELTA, TC_BACK, TS_BACK, VS_BACK, DELTA_BACK, S2, S2_BACK,
    S0, S1, SMOOTHING, RIPPLE, PERIODS, PHASE, COLUMNS,
) = range(19)  # fmt: skip


@numba.njit(cache=True)
def _friction(row, v, z, angle):  # type: ignore[no-untyped-def]
    """Torque at the load and dz/dt of one model, at the load's rate v."""
    u = v * row[SPEED]
    if u >= 0.0:
        s = row[TC] + (row[TS] - row[TC]) * math.exp(-((u / row[VS]) ** row[DELTA]))
        viscous = row[S2] * u
    else:
        fall = math.exp(-((-u / row[VS_BACK]) ** row[DELTA_BACK]))
        s = row[TC_BACK] + (row[TS_BACK] - row[TC_BACK]) * fall
        viscous = row[S2_BACK] * u
    if row[SMOOTHING] > 0.0:
        dry, dz = s * math.tanh(u / row[SMOOTHING]), 0.0
    else:
        dz = u - row[S0] * abs(u) * z / s
        dry = row[S0] * z + row[S1] * dz
    ripple = 1.0 + row[RIPPLE] * math.sin(row[PERIODS] * angle + row[PHASE])
    return row[TORQUE] * (ripple * dry + viscous), dz


@numba.njit(cache=True)
def _derivative(t, y, p, friction, sines, out, torques):  # type: ignore[no-untyped-def]
    """dy/dt into `out`; torques: friction, compensation (N m at the load), load rate (rad/s)."""
    command = p[COMMAND] + p[COMMAND_SLOPE] * t
    disturbance = p[DISTURBANCE] + p[DISTURBANCE_SLOPE] * t
    base_rate, base_acceleration = 0.0, 0.0
    for j in range(sines.shape[0]):
        turned = sines[j, 2] * t + sines[j, 3]
        if sines[j, 0] == 0.0:
            command += sines[j, 1] * math.sin(turned)
        elif sines[j, 0] == 1.0:
            base_acceleration += sines[j, 1] * math.sin(turned)
            base_rate -= sines[j, 1] / sines[j, 2] * math.cos(turned)
        else:
            disturbance += sines[j, 1] * math.sin(turned)
    v, current = y[V], y[I]
    rate = v + base_rate
    seen = y[FILTERED] if p[LOW_PASS] > 0.0 else v
    rub, added = 0.0, 0.0
    for k in range(friction.shape[0]):
        if k < p[INTERFACES]:
            torque, out[Z + k] = _friction(friction[k], v, y[Z + k], y[Q])
            rub += torque
        else:
            torque, out[Z + k] = _friction(friction[k], seen, y[Z + k], y[Q])
            added += torque
    out[OBSERVED] = 0.0
    if p[OBSERVER_GAIN] > 0.0:
        estimate = p[RATIO] * p[OBSERVER_GAIN] * (rate - y[OBSERVED])
        drive = p[RATIO] * p[KT] * current
        out[OBSERVED] = (drive + estimate) / p[OBSERVER_INERTIA]
        added -= estimate
    torque_per_current = p[RATIO] * p[KT]
    if p[CLOSED] > 0.0:
        error = command - rate
        wanted = p[KPV] * error + p[KIV] * y[RATE_SUM]
        out[RATE_SUM] = error
    else:
        wanted = command / torque_per_current
        out[RATE_SUM] = 0.0
    short = wanted + added / torque_per_current - current
    voltage = p[KPC] * short + p[KIC] * y[I_SUM]
    elastic = p[SPRING] * y[DEFLECTION] + p[DAMPER] * y[DEFLECTION_RATE]
    acceleration = (torque_per_current * current - rub + disturbance + elastic) / p[INERTIA]
    out[V] = acceleration - base_acceleration
    out[POINTING] = rate - p[HIGH_PASS] * y[POINTING]
    out[Q] = v
    out[I] = (voltage - p[R] * current - p[KE] * p[RATIO] * v) / p[L]
    out[I_SUM] = short
    out[FILTERED] = (v - y[FILTERED]) / p[LOW_PASS] if p[LOW_PASS] > 0.0 else 0.0
    out[DEFLECTION], out[DEFLECTION_RATE] = 0.0, 0.0
    if p[APPENDAGE_INERTIA] > 0.0:
        out[DEFLECTION] = y[DEFLECTION_RATE]
        out[DEFLECTION_RATE] = -elastic / p[APPENDAGE_INERTIA] - acceleration
    torques[0], torques[1], torques[2] = rub, added, rate


@numba.njit(cache=True)
def rates(t, y, p, friction, sines):  # type: ignore[no-untyped-def]
    out, torques = np.empty(y.shape[0]), np.empty(3)
    _derivative(t, y, p, friction, sines, out, torques)
    return out


@numba.njit(cache=True)
def scaled_rates(t, y, size, p, friction, sines):  # type: ignore[no-untyped-def]
    return rates(t, y * size, p, friction, sines) / size


@numba.njit(cache=True)
def torques(times, states, p, friction, sines):  # type: ignore[no-untyped-def]
    """Friction, compensation, load rate at every instant, (n, 3)."""
    out, found = np.empty(states.shape[1]), np.empty((len(times), 3))
    for k in range(len(times)):
        _derivative(times[k], states[k], p, friction, sines, out, found[k])
    return found


@dataclass(frozen=True)
class Equations:
    """A task on a bench as numbers, in the order of the names above.

    numbers: (NUMBERS,); friction: (k, COLUMNS); sines: (m, 4) what they drive (0 command, 1 base
    acceleration, 2 disturbance), amplitude, rad/s, phase; lines: polylines of command and
    disturbance; start: (Z + k,) the states at t = 0.
    """

    numbers: Array
    friction: Array
    sines: Array
    lines: tuple[Polyline | None, Polyline | None]
    start: Array

    @property
    def knots(self) -> list[float]:
        """Where a polyline has a corner."""
        return sorted({t for line in self.lines if line is not None for t in line.times})

    def between(self, left: float, right: float) -> Array:
        """The numbers while the polylines are straight from `left` to `right`."""
        p = self.numbers.copy()
        for at, line in zip((COMMAND, DISTURBANCE), self.lines, strict=True):
            if line is not None:
                third = (right - left) / 3.0
                a, b = line.sample(np.array([left + third, right - third]))
                p[at + 1] = (b - a) / third
                p[at] = a - p[at + 1] * (left + third)
        return p


def equations(bench: Bench, task: Task) -> Equations:
    """Reads a bench and a task; a continuous controller in rate or torque mode."""
    if bench.controller.sample_rate is not None or task.mode not in ("rate", "torque"):
        raise ValueError("only continuous controllers, in mode rate or torque")
    p = np.zeros(NUMBERS)
    motor, gains = bench.motor, bench.controller
    p[INERTIA], p[RATIO], p[KT] = bench.axis.inertia, bench.gear.ratio, motor.torque_constant
    p[KE], p[R], p[L] = motor.back_emf_constant, motor.resistance, motor.inductance
    for controller, proportional, integral in ((gains.current, KPC, KIC), (gains.rate, KPV, KIV)):
        p[proportional] = controller.proportional
        factor = controller.proportional if controller.form == "ideal" else 1.0
        p[integral] = factor * controller.integral
    p[CLOSED] = task.mode == "rate"
    p[LOW_PASS] = gains.relative_rate_filter
    p[HIGH_PASS] = 2.0 * math.pi * gains.pointing_high_pass
    if (appendage := bench.appendage) is not None:
        omega = 2.0 * math.pi * appendage.frequency
        p[APPENDAGE_INERTIA] = appendage.inertia
        p[INERTIA] -= appendage.inertia
        p[SPRING] = appendage.inertia * omega**2
        p[DAMPER] = 2.0 * appendage.damping_ratio * omega * appendage.inertia
    rows = [_row(options, bench.gear.ratio, 1.0) for options in bench.friction.values()]
    p[INTERFACES] = len(rows)
    if task.compensation != "none":
        method = bench.compensation[task.compensation]
        if method.method == "observer":
            p[OBSERVER_GAIN] = method.gain
            p[OBSERVER_INERTIA] = method.inertia or bench.axis.inertia
        else:
            models = method.friction.values()
            rows += [_row(options, bench.gear.ratio, method.gain) for options in models]
    sines = [
        [which, *sine]
        for which, signal in enumerate((task.command, task.base_acceleration, task.disturbance))
        for sine in _sines(signal)
    ]
    if isinstance(task.base_acceleration, Polyline):
        raise ValueError("no polyline as base acceleration")
    table = np.array(sines).reshape(-1, 4)
    start = np.zeros(Z + len(rows))
    swing = table[table[:, 0] == 1.0]
    start[V] = np.sum(swing[:, 1] / swing[:, 2] * np.cos(swing[:, 3]))  # at rest in space
    start[Q] = task.start_angle
    lines = tuple(s if isinstance(s, Polyline) else None for s in (task.command, task.disturbance))
    return Equations(p, np.array(rows).reshape(-1, COLUMNS), table, lines, start)  # type: ignore[arg-type]


def _row(options: Any, ratio: float, gain: float) -> list[float]:
    def backwards(name: str) -> float:
        value = getattr(options.negative, name)
        return float(getattr(options, name) if value is None else value)

    curve = ("coulomb_torque", "static_torque", "stribeck_velocity", "stribeck_exponent")
    bristles = options.model == "lugre"
    if not bristles and options.sign_smoothing == 0.0:
        raise ValueError("a jump of the torque is no equation for these solvers")
    return [
        gain * (ratio if options.side == "motor" else 1.0),
        ratio if options.velocity == "motor" else 1.0,
        *(getattr(options, name) for name in curve),
        *(backwards(name) for name in curve),
        options.viscous_friction,
        backwards("viscous_friction"),
        options.bristle_stiffness if bristles else 0.0,
        options.bristle_damping if bristles else 0.0,
        0.0 if bristles else options.sign_smoothing,
        options.ripple.amplitude,
        options.ripple.periods,
        options.ripple.phase,
    ]


def _sines(signal: Any) -> list[tuple[float, float, float]]:
    match signal:
        case Sine():
            return [(signal.amplitude, 2 * math.pi * signal.frequency, signal.phase)]
        case MultiSine():
            omegas = (2 * math.pi * f for f in signal.frequencies)
            return list(zip(signal.amplitudes, omegas, signal.phases, strict=True))
        case Zero() | Polyline():
            return []
    raise TypeError(type(signal).__name__)


def poles(bench: Bench, task: Task, stuck: bool) -> Array:
    """Eigenvalues (1/s) for small motions: of the loop at rest, or sliding far above vs."""
    found = equations(bench, task)
    friction = found.friction.copy()
    state = np.zeros(len(found.start))
    if not stuck:
        friction[:, S0], friction[:, S1], friction[:, SMOOTHING] = 0.0, 0.0, 0.0
    p, nothing = found.numbers.copy(), np.zeros((0, 4))
    matrix = np.empty((len(state), len(state)))
    for j in range(len(state)):
        # At rest nothing here is curved but |v| z and tanh: a small step tells the slope.
        state[j] = 1e-9
        matrix[:, j] = rates(0.0, state, p, friction, nothing) / 1e-9
        state[j] = 0.0
    return np.linalg.eigvals(matrix)
