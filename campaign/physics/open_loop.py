"""The open loop of a bench: linear, with delays, filters and compensation.

The **rate loop** is opened at the error of the rate controller, r - w with the gyro's reading w:
the signal that the gain Kpv multiplies. The experiment `frequency_response` opens the loop at the
same point by computation. All other loops stay closed: current loop, back-EMF, friction, and
compensation, which is thus part of the plant. L is the rate controller times that plant; the
solutions of 1 + L = 0 are the poles of the whole system.

With a commanded torque there is no rate loop. Compensation alone then closes a loop, which is
opened at the compensation torque.

A continuous loop is dx/dt = A x + B u, y = C x. A sampled loop is the same per sample, as in the
engine's controller: readings are late by whole samples, relative rates are low-passed backward
differences, and the held output is late by any share of a sample.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from campaign.physics.compensation.interface import Compensator, LinearBlock
from campaign.physics.complete import CompleteBench
from campaign.physics.linear_friction import (
    FrictionPath,
    NoLoopError,
    Regime,
    bench_friction,
    compensation_friction,
)
from campaign.physics.loop import discretise, make_compensator, make_loop, make_plant
from campaign.physics.rows import (
    ANGLE,
    COMPENSATION,
    CURRENT,
    DRIVE,
    FRICTION,
    RATE,
    RELATIVE_ANGLE,
)
from campaign.physics.variation import of_its_day
from campaign.signals import Array

Mode = Literal["rate", "torque"]
MOST_DELAYS = 400
"""Maximum number of states, most of them delayed samples; larger matrices fill the memory."""


@dataclass(frozen=True)
class OpenLoop:
    """dx/dt = A x + B u, or x' = A x + B u from sample to sample; y = C x, closed by u = -y.

    Attributes:
        a, b, c: (n, n), (n,), (n,).
        period: s; None for a continuous loop.
    """

    a: Array
    b: Array
    c: Array
    period: float | None

    @property
    def closed(self) -> Array:
        """Matrix of the closed loop (n, n)."""
        return self.a - np.outer(self.b, self.c)


def open_loop(bench: CompleteBench, compensation: str, mode: Mode, regime: Regime) -> OpenLoop:
    """Open loop on the bench's day. Raises NoLoopError if there is no linear loop."""
    bench = of_its_day(bench)
    compensator = make_compensator(bench, compensation)
    if mode == "torque" and compensator.linear is None and not compensator.friction:
        raise NoLoopError("a commanded torque without compensation closes no loop")
    friction = bench_friction(bench, regime)
    models = compensation_friction(bench, compensator, regime)
    if bench.controller.sample_rate is None:
        return _continuous(bench, compensator, friction, models, mode)
    return _Sampled(bench, compensator.linear, friction, models, mode).opened()


def _continuous(
    bench: CompleteBench,
    compensator: Compensator,
    friction: FrictionPath,
    models: tuple[FrictionPath, ...],
    mode: Mode,
) -> OpenLoop:
    loop = make_loop(bench, "torque", compensator)  # compensation is closed, the rate loop open
    seen, low_pass = np.zeros(len(loop.a)), bench.controller.relative_rate_filter
    seen[loop.seen] = 1.0
    # The bristles of a model move with the integral of its input rate; behind a low-pass this is
    # the angle minus the lag of the filter.
    angle = np.zeros(len(seen))
    angle[RELATIVE_ANGLE] = 1.0
    jumping = sum((m.stiffness * (angle - low_pass * seen) + m.damping * seen for m in models), 0.0)
    a = loop.a + np.outer(loop.b[:, COMPENSATION], jumping + np.zeros(len(seen)))
    a[:, RELATIVE_ANGLE] += loop.b[:, FRICTION] * friction.stiffness
    a[:, RATE] += loop.b[:, FRICTION] * friction.damping
    integral = 5 if bench.appendage is None else 7  # a torque command leaves this state unused
    if mode == "rate":
        gains, scale = bench.controller.rate, bench.torque_per_current
        a[:, integral] += loop.b[:, DRIVE] * scale * gains.integral_gain
        b = loop.b[:, DRIVE] * scale * gains.proportional
        b[integral] += 1.0
        c = np.zeros(len(a))
        c[RATE] = 1.0
        unused = [ANGLE]
    else:
        viscous = sum(model.viscous for model in models)
        b = loop.b[:, COMPENSATION].copy()
        c = -(loop.linear_compensation[0] + jumping + viscous * seen)
        a += np.outer(b, c)
        unused = [ANGLE, integral]
    if not np.any(a[:, RELATIVE_ANGLE]) and not c[RELATIVE_ANGLE]:
        unused.append(RELATIVE_ANGLE)
    kept = [i for i in range(len(a)) if i not in unused]
    return OpenLoop(a[np.ix_(kept, kept)], b[kept], c[kept], None)


class _Sampled:
    """Builder of a sampled loop: each signal is a row over the states and, last, the input.

    States: plant, rate integral, linear compensation, filtered relative rates of encoder and
    resolver, then past readings (gyro, angle, current) and past outputs, newest first. Without
    stiffness the angle state is its change over a sample: its value has no effect, and would only
    add a pole at 1.
    """

    def __init__(
        self,
        bench: CompleteBench,
        block: LinearBlock | None,
        friction: FrictionPath,
        models: tuple[FrictionPath, ...],
        mode: Mode,
    ) -> None:
        self.bench, self.models, self.mode = bench, models, mode
        self.block = block or LinearBlock(
            np.zeros((0, 0)), np.zeros((0, 3)), np.zeros(0), np.zeros(3)
        )
        self.period = 1.0 / float(bench.controller.sample_rate or 1.0)
        self.sensor_delays = [
            round(sensor.delay / self.period) for sensor in bench.sensors.in_order
        ]
        delay = bench.controller.delay / self.period
        self.late_output = math.floor(delay + 1e-9)
        self.share = max(0.0, delay - self.late_output)  # of a sample, before the output changes
        self.share = 0.0 if self.share < 1e-9 else self.share
        self.anchored = friction.stiffness != 0.0 or any(model.stiffness for model in models)
        gyro, encoder, resolver, current = self.sensor_delays
        sizes = {
            "plant": len(make_plant(bench).a) - 1,
            "integral": 1 if mode == "rate" else 0,
            "block": len(self.block.c),
            "rates": 2,
            "gyro": gyro,
            "angle": max(encoder, resolver) + (1 if self.anchored else 0),
            "current": current,
            "output": self.late_output + (1 if self.share else 0),
        }
        if sum(sizes.values()) > MOST_DELAYS:
            raise NoLoopError("its delays last too many samples to compute")
        ends = np.cumsum(list(sizes.values()))
        self.size = int(ends[-1])
        self.places = {
            name: slice(int(end) - size, int(end))
            for (name, size), end in zip(sizes.items(), ends, strict=True)
        }
        self.friction = friction

    def state(self, name: str) -> Array:
        """Rows of the states of that name, (k, n + 1)."""
        return np.eye(self.size, self.size + 1)[self.places[name]]

    def opened(self) -> OpenLoop:
        """The open loop."""
        gyro, angle, current, indices = self.readings()
        rates = self.relative_rates(angle)
        after = np.zeros((self.size, self.size + 1))
        entered = np.zeros(self.size + 1)
        entered[-1] = 1.0
        fed = rates[0] if self.bench.rate_is_of_encoder else gyro[-1]
        torque, moved_block = self.compensation(fed, current[-1], angle, rates)
        output = torque if self.mode == "rate" else entered
        output = output / self.bench.torque_per_current
        if self.mode == "rate":
            gains = self.bench.controller.rate
            integral = self.state("integral")[0] + gains.integral_gain * self.period * entered
            output = output + gains.proportional * entered + integral
            after[self.places["integral"]] = integral
        outputs = np.vstack([output, self.state("output")])
        after[self.places["plant"]] = self.moved(outputs, indices)
        after[self.places["block"]] = moved_block
        after[self.places["rates"]] = np.stack(rates)
        for name, values in (("gyro", gyro), ("current", current), ("output", outputs)):
            after[self.places[name]] = values[:-1]
        kept = self.places["angle"].stop - self.places["angle"].start
        after[self.places["angle"]] = angle[:kept]
        seen = fed if self.mode == "rate" else -torque
        return OpenLoop(after[:, :-1], after[:, -1].copy(), seen[:-1].copy(), self.period)

    def readings(self) -> tuple[Array, Array, Array, list[int]]:
        """Gyro, angle (or its change over a sample) and current, newest first; plant indices."""
        plant = self.state("plant")
        indices = [i for i in range(len(plant) + 1) if i != ANGLE]
        rate, angle, current = (indices.index(i) for i in (RATE, RELATIVE_ANGLE, CURRENT))
        return (
            np.vstack([plant[rate], self.state("gyro")]),
            np.vstack([plant[angle], self.state("angle")]),
            np.vstack([plant[current], self.state("current")]),
            indices,
        )

    def relative_rates(self, angle: Array) -> list[Array]:
        """Relative rates of encoder and resolver: backward difference, then low-pass."""
        low_pass = self.bench.controller.relative_rate_filter
        pole = math.exp(-self.period / low_pass) if low_pass > 0.0 else 0.0
        filtered = []
        for before, late in zip(self.state("rates"), self.sensor_delays[1:3], strict=True):
            change = angle[late] - angle[late + 1] if self.anchored else angle[late]
            filtered.append(pole * before + (1.0 - pole) / self.period * change)
        return filtered

    def compensation(
        self, gyro: Array, current: Array, angle: Array, rates: list[Array]
    ) -> tuple[Array, Array]:
        """Compensation torque (n + 1,), and the linear block's next state (m, n + 1)."""
        block, state = self.block, self.state("block")
        y = np.stack([gyro, self.bench.torque_per_current * current, rates[0]])
        torque = block.c @ state + block.d @ y
        low_pass = self.bench.controller.relative_rate_filter
        pole = math.exp(-self.period / low_pass) if low_pass > 0.0 else 0.0
        for model in self.models:
            side = 1 if model.motor_side else 0
            now = rates[side]
            torque = torque + (model.viscous + model.damping) * now
            if model.stiffness:
                # z, the sum of the filtered differences, is the angle minus the filter's lag.
                behind = self.period * pole / (1.0 - pole)
                z = angle[self.sensor_delays[1 + side]] - behind * now
                torque = torque + model.stiffness * z
        if not len(block.c):
            return torque, state
        a, b, _ = discretise(block.a, block.b, self.period)
        return torque, a @ state + b @ y

    def moved(self, outputs: Array, indices: list[int]) -> Array:
        """Next state of the plant: the older output acts for its share of the sample."""
        loop = make_plant(self.bench)
        a, b = loop.a.copy(), loop.b[:, [DRIVE]]
        a[:, RELATIVE_ANGLE] += loop.b[:, FRICTION] * self.friction.stiffness
        a[:, RATE] += loop.b[:, FRICTION] * self.friction.damping
        kept = np.ix_(indices, indices)
        a, b = a[kept], b[indices]
        f, g, _ = discretise(a, b, (1.0 - self.share) * self.period)
        by_older = np.zeros_like(g)
        if self.share:
            first, by_older, _ = discretise(a, b, self.share * self.period)
            f, by_older = f @ first, f @ by_older
        if not self.anchored:
            f[:, indices.index(RELATIVE_ANGLE)] = 0.0
        moved = f @ self.state("plant") + np.outer(g[:, 0], outputs[self.late_output])
        if self.share:
            moved += np.outer(by_older[:, 0], outputs[self.late_output + 1])
        return np.asarray(moved)
