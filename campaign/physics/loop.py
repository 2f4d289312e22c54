"""The stabilization loop of Figure 5.3 as a linear system without friction.

The linear part is one matrix: rigid axis, gear, motor with back-EMF, current loop and viscous
friction. With a continuous controller it includes the rate loop, the filter of the relative rate
and the linear part of the compensation. Friction and friction-model compensation are inputs.

    J dw/dt = N Kt i - sigma2 (w - wb) - T
    L di/dt = V - R i - Ke N (w - wb)
    V = Kpc (i* - i) + Kic integral of (i* - i)
    i* = Kpv (r - w) + Kiv integral of (r - w) + Tc / (N Kt)

w: inertial rate of the load, wb: rate of the hull, r: commanded rate, T: friction torque at the
load, Tc: compensation torque at the load, i*: commanded current.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from campaign.arrays import Array
from campaign.physics.bench import AppendageOptions, Bench
from campaign.physics.compensation import compensation_methods
from campaign.physics.compensation.interface import Compensator, LinearBlock
from campaign.physics.complete import CompleteBench
from campaign.physics.friction import model_of
from campaign.physics.friction.interface import FrictionOptions
from campaign.physics.rows import (
    ANGLE,
    APPENDAGE_RATE,
    BASE_RATE,
    COMPENSATION,
    CURRENT,
    CURRENT_INTEGRAL,
    DEFLECTION,
    DRIVE,
    FRICTION,
    INPUTS,
    PLANT_STATES,
    RATE,
    RELATIVE_ANGLE,
)


@dataclass(frozen=True)
class Loop:
    """Linear system dx/dt = A x + B u, and outputs that the engine reads.

    Attributes:
        a: (n, n), per second and SI.
        b: (n, 4), columns DRIVE, BASE_RATE, FRICTION (N m at the load), COMPENSATION (N m).
        seen: state that compensation uses as the relative rate: RATE, minus the base's rate, or
            that of the filter.
        linear_compensation: (n,) and (4,): torque of the linear compensation block per x and u.
    """

    a: Array
    b: Array
    seen: int
    linear_compensation: tuple[Array, Array]


def make_compensator(bench: CompleteBench, name: str) -> Compensator:
    """Compensation with this name, built for this bench."""
    if name == "none":
        return Compensator()
    options = bench.compensation[name]
    method = compensation_methods()[options.method]
    return method.build(options, bench.axis.inertia, bench.gear.ratio)


def viscous_at_load(friction: FrictionOptions, bench: Bench) -> float:
    """Viscous friction of one interface at the load (N m s/rad)."""
    torque, rate = bench.at_load(friction)
    return model_of(friction).viscous(friction) * torque * rate


def make_loop(
    bench: CompleteBench,
    mode: Literal["rate", "torque"],
    compensator: Compensator,
    stated: CompleteBench | None = None,
) -> Loop:
    """Loop with a continuous controller, closed on the rate or open for a torque command.

    `stated`: the bench with the N Kt by which the controller converts currents and torques, if it
    differs from `bench`.
    """
    block = compensator.linear
    per_current = (stated or bench).torque_per_current
    order = 0 if block is None else len(block.c)
    filtered = bench.controller.relative_rate_filter > 0.0
    rate_integral = _plant_order(bench)
    filter_state = rate_integral + 1
    first = filter_state + filtered
    a, b = _plant(bench, first + order)
    filter_x, filter_u = np.zeros(len(a)), np.zeros(INPUTS)
    if filtered:
        filter_x[filter_state] = 1.0
        a[filter_state, RATE] = 1.0 / bench.controller.relative_rate_filter
        a[filter_state, filter_state] = -1.0 / bench.controller.relative_rate_filter
        b[filter_state, BASE_RATE] = -1.0 / bench.controller.relative_rate_filter
    else:
        filter_x[RATE], filter_u[BASE_RATE] = 1.0, -1.0

    torque_x, torque_u = np.zeros(len(a)), np.zeros(INPUTS)
    if block is not None:
        _add_block(a, b, block, first, per_current, filter_x, filter_u)
        torque_x[first:] = block.c
        torque_x[RATE] += block.d[0]
        torque_x[CURRENT] += block.d[1] * per_current
        torque_x += block.d[2] * filter_x
        torque_u += block.d[2] * filter_u

    command_x, command_u = np.zeros(len(a)), np.zeros(INPUTS)
    if mode == "rate":
        gains = bench.controller.rate
        command_x[RATE], command_u[DRIVE] = -gains.proportional, gains.proportional
        command_x[rate_integral] = gains.integral_gain
        a[rate_integral, RATE], b[rate_integral, DRIVE] = -1.0, 1.0
    else:
        command_u[DRIVE] = 1.0 / per_current
    command_x += torque_x / per_current
    command_u += torque_u / per_current
    command_u[COMPENSATION] += 1.0 / per_current
    for friction, gain in compensator.friction:
        viscous = gain * viscous_at_load(friction, bench) / per_current
        command_x += viscous * filter_x
        command_u += viscous * filter_u
    _close_current_loop(a, b, bench, command_x, command_u)
    return Loop(a, b, filter_state if filtered else RATE, (torque_x, torque_u))


def make_spring(bench: CompleteBench, stiffness: float) -> Loop:
    """Load without motor, pulled through a spring; DRIVE is the angle of the spring's end (rad)."""
    order = _plant_order(bench)
    a, b = _plant(bench, order)
    a[RATE, CURRENT] = 0.0
    a[CURRENT], b[CURRENT] = 0.0, 0.0  # without a motor, back-EMF drives no current
    inertia = bench.axis.inertia - (bench.appendage.inertia if bench.appendage else 0.0)
    a[RATE, RELATIVE_ANGLE] -= stiffness / inertia
    b[RATE, DRIVE] += stiffness / inertia
    return Loop(a, b, RATE, (np.zeros(order), np.zeros(INPUTS)))


def make_plant(bench: CompleteBench) -> Loop:
    """Axis with its current loop; DRIVE is the current command, held by the controller."""
    order = _plant_order(bench)
    a, b = _plant(bench, order)
    command_u = np.zeros(INPUTS)
    command_u[DRIVE] = 1.0
    _close_current_loop(a, b, bench, np.zeros(order), command_u)
    return Loop(a, b, RATE, (np.zeros(order), np.zeros(INPUTS)))


def _plant_order(bench: CompleteBench) -> int:
    return PLANT_STATES if bench.appendage is None else PLANT_STATES + 2


def _plant(bench: CompleteBench, size: int) -> tuple[Array, Array]:
    a, b = np.zeros((size, size)), np.zeros((size, INPUTS))
    inertia, motor = bench.axis.inertia, bench.motor
    if bench.appendage is not None:
        inertia -= bench.appendage.inertia
        _add_appendage(a, bench.appendage, inertia)
    viscous = sum(viscous_at_load(friction, bench) for friction in bench.friction.values())
    a[RATE, RATE] -= viscous / inertia
    a[RATE, CURRENT] = bench.torque_per_current / inertia
    b[RATE, BASE_RATE] = viscous / inertia
    b[RATE, FRICTION] = -1.0 / inertia
    a[ANGLE, RATE] = 1.0
    a[ANGLE, ANGLE] = -2.0 * np.pi * bench.controller.pointing_high_pass
    a[RELATIVE_ANGLE, RATE], b[RELATIVE_ANGLE, BASE_RATE] = 1.0, -1.0
    back_emf = motor.back_emf_constant * bench.gear.ratio / motor.inductance
    a[CURRENT, CURRENT] = -motor.resistance / motor.inductance
    a[CURRENT, RATE], b[CURRENT, BASE_RATE] = -back_emf, back_emf
    return a, b


def _add_appendage(a: Array, appendage: AppendageOptions, body: float) -> None:
    """Add deflection and rate of the appendage, elastically coupled to the load."""
    omega = 2.0 * np.pi * appendage.frequency
    stiffness = omega**2 * appendage.inertia
    damping = 2.0 * appendage.damping_ratio * omega * appendage.inertia
    a[DEFLECTION, APPENDAGE_RATE], a[DEFLECTION, RATE] = 1.0, -1.0
    for row, share in ((APPENDAGE_RATE, -1.0 / appendage.inertia), (RATE, 1.0 / body)):
        a[row, DEFLECTION] += share * stiffness
        a[row, APPENDAGE_RATE] += share * damping
        a[row, RATE] -= share * damping


def _close_current_loop(
    a: Array, b: Array, bench: CompleteBench, command_x: Array, command_u: Array
) -> None:
    gains, inductance = bench.controller.current, bench.motor.inductance
    error_x, error_u = command_x.copy(), command_u
    error_x[CURRENT] -= 1.0
    a[CURRENT] += gains.proportional * error_x / inductance
    b[CURRENT] += gains.proportional * error_u / inductance
    a[CURRENT, CURRENT_INTEGRAL] += gains.integral_gain / inductance
    a[CURRENT_INTEGRAL] += error_x
    b[CURRENT_INTEGRAL] += error_u


def _add_block(
    a: Array,
    b: Array,
    block: LinearBlock,
    first: int,
    torque_per_current: float,
    relative_x: Array,
    relative_u: Array,
) -> None:
    rows = slice(first, first + len(block.c))
    a[rows, rows] = block.a
    a[rows, RATE] += block.b[:, 0]
    a[rows, CURRENT] += block.b[:, 1] * torque_per_current
    a[rows] += np.outer(block.b[:, 2], relative_x)
    b[rows] += np.outer(block.b[:, 2], relative_u)


def discretise(a: Array, b: Array, step: float) -> tuple[Array, Array, Array]:
    """Exact step of dx/dt = A x + B u for inputs that are straight lines over the step.

    x(t+h) = F x(t) + G u(t) + H (u(t+h) - u(t)), by one matrix exponential (Van Loan 1978).
    Shapes: F (n, n), G and H (n, m).
    """
    from scipy.linalg import expm

    n, m = b.shape
    augmented = np.zeros((n + 2 * m, n + 2 * m))
    augmented[:n, :n] = a * step
    augmented[:n, n : n + m] = b * step
    augmented[n : n + m, n + m :] = np.eye(m)
    exponential = expm(augmented)
    return exponential[:n, :n], exponential[:n, n : n + m], exponential[:n, n + m :]
