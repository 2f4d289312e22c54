"""Whether the rate loop with a linear compensation is stable: eigenvalues of the very loop.

A continuous controller makes one matrix with the plant; a sampled one is advanced from sample to
sample, with its delays, its hold and its discretised compensation, as the simulation does it. Dry
friction is left out (it only damps, or stops, what is linear); viscous friction is in.
"""

from __future__ import annotations

import math

import numpy as np

from campaign.physics.bench import Bench
from campaign.physics.compensation.interface import LinearBlock
from campaign.physics.loop import (
    ANGLE,
    CURRENT,
    DRIVE,
    RATE,
    RELATIVE_ANGLE,
    discretise,
    make_compensator,
    make_loop,
    make_plant,
)
from campaign.signals import Array

NOT_FED_BACK = (ANGLE, RELATIVE_ANGLE)
"""States that only integrate, for the record; they have nothing to do with stability."""


def growth_rate(bench: Bench, compensation: str) -> float:
    """Real part (1/s) of the fastest growing mode of the rate loop; negative when it is stable."""
    compensator = make_compensator(bench, compensation)
    sample_rate = bench.controller.sample_rate
    if sample_rate is None:
        loop = make_loop(bench, "rate", compensator)
        kept = [i for i in range(len(loop.a)) if i not in NOT_FED_BACK]
        return float(np.max(np.linalg.eigvals(loop.a[np.ix_(kept, kept)]).real))
    block = compensator.linear or LinearBlock(
        np.zeros((0, 0)), np.zeros((0, 3)), np.zeros(0), np.zeros(3)
    )
    largest = float(np.max(np.abs(np.linalg.eigvals(_sample_to_sample(bench, block)))))
    return math.log(largest) * sample_rate


def _sample_to_sample(bench: Bench, block: LinearBlock) -> Array:
    """The matrix over one controller sample.

    State: plant, rate integral, compensation, then past gyro and current readings and past outputs,
    the newest first.
    """
    gains, ratio = bench.controller, bench.torque_per_current
    period = 1.0 / float(gains.sample_rate or 1.0)
    loop = make_plant(bench)
    kept = [i for i in range(len(loop.a)) if i not in NOT_FED_BACK]
    rate, current = kept.index(RATE), kept.index(CURRENT)
    f, g, _ = discretise(loop.a[np.ix_(kept, kept)], loop.b[np.ix_(kept, [DRIVE])], period)
    a, b, _ = discretise(block.a, block.b, period) if len(block.c) else (block.a, block.b, None)
    late_gyro, late_current = (
        round(sensor.delay / period) for sensor in (bench.sensors.gyro, bench.sensors.current)
    )
    late_output = math.ceil(gains.delay / period - 1e-9)
    ends = np.cumsum([len(f), 1, len(a), late_gyro, late_current, late_output])

    def advance(state: Array) -> Array:
        x, integral, own, gyros, currents, outputs = np.split(state, ends[:-1])
        gyros, currents = np.append(x[rate], gyros), np.append(x[current], currents)
        y = np.array([gyros[-1], ratio * currents[-1], 0.0])
        torque = block.c @ own + block.d @ y
        integral = integral - gains.rate.integral_gain * period * gyros[-1]
        output = integral - gains.rate.proportional * gyros[-1] + torque / ratio
        outputs = np.append(output, outputs)
        moved = f @ x + g[:, 0] * outputs[-1]
        past = (gyros[:-1], currents[:-1], outputs[:-1])
        return np.concatenate([moved, integral, a @ own + b @ y, *past])

    return np.stack([advance(unit) for unit in np.eye(ends[-1])], axis=1)
