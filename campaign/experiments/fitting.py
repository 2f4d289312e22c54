"""Options that a test does not write, as they suit its bench, each with the reason.

An experiment names one of these functions as its `fit`. They know the rig as it is described, not
as it is: where friction is not described they take what the limits allow, and say so.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from campaign.experiments.interface import Chosen
from campaign.experiments.rig import MOST, Rig
from campaign.physics.bench import Bench
from campaign.units import convert, factor

DEG = math.pi / 180.0
SETTLED = 10.0
"""Ts / sigma0 after which friction's memory is below 1e-4 of Ts: exp(-10) = 5e-5."""
SPEEDS = 40
"""of a map: the fit needs some ten, the rest shows where the curve is not the model's."""
SWEPT = 40
"""frequencies, evenly in their logarithm."""
RAMP_TIME = 30.0
"""s, of a torque ramp up to breakaway: slow against friction's own rates."""
RUN_OUT = 4.0
"""s; times the rate that counts as sliding, room behind a ramp for the load to be stopped in."""
PEAK = 1.8
"""times the static torque: where a ramp or a torque sine ends."""

Reasons = Mapping[str, float]
"""Sizes (SI) by the reason that asks for them."""


@dataclass
class Choices:
    """What is chosen for the options of one test; those that it writes stay as they are."""

    options: Any
    told: dict[str, Chosen] = field(default_factory=dict)

    def least(self, name: str, unit: str, reasons: Reasons) -> float:
        """The smallest of some sizes, with few digits in `unit`, rounded towards zero."""
        why = min(reasons, key=lambda reason: reasons[reason])
        return float(self.take(name, nice(reasons[why], unit), why))

    def most(self, name: str, unit: str, reasons: Reasons) -> float:
        """The largest of some sizes, with few digits in `unit`, rounded away from zero."""
        why = max(reasons, key=lambda reason: reasons[reason])
        return float(self.take(name, nice(reasons[why], unit, up=True), why))

    def take(self, name: str, value: Any, why: str) -> Any:
        """What the option will be: as written, or `value`."""
        if name in self.options.model_fields_set:
            return getattr(self.options, name)
        if value != getattr(self.options, name):
            self.told[name] = Chosen(value, why)
        return value

    def sample_rate(self, rig: Rig) -> float:
        """Of the recording (Hz)."""
        return float(self.take("sample_rate", rig.sample_rate, "the controller's own rate"))


def velocity_map(options: Any, bench: Bench) -> Mapping[str, Chosen]:
    """Travel, ramps, settling, windows, speeds and times of a friction-velocity map."""
    rig, limits, choices = Rig(bench), bench.limits, Choices(options)
    _overcome_friction(rig)
    own = options.speeds
    travel = choices.least(
        "max_travel", "deg", {"a usual size": 60 * DEG, share("angle", 0.8): 1.6 * limits.angle}
    )
    acceleration = choices.least(
        "acceleration",
        "deg/s^2",
        {
            "a usual size": 300 * DEG,
            "half of what torque and friction leave": 0.5 * rig.acceleration(0.7 * limits.rate),
        },
    )
    fastest = (
        max(own)
        if own
        else choices.least(
            "fastest",
            "deg/s",
            {
                share("rate", 0.7): 0.7 * limits.rate,
                "a second is left of the travel": _fastest(travel, acceleration, 1.0),
            },
        )
    )
    room = max(travel / fastest - fastest / acceleration, 0.0)
    settle_time = choices.least(
        "settle_time",
        "s",
        {
            "ten time constants of the loop, at least 0.3 s": max(0.3, rig.loop_time),
            "half of the time that the fastest speed has": 0.5 * room,
        },
    )
    memory = rig.presliding
    usual = {"a usual size; friction is not described": 0.75 * DEG}
    turned = rig.unwinding
    known = memory and {
        f"{SETTLED:.0f} times Ts/σ0 of {memory / DEG:.2g} deg, once the loop's integral has turned "
        f"round in {turned / DEG:.2g} deg": SETTLED * memory + turned
    }
    settle = choices.least(
        "settle_angle", "deg", {"a quarter of the travel": 0.25 * travel, **(known or usual)}
    )
    period = rig.ripple_period
    wide = {"a period of the ripple": 1.05 * period} if period else {"a usual size": 5 * DEG}
    window = choices.least("window_angle", "deg", {"half of the travel": 0.5 * travel, **wide})
    choices.sample_rate(rig)
    slowest = min(own) if own else _slowest(rig, choices, settle, window, 0.1 * fastest)
    needed = max((settle + window) / slowest, settle_time + options.window_time)
    choices.least(
        "max_time",
        "s",
        {
            "the slowest speed settles": max(20.0, needed + 2 * slowest / acceleration),
            "a minute": 60.0,
            share("duration", 0.4): 0.4 * limits.duration,
        },
    )
    choices.least(
        "warm_up_speed",
        "deg/s",
        {"a usual size": 20 * DEG, "half of the fastest speed": 0.5 * fastest},
    )
    if not own:
        choices.take("points", SPEEDS, "the fit needs some ten")
    return choices.told


def _overcome_friction(rig: Rig) -> None:
    """ValueError where the drive cannot move the load at all."""
    if (rig.static_torque or 0.0) >= MOST * rig.torque:
        raise ValueError(
            f"the limits of torque and current leave {rig.torque:.3g} N m, and friction holds "
            f"{rig.static_torque:.3g} N m: nothing would move; raise them"
        )


def _fastest(travel: float, acceleration: float, steady: float) -> float:
    """Rate (rad/s) that is held for `steady` (s) between two ramps: v^2 / a + v t = travel."""
    return 0.5 * acceleration * (math.sqrt(steady**2 + 4 * travel / acceleration) - steady)


def _slowest(rig: Rig, choices: Choices, settle: float, window: float, most: float) -> float:
    """Lowest rate (rad/s): where the curve bends, above the gyro's noise, in the time there is."""
    vs = rig.stribeck_velocity
    longest = min(0.4 * rig.bench.limits.duration, 60.0)
    bend = {"a thirtieth of the Stribeck velocity": vs / 30} if vs else {"a usual size": 0.05 * DEG}
    reasons = {
        **bend,
        "fifty times the gyro's noise in a second": 50
        * rig.rate_noise
        / math.sqrt(rig.sample_rate),
        "it settles within a minute": (settle + 0.5 * window) / longest,
    }
    why = max(reasons, key=lambda reason: reasons[reason])
    return float(choices.take("slowest", nice(min(reasons[why], most), "deg/s", up=True), why))


def breakaway(options: Any, bench: Bench) -> Mapping[str, Chosen]:
    """Positions, height and slope of torque ramps, and what counts as sliding."""
    rig, limits, choices = Rig(bench), bench.limits, Choices(options)
    _overcome_friction(rig)
    # A ramp ends once the load slides at 4 times `sliding_rate`; it then still has to be stopped.
    sliding = max(0.2 * (rig.stribeck_velocity or 0.025), 6.0 * rig.rate_noise)
    reach = max(min(45 * DEG, 0.75 * limits.angle, limits.angle - RUN_OUT * sliding), 0.0)
    positions = tuple(nice(p, "deg", 3) for p in np.linspace(-reach, reach, 10))
    if reach < 45 * DEG:
        choices.take("positions", positions, f"ten, within {share('angle', 0.75)}")
    static = rig.static_torque
    drive = {share("torque", MOST): MOST * rig.torque}
    friction = {} if static is None else {f"{PEAK:g} times the static torque": PEAK * static}
    peak = choices.least("peak_torque", "N m", {**friction, **drive})
    slope = choices.most(
        "torque_rate",
        "N m/s",
        {
            f"breakaway after about {RAMP_TIME:.0f} s": (static or 0.5 * peak) / RAMP_TIME,
            "the ramp ends within the limit of duration": 1.2 * peak / limits.duration,
        },
    )
    if rig.rate_noise > 0:
        length = (static or 0.5 * peak) / slope
        why = "a third of the ramp up to breakaway, to know the gyro's bias"
        choices.take("rest", nice(length / 3.0, "s"), why)
    vs = rig.stribeck_velocity
    choices.most(
        "sliding_rate",
        "deg/s",
        {
            "six deviations of the gyro's noise": 6.0 * rig.rate_noise,
            **({"a fifth of the Stribeck velocity": 0.2 * vs} if vs else {"a usual size": 0.005}),
        },
    )
    choices.sample_rate(rig)
    return choices.told


def frequency_response(options: Any, bench: Bench) -> Mapping[str, Chosen]:
    """Amplitudes within the limits, and frequencies from where they fit to where the loop ends."""
    rig, limits, choices = Rig(bench), bench.limits, Choices(options)
    amplitude, torque = options.amplitude, options.torque
    if options.loop == "closed":
        vs = rig.stribeck_velocity or 0.0
        amplitude = choices.least(
            "amplitude",
            "deg/s",
            {
                "a usual size, ten Stribeck velocities at least": max(30 * DEG, 10 * vs),
                share("rate", 0.5): 0.5 * limits.rate,
            },
        )
    else:
        static = rig.static_torque
        friction = {} if static is None else {f"{PEAK:g} times the static torque": PEAK * static}
        drive = {share("torque", MOST): MOST * rig.torque}
        torque = choices.least("torque", "N m", {**friction, **drive})
    if {"lowest", "highest", "step", "frequencies"} & options.model_fields_set:
        return choices.told
    swing = 0.7 * (limits.angle - abs(options.position))
    lowest = {"a usual size": 0.5}
    if options.loop == "closed":
        lowest[f"its swing is {share('angle', 0.7)}"] = amplitude / (2 * math.pi * swing)
    else:
        free = torque / bench.axis.inertia
        lowest[f"its swing is {share('angle', 0.7)}"] = math.sqrt(free / swing) / (2 * math.pi)
        lowest[f"its rate is {share('rate', 0.7)}"] = free / (0.7 * limits.rate * 2 * math.pi)
    why = max(lowest, key=lambda reason: lowest[reason])
    control = bench.controller.sample_rate
    highest = 100.0 if control is None else 0.35 * control
    low = min(lowest[why], 0.1 * highest)
    swept = dict.fromkeys(nice(f, "Hz", 3, up=True) for f in np.geomspace(low, highest, SWEPT))
    top = "35 % of the controller's sample rate" if control else "a usual size"
    told = f"from {low:.2g} Hz ({why}) to {highest:.3g} Hz ({top})"
    choices.take("frequencies", tuple(swept), told)
    return choices.told


def base_motion(options: Any, bench: Bench) -> Mapping[str, Chosen]:
    """Acceleration of a sinusoidal base motion whose swing and rate the bench can follow."""
    if getattr(getattr(options, "motion", None), "kind", "sine") != "sine":
        return {}
    rig, limits, choices = Rig(bench), bench.limits, Choices(options)
    omega = 2 * math.pi * options.frequency
    choices.least(
        "acceleration",
        "deg/s^2",
        {
            "a usual size": 18 * DEG,
            f"its swing is {share('angle', 0.6)}": 0.6 * limits.angle * omega**2,
            f"its rate is {share('rate', 0.6)}": 0.6 * limits.rate * omega,
            share("acceleration", 0.6): 0.6 * limits.acceleration,
        },
    )
    choices.sample_rate(rig)
    return choices.told


def step_response(options: Any, bench: Bench) -> Mapping[str, Chosen]:
    """Height and ramp of a step of the rate command, above the gyro's noise."""
    rig, limits, choices = Rig(bench), bench.limits, Choices(options)
    step = choices.least(
        "step",
        "deg/s",
        {
            "a usual size, fifty deviations of the gyro's noise at least": max(
                1 * DEG, 50 * rig.rate_noise
            ),
            share("rate", 0.3): 0.3 * limits.rate,
        },
    )
    drive = 0.5 * min(limits.acceleration, rig.torque / bench.axis.inertia)
    choices.most(
        "ramp",
        "s",
        {"a usual size": 0.005, "half of what acceleration and torque allow": step / drive},
    )
    choices.sample_rate(rig)
    return choices.told


def presliding(options: Any, bench: Bench) -> Mapping[str, Chosen]:
    """Displacements around the presliding angle."""
    memory = Rig(bench).presliding
    if memory is None:
        return {}
    choices = Choices(options)
    sizes = tuple(nice(part * memory, "rad") for part in (0.125, 0.25, 0.5, 1.0, 2.0))
    choices.take("amplitudes", sizes, f"an eighth to twice Ts/σ0 of {memory / DEG:.2g} deg")
    return choices.told


def share(limit: str, part: float) -> str:
    """`80 % of the angle limit`."""
    return f"{100 * part:.0f} % of the {limit} limit"


def nice(value: float, unit: str, digits: int = 2, *, up: bool = False) -> float:
    """SI value with few digits in the unit that people read; towards zero, or away from it."""
    si = SI.get(unit, unit)
    shown = float(convert(value, si, unit))
    if shown == 0.0 or not math.isfinite(shown):
        return value
    step = 10.0 ** (math.floor(math.log10(abs(shown))) - digits + 1)
    count = abs(shown) / step
    whole = math.ceil(count - 1e-9) if up else math.floor(count + 1e-9)
    return float(f"{math.copysign(whole * step, shown):.{digits + 2}g}") * factor(unit, si)


SI = {"deg": "rad", "deg/s": "rad/s", "deg/s^2": "rad/s^2"}
"""Display units used here and what they are inside; the others are SI."""
