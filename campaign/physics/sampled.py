"""One sample of a sampled controller: sensors, rate loop, compensation, output."""

from __future__ import annotations

import numpy as np
from numba import carray

from campaign.physics.blocks import MOST_COLUMNS, Array, Controller, Elements, Memory
from campaign.physics.compiled import called, inlined
from campaign.physics.friction_lines import ask, on_a_line
from campaign.physics.rows import (
    CHANGE,
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
    MEETS_POSITION,
    MEETS_RATE_END,
    MEETS_RATE_START,
    RATE,
    RELATIVE_ANGLE,
    RESOLVER,
)
from campaign.physics.stack import stack_doubles


@called
def sample(
    lanes: int,
    controller: Controller,
    compensation: Elements,
    memory: Memory,
    x: Array,
    signals: Array,
    drive_row: int,
    now: int,
    noise: Array,
    reading: int,
) -> None:
    """One sample of the controller: read the sensors, put the current command that is next.

    x: states of the plant.   drive_row, now: where the command stands in `signals`.
    reading: of `noise`, counted from where it begins.
    """
    number = memory.counters[1]
    memory.counters[1] += 1
    work = carray(stack_doubles(), (MOST_COLUMNS, lanes))
    gyro, encoder, resolver, motor_torque, torque = work[0], work[1], work[2], work[3], work[4]
    _read_sensors(lanes, controller, memory.readings, number, x, noise, reading)
    _delayed(lanes, controller, memory, number, gyro, encoder, resolver, motor_torque)
    _rates(lanes, controller, memory.kept, number, gyro, encoder, resolver, compensation)
    _compensate(lanes, controller, compensation, memory, gyro, motor_torque, torque)
    _command(lanes, controller, memory, number, signals, drive_row, now, gyro, torque)


@inlined
def _read_sensors(
    lanes: int,
    controller: Controller,
    readings: Array,
    number: int,
    x: Array,
    noise: Array,
    reading: int,
) -> None:
    """What the sensors read now: the truth, with noise, in whole counts; into their ring."""
    place = number % readings.shape[1]
    for k in range(lanes):
        readings[GYRO, place, k] = x[RATE, k]
        readings[ENCODER, place, k] = x[RELATIVE_ANGLE, k]
        readings[RESOLVER, place, k] = x[RELATIVE_ANGLE, k] * controller.ratio[k]
        readings[CURRENT_SENSOR, place, k] = x[CURRENT, k]
    for s in range(4):
        if controller.noisy[s] >= 0:
            for k in range(lanes):
                readings[s, place, k] += noise[reading, controller.noisy[s], k]
        for k in range(lanes):
            count, value = controller.resolution[s, k], readings[s, place, k]
            counted = np.rint(value / (count if count > 0.0 else 1.0)) * count
            readings[s, place, k] = counted if count > 0.0 else value
        if number == 0:  # before the first sample everything stood still
            for before in range(readings.shape[1]):
                for k in range(lanes):
                    readings[s, before, k] = readings[s, 0, k]


@inlined
def _delayed(
    lanes: int,
    controller: Controller,
    memory: Memory,
    number: int,
    gyro: Array,
    encoder: Array,
    resolver: Array,
    motor_torque: Array,
) -> None:
    """What the controller has of it by now; the resolver's angle at the load."""
    readings, ring = memory.readings, memory.readings.shape[1]
    for k in range(lanes):
        gyro[k] = readings[GYRO, (number - controller.delay[GYRO]) % ring, k]
        encoder[k] = readings[ENCODER, (number - controller.delay[ENCODER]) % ring, k]
        angle = readings[RESOLVER, (number - controller.delay[RESOLVER]) % ring, k]
        resolver[k] = angle / controller.ratio[k]
        current = readings[CURRENT_SENSOR, (number - controller.delay[CURRENT_SENSOR]) % ring, k]
        memory.kept[KEPT_CURRENT, k] = current
        motor_torque[k] = controller.torque_per_current[k] * current


@inlined
def _rates(
    lanes: int,
    controller: Controller,
    kept: Array,
    number: int,
    gyro: Array,
    encoder: Array,
    resolver: Array,
    compensation: Elements,
) -> None:
    """Differences of the angles, filtered; and the pointing angle, the trapezoidal sum of rates."""
    load, motor = compensation.met[0], compensation.met[1]
    for k in range(lanes):
        load[MEETS_RATE_START, k] = kept[KEPT_LOAD_RATE, k]
        motor[MEETS_RATE_START, k] = kept[KEPT_MOTOR_RATE, k]
    if number == 0:
        for k in range(lanes):
            kept[KEPT_ENCODER, k], kept[KEPT_RESOLVER, k] = encoder[k], resolver[k]
    else:
        for k in range(lanes):
            pointing = kept[KEPT_POINTING, k] * controller.pointing_pole[k]
            turned = 0.5 * controller.period[k] * (kept[KEPT_GYRO, k] + gyro[k])
            kept[KEPT_POINTING, k] = pointing + turned
    for k in range(lanes):
        pole = controller.filter_pole[k]
        share = (1.0 - pole) / controller.period[k]
        turned = encoder[k] - kept[KEPT_ENCODER, k]
        kept[KEPT_LOAD_RATE, k] = pole * kept[KEPT_LOAD_RATE, k] + share * turned
        turned = resolver[k] - kept[KEPT_RESOLVER, k]
        kept[KEPT_MOTOR_RATE, k] = pole * kept[KEPT_MOTOR_RATE, k] + share * turned
        kept[KEPT_ENCODER, k], kept[KEPT_RESOLVER, k] = encoder[k], resolver[k]
        kept[KEPT_GYRO, k] = gyro[k]
        load[MEETS_RATE_END, k] = kept[KEPT_LOAD_RATE, k]
        motor[MEETS_RATE_END, k] = kept[KEPT_MOTOR_RATE, k]
        load[MEETS_POSITION, k], motor[MEETS_POSITION, k] = encoder[k], encoder[k]
    on_a_line(lanes, load)
    on_a_line(lanes, motor)


@inlined
def _compensate(
    lanes: int,
    controller: Controller,
    compensation: Elements,
    memory: Memory,
    gyro: Array,
    motor_torque: Array,
    torque: Array,
) -> None:
    """The torque of the compensation: its linear block, and its friction models now."""
    kept, answer = memory.kept, compensation.answer
    for k in range(lanes):
        torque[k] = (
            controller.d[0, k] * gyro[k]
            + controller.d[1, k] * motor_torque[k]
            + controller.d[2, k] * kept[KEPT_LOAD_RATE, k]
        )
    _linear(lanes, controller, memory.linear, gyro, motor_torque, kept[KEPT_LOAD_RATE], torque)
    if compensation.viscous.shape[0] > 0:
        ask(lanes, compensation)
        for k in range(lanes):
            torque[k] += answer[MEAN, k] + 0.5 * answer[CHANGE, k]
        for e in range(compensation.viscous.shape[0]):
            met = compensation.met[compensation.motor_side[e]]
            for k in range(lanes):
                torque[k] += compensation.viscous[e, k] * met[MEETS_RATE_END, k]
    for k in range(lanes):
        kept[KEPT_TORQUE, k] = torque[k]


@inlined
def _command(
    lanes: int,
    controller: Controller,
    memory: Memory,
    number: int,
    signals: Array,
    drive_row: int,
    now: int,
    gyro: Array,
    torque: Array,
) -> None:
    """The current command of this sample, into its ring; the one that is next comes out of it."""
    kept, outputs = memory.kept, memory.outputs
    delayed = outputs.shape[0]
    for k in range(lanes):
        command = signals[drive_row, now, k]
        if controller.closes_rate_loop:
            error = command - gyro[k]
            kept[KEPT_INTEGRAL, k] += controller.integral[k] * controller.period[k] * error
            current = controller.proportional[k] * error + kept[KEPT_INTEGRAL, k]
        else:
            current = command / controller.torque_per_current[k]
        outputs[number % delayed, k] = current + torque[k] / controller.torque_per_current[k]
        memory.held[0, k] = outputs[(number + 1) % delayed, k]


@inlined
def _linear(
    lanes: int,
    controller: Controller,
    state: Array,
    gyro: Array,
    motor_torque: Array,
    relative: Array,
    torque: Array,
) -> None:
    """Advance the linear compensation over a sample and add its torque."""
    order = state.shape[0]
    new = carray(stack_doubles(), (MOST_COLUMNS, lanes))
    for row in range(order):
        for k in range(lanes):
            torque[k] += controller.c[row, k] * state[row, k]
            new[row, k] = (
                controller.b[row, 0, k] * gyro[k]
                + controller.b[row, 1, k] * motor_torque[k]
                + controller.b[row, 2, k] * relative[k]
            )
        for column in range(order):
            for k in range(lanes):
                new[row, k] += controller.a[row, column, k] * state[column, k]
    for row in range(order):
        for k in range(lanes):
            state[row, k] = new[row, k]
