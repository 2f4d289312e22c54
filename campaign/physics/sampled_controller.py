"""One sample of a sampled controller: sensors, loop, compensation, output."""

from __future__ import annotations

from typing import Any

from campaign.physics.blocks import Array, Controller, Elements, Memory
from campaign.physics.compilation import pasted
from campaign.physics.elementary import nearest, where
from campaign.physics.friction_lines import ask
from campaign.physics.rows import (
    CURRENT,
    CURRENT_SENSOR,
    ENCODER,
    GYRO,
    KEPT_CURRENT,
    KEPT_ENCODER,
    KEPT_GYRO,
    KEPT_INTEGRAL,
    KEPT_LOAD_RATE,
    KEPT_MOTOR_RATE,
    KEPT_POINTING,
    KEPT_RESOLVER,
    KEPT_TORQUE,
    MEAN,
    MEETS_PER_STEP,
    MEETS_POSITION,
    MEETS_RATE_END,
    MEETS_RATE_MEAN,
    MEETS_RATE_START,
    MEETS_STEP,
    RATE,
    RELATIVE_ANGLE,
    RESOLVER,
)
from campaign.physics.step_function import AN_INSTANT
from campaign.physics.vector import rows_on_the_stack


@pasted
def sample(
    lanes: int,
    controller: Controller,
    compensation: Elements,
    memory: Memory,
    x: Array,
    command: float,
    noise: Array,
    reading: int,
) -> None:
    """One sample of the controller: read the sensors, set the next current command.

    x: states of the plant.   command: rad/s, or N m without a rate loop.
    reading: index in `noise`.
    """
    number = memory.counters[1]
    memory.counters[1] += 1
    ring = memory.readings.shape[1]
    place = number % ring
    _read_sensors(controller, memory.readings, place, x, noise, reading)
    if number == 0:
        _stand_still(memory.readings)
    gyro = _reading(controller, memory.readings, GYRO, place)
    encoder = _reading(controller, memory.readings, ENCODER, place)
    resolver = _reading(controller, memory.readings, RESOLVER, place) / controller.ratio
    current = _reading(controller, memory.readings, CURRENT_SENSOR, place)
    memory.kept[KEPT_CURRENT] = current
    gyro = _rates(controller, memory.kept, number == 0, gyro, encoder, resolver)
    motor_torque = controller.torque_per_current * current
    torque = _compensate(lanes, controller, compensation, memory, gyro, motor_torque)
    memory.kept[KEPT_TORQUE] = torque
    _command(controller, memory, number, command, gyro, torque)


@pasted
def _read_sensors(
    controller: Controller, readings: Array, place: int, x: Array, noise: Array, reading: int
) -> None:
    """Write the present readings to their ring: true values, with noise, in whole counts."""
    readings[GYRO, place] = x[RATE]
    readings[ENCODER, place] = x[RELATIVE_ANGLE]
    readings[RESOLVER, place] = x[RELATIVE_ANGLE] * controller.ratio
    readings[CURRENT_SENSOR, place] = x[CURRENT]
    for s in range(4):
        value, count = readings[s, place], controller.resolution[s]
        if controller.noisy[s] >= 0:
            value = value + noise[reading, controller.noisy[s]]
        if controller.counts[s] > 0:
            counted = nearest(value / where(count > 0.0, count, 1.0)) * count
            value = where(count > 0.0, counted, value)
        readings[s, place] = value


@pasted
def _stand_still(readings: Array) -> None:
    """Set the readings before the first sample to those of the first sample."""
    for s in range(4):
        for before in range(1, readings.shape[1]):
            readings[s, before] = readings[s, 0]


@pasted
def _reading(controller: Controller, readings: Array, sensor: int, place: int) -> Any:
    """Delayed reading of a sensor."""
    delayed = place - controller.delay[sensor]
    return readings[sensor, delayed if delayed >= 0 else delayed + readings.shape[1]]


@pasted
def _rates(
    controller: Controller,
    kept: Array,
    first: bool,
    gyro: float,
    encoder: float,
    resolver: float,
) -> Any:
    """Update filtered differences of angles, and the pointing angle (trapezoidal sum of rates).

    Returns the feedback of the rate loop: the gyro's rate, or that of the encoder.
    """
    if first:
        kept[KEPT_ENCODER], kept[KEPT_RESOLVER] = encoder, resolver
    pole = controller.filter_pole
    share = (1.0 - pole) / controller.period
    load_rate = pole * kept[KEPT_LOAD_RATE] + share * (encoder - kept[KEPT_ENCODER])
    motor_rate = pole * kept[KEPT_MOTOR_RATE] + share * (resolver - kept[KEPT_RESOLVER])
    kept[KEPT_LOAD_RATE], kept[KEPT_MOTOR_RATE] = load_rate, motor_rate
    rate = load_rate if controller.fed_by_encoder else gyro
    if not first:
        turned = 0.5 * controller.period * (kept[KEPT_GYRO] + rate)
        kept[KEPT_POINTING] = kept[KEPT_POINTING] * controller.pointing_pole + turned
    kept[KEPT_ENCODER], kept[KEPT_RESOLVER], kept[KEPT_GYRO] = encoder, resolver, rate
    return rate


@pasted
def _compensate(
    lanes: int,
    controller: Controller,
    compensation: Elements,
    memory: Memory,
    gyro: float,
    motor_torque: float,
) -> float:
    """Torque of the compensation: its linear block and its friction models."""
    relative, d = memory.kept[KEPT_LOAD_RATE], controller.d
    torque: float = d[0] * gyro + d[1] * motor_torque + d[2] * relative
    torque = _linear(lanes, controller, memory.linear, gyro, motor_torque, relative, torque)
    if compensation.viscous.shape[0] > 0:
        _meet(compensation, memory.kept)
        _ask_over(compensation, controller.period)
        _ask_over(compensation, AN_INSTANT)
        torque = torque + compensation.answer[MEAN]
        for e in range(compensation.viscous.shape[0]):
            rate = compensation.met[compensation.side[e], MEETS_RATE_END]
            torque = torque + compensation.viscous[e] * rate
    return torque


@pasted
def _meet(compensation: Elements, kept: Array) -> None:
    """Pass the newest filtered rates and angle to the friction models.

    A rate is constant: a difference of angles is the mean rate of the past sample.
    """
    load, motor = compensation.met[0], compensation.met[1]
    for row in (MEETS_RATE_START, MEETS_RATE_MEAN, MEETS_RATE_END):
        load[row], motor[row] = kept[KEPT_LOAD_RATE], kept[KEPT_MOTOR_RATE]
    load[MEETS_POSITION], motor[MEETS_POSITION] = kept[KEPT_ENCODER], kept[KEPT_ENCODER]


@pasted
def _ask_over(compensation: Elements, duration: Array | float) -> None:
    """Call the friction models over `duration` (s).

    Over the past sample this advances their states; then, over an instant, it returns the torque of
    the present states and rates.
    """
    load, motor = compensation.met[0], compensation.met[1]
    load[MEETS_STEP], motor[MEETS_STEP] = duration, duration
    load[MEETS_PER_STEP], motor[MEETS_PER_STEP] = 1.0 / duration, 1.0 / duration
    ask(compensation)


@pasted
def _command(
    controller: Controller,
    memory: Memory,
    number: int,
    command: float,
    gyro: float,
    torque: float,
) -> None:
    """Write the current command of this sample to its ring, and read the next one from it."""
    kept, outputs = memory.kept, memory.outputs
    place = number % outputs.shape[0]
    if controller.closes_rate_loop:
        error = command - gyro
        integral = kept[KEPT_INTEGRAL] + controller.integral * controller.period * error
        kept[KEPT_INTEGRAL] = integral
        current = controller.proportional * error + integral
    else:
        current = command / controller.torque_per_current
    outputs[place] = current + torque / controller.torque_per_current
    memory.held[0] = outputs[place + 1 if place + 1 < outputs.shape[0] else 0]


@pasted
def _linear(
    lanes: int,
    controller: Controller,
    state: Array,
    gyro: float,
    motor_torque: float,
    relative: float,
    torque: float,
) -> float:
    """Advance the linear compensation over a sample; returns `torque` plus its torque."""
    order, b, new = state.shape[0], controller.b, rows_on_the_stack(lanes)
    for row in range(order):
        torque = torque + controller.c[row] * state[row]
        total = b[row, 0] * gyro + b[row, 1] * motor_torque + b[row, 2] * relative
        for column in range(order):
            total = total + controller.a[row, column] * state[column]
        new[row] = total
    for row in range(order):
        state[row] = new[row]
    return torque
