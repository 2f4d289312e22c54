"""Margins of a command to a bench's limits, before any motion.

The load follows its command exactly; relative motion is the difference of load and hull. Torque and
current follow from a rigid body with the worst of the true friction. The trial itself monitors any
motion beyond the command. Without a motor, torque and current are zero; a spring's torque follows
from its extension.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from campaign.arrays import Array
from campaign.axis_kind import axis_unit
from campaign.physics.bench import Bench
from campaign.physics.complete import lacking, limits_of
from campaign.physics.friction import model_of
from campaign.physics.variation import of_its_day
from campaign.signals import MultiSine, Polyline, Signal, Sine, Zero
from campaign.trial import Task

Limit = Literal["angle", "rate", "acceleration", "torque", "current", "duration"]

TINY_RATE = 1e-6
"""rad/s; a jump of a rate command below this is rounding, not a step."""
POINTS_PER_CYCLE = 64
"""Of a sine added to another signal; the error of its extreme is then less than 0.13 %."""
MOST_POINTS = 64_000
"""Maximum number of points of such a sum; above 1000 cycles each has fewer points."""
POINTS_OF_A_LINE = 1001
"""Points at which a polyline is evaluated besides its knots."""
_SHARES = np.concatenate([side * np.geomspace(1e-12, 1.0, 121) for side in (-1.0, 1.0)])
"""Shares of the largest rate at which friction is evaluated."""


_CALLED = {("angle", "m"): "position", ("torque", "N"): "force"}


@dataclass(frozen=True)
class Margin:
    """A limit (`bound`) and the value of a task, both in `unit` (SI).

    `value` is infinite for the acceleration of a rate command that jumps. `sensor`: the sensor
    whose single count is `value`; empty if `value` is that of the task.
    """

    limit: Limit
    value: float
    bound: float
    unit: str
    sensor: str = ""

    @property
    def fraction(self) -> float:
        """Used share of the limit; above 1 the limit is exceeded."""
        return self.value / self.bound

    @property
    def called(self) -> str:
        """Display name of the limit; a linear axis has a position and a force."""
        return _CALLED.get((self.limit, self.unit), self.limit)

    @property
    def broken(self) -> bool:
        # Rounding must not fail a command at its limit, such as 60 deg/s^2 of 60.
        return not self.fraction <= 1 + 1e-9


@dataclass(frozen=True)
class Extremes:
    """Largest magnitudes over a task: relative angle and rate, and acceleration of load and hull.

    Units: rad, rad/s, rad/s^2.
    """

    angle: float
    rate: float
    load_acceleration: float
    hull_acceleration: float


def margins(bench: Bench, task: Task) -> tuple[Margin, ...]:
    """Values of `task` beside each limit of `bench`.

    In torque mode and behind a spring the motion depends on friction and is not predicted: the
    angle is the start angle (or the travel of the spring's end), and the rate is zero. Only the
    trial shows the motion. Torque and current are absent if the bench lacks the values for them:
    `unpredicted` names them. Raises IncompleteBenchError without limits.
    """
    limits, extremes = limits_of(bench), motion(task)
    torque = _drive_torque(bench, task, extremes)
    current = _current(bench, task, torque)
    acceleration = max(extremes.load_acceleration, extremes.hull_acceleration)
    units = units_of(bench)
    rows: tuple[tuple[Limit, float | None, float, str], ...] = (
        ("angle", extremes.angle, limits.angle, units["rad"]),
        ("rate", extremes.rate, limits.rate, units["rad/s"]),
        ("acceleration", acceleration, limits.acceleration, units["rad/s^2"]),
        ("torque", torque, limits.torque, units["N m"]),
        ("current", current, limits.current, "A"),
        ("duration", task.duration, limits.duration, "s"),
    )
    return tuple(
        Margin(limit, value, bound, unit)
        for limit, value, bound, unit in rows
        if value is not None and math.isfinite(bound)
    )


def units_of(bench: Bench) -> dict[str, str]:
    """Units (SI) of the bench's axis, by those of a rotary axis."""
    return {unit: axis_unit(unit, bench.sides) for unit in ("rad", "rad/s", "rad/s^2", "N m")}


def unpredicted(bench: Bench, task: Task) -> dict[Limit, tuple[str, ...]]:
    """Limits that `margins` cannot predict for a task, with the fields that the bench lacks."""
    if task.mode in ("prescribed", "spring"):
        return {}
    torque = lacking(bench, ("axis.inertia",)) if task.mode == "rate" else ()
    current = (*torque, *lacking(bench, ("motor.torque_constant",)))
    missing: dict[Limit, tuple[str, ...]] = {"torque": torque, "current": current}
    return {limit: paths for limit, paths in missing.items() if paths}


def _current(bench: Bench, task: Task, torque: float | None) -> float | None:
    """Largest motor current (A); None if unknown."""
    if task.mode in ("prescribed", "spring"):
        return 0.0
    per_ampere = bench.torque_per_current
    return None if torque is None or per_ampere is None else torque / per_ampere


def _drive_torque(bench: Bench, task: Task, extremes: Extremes) -> float | None:
    """Largest torque (N m) of motor or spring at the load; None if unknown."""
    match task.mode:
        case "prescribed":  # the motion is given; nothing drives it
            return 0.0
        case "spring":  # upper bound: the load does not move
            return task.spring_stiffness * _stretch(task)
        case "torque":
            return _largest(task.command, task.duration)
    if bench.axis.inertia is None:
        return None
    rigid = bench.axis.inertia * extremes.load_acceleration + worst_friction(bench, extremes.rate)
    return rigid + _largest(task.disturbance, task.duration)


def _stretch(task: Task) -> float:
    """Travel of the spring's end from the start position of the load (rad)."""
    match task.command:
        case Polyline(times=times, values=values):
            from_start = tuple(value - task.start_angle for value in values)
            return _largest(Polyline(times=times, values=from_start), task.duration)
    return _largest(task.command, task.duration) + abs(task.start_angle)


def motion(task: Task) -> Extremes:
    """Commanded motion of load against hull; its known part if it depends on friction."""
    # A prescribed motion is relative to the hull, independent of the hull's motion.
    hull = Zero() if task.mode == "prescribed" else task.base_acceleration
    hull_acceleration = _largest(hull, task.duration)
    if task.mode in ("torque", "spring"):
        start = abs(task.start_angle)
        pulled = task.mode == "spring" and task.spring_stiffness > 0
        reach = _largest(task.command, task.duration) if pulled else start
        return Extremes(max(start, reach), 0.0, 0.0, hull_acceleration)
    time = _grid(task)
    rate, angle = _load_motion(task.command, time)
    hull_rate, hull_angle = _hull_motion(hull, time)
    return Extremes(
        angle=float(np.max(np.abs(task.start_angle + angle - hull_angle))),
        rate=float(np.max(np.abs(rate - hull_rate))),
        load_acceleration=_steepest(task.command, task.duration),
        hull_acceleration=hull_acceleration,
    )


def worst_friction(bench: Bench, rate: float) -> float:
    """Largest friction torque at the load (N m) of sliding up to `rate` (rad/s); 0 at rest.

    Sum of the largest torque without its viscous part (the static torque of models that have one)
    and the viscous part at `rate`; in the worse direction and at the worst position, on the bench's
    day and under its preload. Torques at the motor count N times.
    """
    total = 0.0
    for friction in of_its_day(bench).friction.values():
        model = model_of(friction)
        ratio, rate_ratio = bench.at_load(friction)
        speed = rate * rate_ratio
        speeds = _SHARES * speed
        viscous = model.viscous(friction)
        dry = float(np.max(np.abs(model.steady_state(friction, speeds) - viscous * speeds)))
        torque = dry * (1.0 + friction.ripple.amplitude) + viscous * speed
        total += torque * ratio
    return total


def _grid(task: Task) -> Array:
    """Times that include all extremes of the motion, or times close to them; (n,), increasing."""
    duration = task.duration
    signals = (task.command, task.base_acceleration)
    times = [np.array([0.0, duration])]
    mixed = not any(isinstance(signal, Zero) for signal in signals)
    for signal in signals:
        match signal:
            case Sine(frequency=frequency):
                times.append(_dense_times(frequency, duration) if mixed else _quarters(signal))
            case MultiSine(frequencies=frequencies):
                times.append(_dense_times(max(frequencies), duration))
            case Polyline():
                even = np.linspace(0.0, duration, POINTS_OF_A_LINE)
                times += [np.asarray(signal.times), _zero_crossings(signal), even]
    return _within(np.concatenate(times), duration)


def _within(time: Array, duration: float) -> Array:
    """Times in [0, duration], unique and increasing."""
    return np.unique(time[(time >= 0) & (time <= duration)])


def _quarters(sine: Sine) -> Array:
    """First times at which sine and cosine, and thus every integral, are extreme or zero."""
    shift = (-sine.phase / (2 * math.pi)) % (1 / 4)
    return np.asarray((np.arange(4) / 4 + shift) / sine.frequency)


def _dense_times(frequency: float, duration: float) -> Array:
    """Even times over a whole irregular motion: its largest swing can be anywhere."""
    step = max(1 / (POINTS_PER_CYCLE * frequency), duration / MOST_POINTS)
    return np.append(np.arange(0.0, duration, step), duration)


def _zero_crossings(polyline: Polyline) -> Array:
    """Times of zero crossings, at which the integral is extreme."""
    time, value = np.asarray(polyline.times), np.asarray(polyline.values)
    crossing = value[:-1] * value[1:] < 0
    share = value[:-1][crossing] / (value[:-1] - value[1:])[crossing]
    return np.asarray(time[:-1][crossing] + share * np.diff(time)[crossing])


def _load_motion(command: Signal, time: Array) -> tuple[Array, Array]:
    """Rate (rad/s) and angle from the start (rad) of a rate command, each shape (n,)."""
    match command:
        case Sine(amplitude=amplitude, frequency=frequency, phase=phase):
            omega = 2 * math.pi * frequency
            angle = amplitude / omega * (math.cos(phase) - np.cos(omega * time + phase))
            return command.sample(time), angle
        case MultiSine():
            return command.sample(time), _from_start(command, time, 1)
        case Polyline():
            return command.sample(time), _integrated(command, time)[0]
    return np.zeros_like(time), np.zeros_like(time)


def _hull_motion(acceleration: Signal, time: Array) -> tuple[Array, Array]:
    """Rate (rad/s) and angle from the start (rad) of the hull, each shape (n,).

    A sine or sum of sines is a steady oscillation whose rate has zero mean; any other motion
    starts from rest.
    """
    match acceleration:
        case Sine(amplitude=amplitude, frequency=frequency, phase=phase):
            omega = 2 * math.pi * frequency
            rate = -amplitude / omega * np.cos(omega * time + phase)
            angle = -amplitude / omega**2 * (np.sin(omega * time + phase) - math.sin(phase))
            return rate, angle
        case MultiSine():
            return acceleration.integral(time, 1), _from_start(acceleration, time, 2)
        case Polyline():
            return _integrated(acceleration, time)
    return np.zeros_like(time), np.zeros_like(time)


def _from_start(sines: MultiSine, time: Array, order: int) -> Array:
    """Integral of a sum of sines from t = 0."""
    return np.asarray(sines.integral(time, order) - sines.integral(np.zeros(1), order))


def _integrated(polyline: Polyline, time: Array) -> tuple[Array, Array]:
    """First and second integral from t = 0 at `time`, exact when `time` contains the knots."""
    step = np.diff(time)
    begin, end = _after(polyline, time)[:-1], _before(polyline, time)[1:]
    first = np.concatenate([[0.0], np.cumsum(0.5 * step * (begin + end))])
    second = np.cumsum(step * first[:-1] + step**2 * (2 * begin + end) / 6)
    return first, np.concatenate([[0.0], second])


def _after(polyline: Polyline, time: Array) -> Array:
    """Right-hand limits: at a jump, the value after it."""
    return _at(polyline, time, "right")


def _before(polyline: Polyline, time: Array) -> Array:
    """Left-hand limits: at a jump, the value before it."""
    return _at(polyline, time, "left")


def _at(polyline: Polyline, time: Array, side: Literal["left", "right"]) -> Array:
    """One-sided limits; constant beyond the ends."""
    knots, values = np.asarray(polyline.times), np.asarray(polyline.values)
    next_knot = np.searchsorted(knots, time, side=side)
    high = np.minimum(next_knot, len(knots) - 1)
    low = np.maximum(next_knot - 1, 0)
    span = knots[high] - knots[low]  # 0 only beyond the ends, where both values are equal
    share = (time - knots[low]) / np.where(span > 0, span, 1.0)
    return np.asarray(values[low] + share * (values[high] - values[low]))


def _largest(signal: Signal, duration: float) -> float:
    """Largest magnitude of a signal over [0, duration]."""
    match signal:
        case Sine():
            time = _within(np.append(_quarters(signal), [0.0, duration]), duration)
            return float(np.max(np.abs(signal.sample(time))))
        case MultiSine():
            time = _dense_times(max(signal.frequencies), duration)
            return float(np.max(np.abs(signal.sample(time))))
        case Polyline():
            time = _within(np.append(signal.times, [0.0, duration]), duration)
            values = np.concatenate([_after(signal, time), _before(signal, time[1:])])
            return float(np.max(np.abs(values)))
    return 0.0


def _steepest(command: Signal, duration: float) -> float:
    """Largest acceleration of a rate command (rad/s^2) from 0; infinite if it jumps."""
    match command:
        case Sine(amplitude=amplitude, frequency=frequency, phase=phase):
            if abs(amplitude * math.sin(phase)) > TINY_RATE:
                return math.inf
            return 2 * math.pi * frequency * abs(amplitude)  # at the start if it begins at zero
        case MultiSine():
            if abs(command.sample(np.zeros(1)).item()) > TINY_RATE:
                return math.inf
            time = _dense_times(max(command.frequencies), duration)
            return float(np.max(np.abs(command.integral(time, -1))))
        case Polyline():
            return _steepest_line(command, duration)
    return 0.0


def _steepest_line(command: Polyline, duration: float) -> float:
    knots, values = np.asarray(command.times), np.asarray(command.values)
    if abs(_after(command, np.zeros(1)).item()) > TINY_RATE:
        return math.inf
    step, change = np.diff(knots), np.abs(np.diff(values))
    inside = (knots[1:] > 0) & (knots[:-1] < duration)
    jumps = inside & (step == 0) & (change > TINY_RATE)
    if np.any(jumps):
        return math.inf
    sloped: Any = inside & (step > 0)
    return float(np.max(change[sloped] / step[sloped], initial=0.0))
