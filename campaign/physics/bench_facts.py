"""Facts of a bench to check before use: ratios of its quantities.

Each fact divides one quantity by another of the same unit; a smaller ratio is better. Examples:
sensor count over the quantity to resolve, friction over drive torque, bandwidth over the next one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from campaign.axis_kind import axis_terms, axis_unit, in_axis_terms
from campaign.physics.bench import Bench
from campaign.physics.complete import CompleteBench, complete, control_rate, lacking
from campaign.physics.friction import small_signal_of
from campaign.physics.limits import worst_friction
from campaign.physics.loop_margins import LoopMargins
from campaign.physics.plan_loops import loops_of
from campaign.physics.preload import SLOWEST
from campaign.physics.resolution import rate_of_one_count
from campaign.physics.variation import of_its_day


@dataclass(frozen=True)
class Fact:
    """Ratio of two quantities of a bench.

    Attributes:
        subject: names of the two quantities.
        value, against: in `unit`, SI; their share is small on a good bench.
        display: displayed unit.
        verdict: `fine`, or the word for the defect.
        advice: recommended action; empty if the verdict is `fine`.
    """

    subject: str
    value: float
    against: float
    unit: str
    display: str
    verdict: str
    advice: str

    @property
    def share(self) -> float:
        return self.value / self.against


@dataclass(frozen=True)
class _Scale:
    """Largest shares that are fine and usable; words for larger shares."""

    fine: float
    usable: float
    words: tuple[str, str]
    advice: str

    def __call__(self, subject: str, value: float, against: float, unit: str, display: str) -> Fact:
        share = value / against
        subject, unit, display = in_axis_terms(subject), axis_unit(unit), axis_unit(display)
        if share <= self.fine:
            return Fact(subject, value, against, unit, display, "fine", "")
        word = self.words[0] if share <= self.usable else self.words[1]
        return Fact(subject, value, against, unit, display, word, in_axis_terms(self.advice))


_COARSE = ("coarse", "too coarse")
_READING = _Scale(1e-3, 2e-2, _COARSE, "Take a sensor with a finer resolution.")
_RATE_STEP = _Scale(
    0.02,
    0.5,
    _COARSE,
    "One count ends a trial, or nearly: raise limits.rate_time, "
    "controller.relative_rate_filter or limits.rate, or take a finer sensor.",
)
_PRESLIDING = _Scale(
    0.05,
    0.2,
    _COARSE,
    "Stiffness found in so few counts is guesswork: take a finer encoder.",
)
_STRIBECK_GYRO = _Scale(
    0.05, 0.5, _COARSE, "The Stribeck curve is lost between counts: take a finer gyro."
)
_STRIBECK_RATE = _Scale(
    0.2,
    1.0,
    _COARSE,
    "Compensation sees its rate in steps like the Stribeck velocity: raise "
    "controller.relative_rate_filter, or take a finer sensor.",
)
_TORQUE = _Scale(
    0.5, 0.9, ("tight", "too small"), "Little is left to move the load: raise the limit."
)
_AUTHORITY = _Scale(
    0.1,
    0.5,
    ("weak", "too weak"),
    "The load stays stuck until the integral has grown: raise controller.rate.proportional.",
)
_SAMPLING = _Scale(
    1 / 20,
    1 / 8,
    ("slow", "too slow"),
    "Sampling costs phase: raise controller.sample_rate, or lower the rate controller's gain.",
)
_CURRENT_LOOP = _Scale(
    1 / 5,
    1 / 2,
    ("slow", "too slow"),
    "The current loop costs phase: raise its gains, or lower the rate controller's.",
)


def facts_of(bench: Bench) -> tuple[Fact, ...]:
    """All facts of this bench on its day, without those whose values it lacks."""
    today = of_its_day(bench)
    with axis_terms(bench.sides):
        facts = (*_sensors(today), *_presliding(today), *_torques(today))
        return facts if lacking(bench) else (*facts, *_bandwidths(complete(bench)))


def current_bandwidth(bench: CompleteBench) -> float:
    """Frequency (rad/s) at which i / i* falls by 3 dB with a locked rotor.

    (Kpc s + Kic) / (L s^2 + (R + Kpc) s + Kic), from |i / i*|^2 = 1/2, quadratic in omega^2.
    """
    gains, motor = bench.controller.current, bench.motor
    p, i = gains.proportional, gains.integral_gain
    a = motor.inductance**2
    b = (motor.resistance + p) ** 2 - 2.0 * motor.inductance * i - 2.0 * p**2
    c = -(i**2)
    if i == 0.0:  # 3 dB below its gain at rest, p / (R + p)
        return (motor.resistance + p) / motor.inductance
    return math.sqrt((-b + math.sqrt(b * b - 4.0 * a * c)) / (2.0 * a))


def rate_steps(bench: Bench) -> dict[str, float]:
    """Rate at the load (rad/s) of one count of encoder or resolver in one sample.

    It includes the low-pass of the relative rate. Empty for a continuous controller; without the
    resolver if the gear ratio is unknown.
    """
    gains, sensors = bench.controller, bench.sensors
    if gains is None or gains.sample_rate is None:
        return {}
    low_pass = gains.relative_rate_filter
    passed = -math.expm1(-1.0 / (gains.sample_rate * low_pass)) if low_pass > 0 else 1.0
    counts = {"encoder": sensors.encoder.resolution}
    if bench.ratio is not None:
        counts["resolver"] = sensors.resolver.resolution / bench.ratio
    return {name: passed * gains.sample_rate * count for name, count in counts.items() if count > 0}


def _sensors(bench: Bench) -> Iterator[Fact]:
    gyro, current, limits = bench.sensors.gyro, bench.sensors.current, bench.limits
    slowest = min(_values(bench, "stribeck_velocity"), default=None)
    if limits is not None and gyro.resolution > 0:
        subject = "one count of the gyro against the rate limit"
        yield _READING(subject, gyro.resolution, limits.rate, "rad/s", "deg/s")
    if limits is not None and current.resolution > 0:
        subject = "one count of the current sensor against the current limit"
        yield _READING(subject, current.resolution, limits.current, "A", "A")
    rate = control_rate(bench)
    if limits is not None and rate is not None and bench.sensors.encoder.resolution > 0:
        step = rate_of_one_count(bench, rate, rate)
        subject = "one count of the encoder over limits.rate_time against the rate limit"
        yield _RATE_STEP(subject, step, limits.rate, "rad/s", "deg/s")
    if slowest is None:
        return
    seen = math.hypot(gyro.resolution, gyro.noise)
    if seen > 0:
        subject = "gyro resolution and noise against the Stribeck velocity"
        yield _STRIBECK_GYRO(subject, seen, slowest, "rad/s", "deg/s")
    for name, step in rate_steps(bench).items():
        subject = f"one count of the {name} in one sample against the Stribeck velocity"
        yield _STRIBECK_RATE(subject, step, slowest, "rad/s", "deg/s")


def _presliding(bench: Bench) -> Iterator[Fact]:
    """One count of the encoder, the source of the recorded angle, against Ts / sigma0 of each
    interface, at the load.
    """
    count = bench.sensors.encoder.resolution
    if count == 0:
        return
    for name, options in bench.friction.items():
        stuck = small_signal_of(options).stuck
        static = getattr(options, "static_torque", None)
        if stuck is None or stuck.stiffness <= 0 or not static:
            continue
        span = static / stuck.stiffness / bench.at_load(options)[1]
        subject = f"one count of the encoder against the presliding Ts/σ0 of '{name}'"
        yield _PRESLIDING(subject, count, span, "rad", "deg")


def _torques(bench: Bench) -> Iterator[Fact]:
    static = worst_friction(bench, SLOWEST)
    limits, per_ampere = bench.limits, bench.torque_per_current
    if static <= 0 or limits is None:
        return
    yield _TORQUE("static friction against the torque limit", static, limits.torque, "N m", "N m")
    if per_ampere is None:
        return
    subject = "static friction against the torque at the current limit"
    yield _TORQUE(subject, static, per_ampere * limits.current, "N m", "N m")
    if bench.controller is None or bench.controller.rate is None:
        return
    error = static / (per_ampere * bench.controller.rate.proportional)
    subject = "rate error at which the proportional gain alone breaks away, against the rate limit"
    yield _AUTHORITY(subject, error, limits.rate, "rad/s", "deg/s")


def _bandwidths(bench: CompleteBench) -> Iterator[Fact]:
    """Crossover of the rate loop against sample rate and current loop; sliding, uncompensated."""
    loop = dict(loops_of(bench, "none", "rate"))["sliding"]
    crossovers = loop.crossovers if isinstance(loop, LoopMargins) else ()
    if not crossovers:
        return
    crossover = max(crossovers) / (2.0 * np.pi)
    if bench.controller.sample_rate is not None:
        subject = "crossover of the rate loop against the sample rate"
        yield _SAMPLING(subject, crossover, bench.controller.sample_rate, "Hz", "Hz")
    subject = "crossover of the rate loop against the bandwidth of the current loop"
    yield _CURRENT_LOOP(subject, crossover, current_bandwidth(bench) / (2.0 * np.pi), "Hz", "Hz")


def _values(bench: Bench, name: str) -> list[Any]:
    values = (getattr(options, name, None) for options in bench.friction.values())
    return [value for value in values if value]
