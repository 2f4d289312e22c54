"""The stepping loop around `tests.physics.dry_step`, for one trial and as short as may be.

The linear part is the program's own (`campaign.physics.loop`); what is tried here is how dry
friction, friction with bristles and compensation are asked in one step:

1. the step without any of them, and with the others' torques as they were at its start;
2. `dry_step` with that: the rate and motion that all others are then asked with;
3. their lines are added; a step that ends stuck is held again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from campaign.physics.bench import Bench
from campaign.physics.compiled import compiled, inlined
from campaign.physics.friction.stribeck import curve_parameters
from campaign.physics.loop import (
    at_load,
    discretise,
    make_compensator,
    make_loop,
    make_spring,
    viscous_at_load,
)
from tests.physics.dry_step import (
    Response,
    crossing,
    dry_feedforward,
    dry_step,
    holding_line,
    sliding_torque,
)

Array = np.ndarray
Signal = Callable[[Array], Array]
OUTPUTS = (
    "load_rate",
    "pointing_angle",
    "relative_angle",
    "motor_current",
    "friction_torque",
    "direction",
)


@inlined
def bristle_line(of: Array, z: Array, v0: float, v1: float, v: float, step: float) -> Any:
    """Mean and change of LuGre friction at the load, of all interfaces; z is advanced.

    v: mean rate. of: (interfaces, 11), the curve, stiffness and damping.
    """
    mean, change = 0.0, 0.0
    turned = 0.5 * (v0 * v0 + v1 * v1) / max(abs(v0) + abs(v1), 1e-300)
    speed = abs(v) if v0 * v1 >= 0.0 else turned
    for e in range(of.shape[0]):
        at = 0 if v >= 0.0 else 4
        fall = math.exp(-((speed / of[e, at + 2]) ** of[e, at + 3]))
        per_s = of[e, 9] / (of[e, at] + (of[e, at + 1] - of[e, at]) * fall)
        x = per_s * speed * step
        share = -math.expm1(-x) / x if x > 1e-12 else 1.0
        dz = (v - per_s * speed * z[e]) * step * share
        mean += of[e, 9] * (z[e] + 0.5 * dz) + of[e, 10] * dz / step + of[e, 8] * speed
        change += of[e, 9] * dz
        # sigma1 dz/dt changes, too.
        change += of[e, 10] * (v1 - per_s * abs(v1) * (z[e] + dz) - v0 + per_s * abs(v0) * z[e])
        z[e] += dz
    return mean, change


@compiled
def advance(
    f: Array,
    g: Array,
    h: Array,
    step: float,
    dry: Array,
    bristles: Array,
    static: Array,
    modelled: Array,
    viscous: float,
    drive: Array,
    base: Array,
    x: Array,
    every: int,
    out: Array,
) -> None:
    """Rows as OUTPUTS. dry, bristles: the plant's; static, modelled: the compensation's."""
    centred = h - 0.5 * g  # per N m of change about the mean
    response = Response(-g[0, 2], -centred[0, 2], -g[2, 2], -centred[2, 2])
    has_dry = dry.shape[0] > 0
    z, z_modelled = np.zeros(bristles.shape[0]), np.zeros(modelled.shape[0])
    held, held_added, ended = 0.0, 0.0, 0.0
    v0 = x[0] - base[0]
    direction = np.sign(v0) if abs(v0) > 1e-14 else 0.0
    new = np.empty_like(x)
    for k in range(drive.shape[0] - 1):
        for i in range(x.shape[0]):
            new[i] = g[i, 0] * drive[k] + h[i, 0] * (drive[k + 1] - drive[k])
            new[i] += g[i, 1] * base[k] + h[i, 1] * (base[k + 1] - base[k])
            for j in range(x.shape[0]):
                new[i] += f[i, j] * x[j]
        v0 = x[0] - base[k]
        v1 = new[0] - base[k + 1] + g[0, 2] * held + g[0, 3] * held_added
        motion = new[2] - x[2] + g[2, 2] * held + g[2, 3] * held_added

        before, after, leaves, begins = np.sign(v0), np.sign(v1), 1.0, 1.0
        mean, change, start, end = 0.0, 0.0, 0.0, 0.0
        if has_dry:
            told = dry_step(dry, direction, v0, v1, motion, step, response)
            mean, change, start, end, after, v1, motion, leaves, begins = told
            before, direction = direction, after
        elif before != after:
            leaves = crossing(v0, v1, motion / step)
            begins = leaves
        own, own_change = bristle_line(bristles, z, v0, v1, motion / step, step)
        added, added_change = bristle_line(modelled, z_modelled, v0, v1, motion / step, step)
        fed, fed_change = dry_feedforward(static, before, after, leaves, begins, v0, v1)
        held = own + 0.5 * own_change
        held_added = added + 0.5 * added_change + after * sliding_torque(static, after, v1)
        added, added_change = added + fed, added_change + fed_change
        if has_dry and direction == 0.0:
            rate = new[0] - base[k + 1] + g[0, 2] * own + centred[0, 2] * own_change
            rate += g[0, 3] * added + centred[0, 3] * added_change
            travel = new[2] - x[2] + g[2, 2] * own + centred[2, 2] * own_change
            travel += g[2, 3] * added + centred[2, 3] * added_change
            mean, change = holding_line(rate, travel - motion, response)
            if before == 0.0:
                start, end = mean - 0.5 * change, mean + 0.5 * change

        if k % every == 0:
            for i in range(4):
                out[i, k // every] = x[i]
            dry_torque = 0.5 * (start + ended) if k > 0 else start
            out[4, k // every] = dry_torque + own - 0.5 * own_change + viscous * v0
            out[5, k // every] = direction
        ended = end
        mean, change = mean + own, change + own_change
        for i in range(x.shape[0]):
            x[i] = new[i] + g[i, 2] * mean + centred[i, 2] * change
            x[i] += g[i, 3] * added + centred[i, 3] * added_change
        if has_dry and direction == 0.0:
            x[0] = base[k + 1]


def at_the_load(items: Iterable[Any], bench: Bench, model: str) -> Array:
    """Curve parameters of the interfaces of this model, torques and rates at the load."""
    rows = []
    for item in items:
        if item.model != model:
            continue
        torque, rate = at_load(item, bench)
        way = np.array([torque, torque, 1.0 / rate, 1.0])
        row = np.array(curve_parameters(item)) * np.array([*way, *way, torque * rate])
        if model == "lugre":
            more = np.array([item.bristle_stiffness, item.bristle_damping]) * torque * rate
            row = np.concatenate([row, more])
        rows.append(row)
    return np.array(rows).reshape(-1, 9 if model == "stribeck" else 11)


def simulate(
    bench: Bench,
    duration: float,
    step: float,
    base_rate: Signal,
    drive: Signal = np.zeros_like,
    mode: Any = "rate",
    compensation: str = "none",
    spring: float = 0.0,
    sample: float = 1e-3,
) -> tuple[Array, dict[str, Array]]:
    """Time and outputs by name, recorded each `sample` (s), or each step where that is longer."""
    compensator = make_compensator(bench, compensation)
    sprung = mode == "spring"
    loop = make_spring(bench, spring) if sprung else make_loop(bench, mode, compensator)
    every = max(1, round(sample / step))
    samples = round(duration / (step * every))
    time = np.arange(samples * every + 1) * step
    out = np.zeros((len(OUTPUTS), samples))
    plant = list(bench.friction.values())
    models = [options for options, _ in compensator.friction]
    advance(
        *discretise(loop.a, loop.b, step), step,
        at_the_load(plant, bench, "stribeck"), at_the_load(plant, bench, "lugre"),
        at_the_load(models, bench, "stribeck"), at_the_load(models, bench, "lugre"),
        sum(viscous_at_load(item, bench) for item in plant),
        drive(time), base_rate(time), np.zeros(len(loop.a)), every, out,
    )  # fmt: skip
    return time[:-1:every], dict(zip(OUTPUTS, out, strict=True))
