"""Default options for a bench, each with a reason.

An experiment names one of these functions as its `fit`. They use the described rig, not the real
one. Without a description of friction they use what the limits allow, and state so. Maps have their
own file, `friction_map/default_options.py`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from campaign.axis_kind import is_linear
from campaign.estimation.relative_rate import LONGEST, STOP_FACTOR, WORST_COUNT, stop_rate
from campaign.experiments.interface import ChosenValue
from campaign.experiments.shared.rig import MOST, SLOW, Rig
from campaign.experiments.shared.rounded_choices import Choices, Reasons, nice, share
from campaign.physics.bench import Bench
from campaign.physics.complete import control_rate, inertia_of, limits_of
from campaign.physics.limits import worst_friction
from campaign.physics.steady_friction import steady_friction
from campaign.units import angle_text, rate_text, torque_text

DEG = math.pi / 180.0
"""rad"""
MILLIMETRE = 1e-3
"""m"""
NO_ROOM = "there is no room to move: the position is at the limit of angle, or beyond it"
SWEPT = 40
"""frequencies, evenly spaced in their logarithm."""
ROOM = 0.5
"""of the torque, as a reserve for undescribed friction, noise and overshoot of the loop."""
SAMPLES = 100
"""a cycle. With 20, the 19th harmonic aliased onto the fundamental: a phase of 0.1 to 0.2 deg."""
PEAK = 1.8
"""times the static torque: peak of a ramp or a torque sine."""


def usual(degrees: float) -> float:
    """A usual size (SI): so many degrees on a rotary axis, millimeters on a linear axis."""
    return degrees * (MILLIMETRE if is_linear() else DEG)


def torque_above_friction(choices: Choices, rig: Rig, name: str) -> float:
    """A torque (N m) above static friction, as far as the drive can supply it."""
    static = rig.static_torque
    friction = {} if static is None else {f"{PEAK:g} times the static torque": PEAK * static}
    return choices.least(name, "N m", {**friction, share("torque", MOST): MOST * rig.torque})


def overcome_friction(rig: Rig) -> None:
    """Raise ValueError if the drive cannot move the load."""
    static = rig.static_torque or 0.0
    if static >= MOST * rig.torque:
        raise ValueError(
            f"the limits of torque and current leave {torque_text(rig.torque)}, and friction holds "
            f"{torque_text(static)}: nothing would move; raise them"
        )


def stands_still(rig: Rig) -> None:
    """Raise ValueError if the loop answers one count of the rate with the whole torque."""
    controller, per_ampere = rig.bench.controller, rig.bench.torque_per_current
    if controller is None or controller.rate is None or per_ampere is None:
        return
    asked = per_ampere * controller.rate.proportional * rig.rate_step
    if asked >= rig.torque:
        raise ValueError(
            f"its loop answers one count of the rate's sensor with {torque_text(asked)}, and the "
            f"limits leave {torque_text(rig.torque)}: lower controller.rate.proportional, or raise "
            "controller.relative_rate_filter"
        )


def frequency_response(options: Any, bench: Bench) -> Mapping[str, ChosenValue]:
    """Amplitudes and frequencies within the limits, up to 35 % of the controller's sample rate."""
    rig, limits, choices = Rig(bench), limits_of(bench), Choices(options)
    amplitude, torque = options.amplitude, options.torque
    if options.loop == "closed":
        stands_still(rig)
        vs, noise = rig.stribeck_velocity or 0.0, rig.rate_noise
        amplitude = choices.least(
            "amplitude",
            "deg/s",
            {
                "a quarter of the rate limit, ten Stribeck velocities and fifty deviations of the "
                "gyro's noise at least": max(0.25 * limits.rate, 10 * vs, 50 * noise),
                f"{share('rate', 0.7)}, less six deviations of its noise, with what the loop "
                "overshoots": 0.7 * rig.rate_left / rig.overshoot,
            },
        )
    else:
        torque = torque_above_friction(choices, rig, "torque")
    if {"lowest", "highest", "step", "frequencies"} & options.model_fields_set:
        return choices.told
    control = control_rate(bench)
    highest = 100.0 if control is None else 0.35 * control
    swing = 0.7 * (limits.angle - abs(options.position))
    if swing <= 0:
        raise ValueError(NO_ROOM)
    cycles = options.settle_cycles + options.cycles
    lowest = {
        "a usual size": min(0.5, 0.1 * highest),
        f"its cycles take {share('duration', MOST)}": max(
            cycles / (MOST * limits.duration),
            (options.cycles + 1) / max(MOST * limits.duration - options.settle_time, 1e-3),
        ),
    }
    if options.loop == "closed":
        lowest[f"its swing is {share('angle', 0.7)}"] = amplitude / (2 * math.pi * swing)
    else:
        free = torque / inertia_of(bench, "the swing of a free load")
        lowest[f"its swing is {share('angle', 0.7)}"] = math.sqrt(free / swing) / (2 * math.pi)
        lowest[f"its rate is {share('rate', 0.7)}"] = free / (0.7 * limits.rate * 2 * math.pi)
    why = max(lowest, key=lambda reason: lowest[reason])
    low = lowest[why]
    if low > 0.5 * highest:
        raise ValueError(
            f"a sweep would begin at {low:.3g} Hz ({why}) and end at {highest:.3g} Hz; raise the "
            "limits, or write frequencies"
        )
    swept = dict.fromkeys(nice(f, "Hz", 3, up=True) for f in np.geomspace(low, highest, SWEPT))
    top = "35 % of the controller's sample rate" if control else "a usual size"
    span = f"from {low:.2g} Hz ({why}) to {highest:.3g} Hz ({top})"
    choices.take("frequencies", tuple(swept), span)
    if options.loop == "closed":
        part = ROOM if rig.static_torque is None else 1.4 * ROOM
        left = rig.accelerated_by(rig.torque - worst_friction(bench, amplitude))
        holds = "an unknown friction" if rig.static_torque is None else "friction"
        choices.least(
            "max_acceleration",
            "deg/s^2",
            {
                share("acceleration", 0.7): 0.7 * limits.acceleration,
                f"{100 * part:.0f} % of what {holds} leaves of the torque": part * left,
            },
        )
    folds = "harmonics that friction makes fold onto the sine: of 100 samples the 99th, 1e-4 of it"
    choices.take("samples_per_cycle", SAMPLES, folds)
    return choices.told


def base_motion(options: Any, bench: Bench) -> Mapping[str, ChosenValue]:
    """Acceleration of a sinusoidal base motion with swing and rate within the limits."""
    if getattr(getattr(options, "motion", None), "kind", "sine") != "sine":
        return {}
    rig, limits, choices = Rig(bench), limits_of(bench), Choices(options)
    omega = 2 * math.pi * _periods_in_time(choices, MOST * limits.duration)
    choices.least(
        "acceleration",
        "deg/s^2",
        {
            "a usual size": usual(18),
            f"its swing is {share('angle', 0.6)}": 0.6 * limits.angle * omega**2,
            f"its rate is {share('rate', 0.6)}": 0.6 * limits.rate * omega,
            share("acceleration", 0.6): 0.6 * limits.acceleration,
        },
    )
    choices.sample_rate(rig)
    return choices.told


def _periods_in_time(choices: Choices, longest: float) -> float:
    """Frequency (Hz) of a sine whose cycles last `longest` (s) at most: fewer or faster cycles.

    The minimum is one settling cycle and two measured cycles.
    """
    options, why = choices.options, share("duration", MOST)
    settle, cycles = options.settle_cycles, options.cycles
    if (settle + cycles) / options.frequency <= longest:
        return float(options.frequency)
    fewest = f"the fewest cycles take {why}"
    frequency = choices.most(
        "frequency", "Hz", {"a usual size": options.frequency, fewest: 3.0 / longest}
    )
    fitting = int(frequency * longest + 1e-9)
    settle = choices.take("settle_cycles", min(settle, max(1, fitting // 4)), f"within {why}")
    choices.take("cycles", max(1, min(cycles, fitting - settle)), f"within {why}")
    return frequency


def step_response(options: Any, bench: Bench) -> Mapping[str, ChosenValue]:
    """Height and ramp of a step of the rate command, above the gyro's noise."""
    rig, limits, choices = Rig(bench), limits_of(bench), Choices(options)
    drive = 0.5 * min(limits.acceleration, rig.accelerated_by(rig.torque))
    room = limits.angle - abs(options.position)
    if room <= 0:
        raise ValueError(NO_ROOM)
    step = choices.least(
        "step",
        "deg/s",
        {
            "a usual size, fifty deviations of the gyro's noise at least": max(
                usual(1), 50 * rig.rate_noise
            ),
            share("rate", 0.3): 0.3 * limits.rate,
            f"its way is {share('angle', 0.6)}": 0.6 * room / options.duration,
            "what acceleration and torque allow in a tenth of the duration": 0.09
            * options.duration
            * drive,
        },
    )
    choices.most(
        "ramp",
        "s",
        {"a usual size": 0.005, "half of what acceleration and torque allow": step / drive},
    )
    choices.sample_rate(rig)
    return choices.told


RAMP_TIME = 30.0
"""s; longest torque ramp up to breakaway: slow against the dynamics of friction."""
RAMP_PACES = 400.0
"""e-folding times of sliding in a ramp up to breakaway: its friction is then 1 % below Ts, and
largest within some ten of them before the ramp ends."""
PACE_SAMPLES = 40.0
"""Smallest number of samples in an e-folding time of sliding: enough for a polynomial."""
SLIDING = 0.1
"""Largest share of the rate limit that counts as sliding."""
RUN_OUT = 4.0
"""s; times the sliding rate, the angle reserved after a ramp to stop the load."""


def breakaway(options: Any, bench: Bench) -> Mapping[str, ChosenValue]:
    """Positions, peak and slope of torque ramps, rest, and the rate that counts as sliding."""
    rig, limits, choices = Rig(bench), limits_of(bench), Choices(options)
    overcome_friction(rig)
    sliding = _sliding(rig, options)
    ends = stop_rate(max(sliding.values()), rig.rate_step)
    reach = _reach(rig, options, ends / STOP_FACTOR)
    positions = tuple(nice(p, "deg", 3) for p in np.linspace(-reach, reach, 10))
    if reach < 45 * DEG:
        choices.take("positions", positions, f"ten, within {share('angle', 0.75)}")
    static, peak = rig.static_torque, torque_above_friction(choices, rig, "peak_torque")
    tau = _instability(rig)
    paces = f"breakaway after {RAMP_PACES:.0f} times {tau:.2g} s, in which sliding grows e-fold"
    slope = choices.most(
        "torque_rate",
        "N m/s",
        {
            f"breakaway after about {RAMP_TIME:.0f} s": (static or 0.5 * peak) / RAMP_TIME,
            "the ramp ends within the limit of duration": 1.2 * peak / limits.duration,
            paces: (static or 0.0) / (RAMP_PACES * tau),
        },
    )
    if rig.rate_noise > 0:
        length = (static or 0.5 * peak) / slope
        why = "a third of the ramp up to breakaway, to know the gyro's bias"
        choices.take("rest", nice(length / 3.0, "s"), why)
    choices.most("sliding_rate", "deg/s", sliding)
    if tau * rig.sample_rate < PACE_SAMPLES:
        fastest = control_rate(bench) or nice(PACE_SAMPLES / tau, "Hz", up=True)
        choices.take("sample_rate", fastest, f"sliding grows e-fold within {tau:.2g} s")
    else:
        choices.sample_rate(rig)
    return choices.told


def _instability(rig: Rig) -> float:
    """Time (s) in which sliding grows e-fold as friction falls up to the Stribeck velocity.

    J over the slope of friction; infinite if friction does not fall, or is not stated.
    """
    speed, inertia = rig.stribeck_velocity, rig.bench.axis.inertia
    if speed is None or inertia is None:
        return math.inf
    dry, viscous = steady_friction(rig.bench, np.array([SLOW, speed]))
    fall = (dry[0] - dry[1] - viscous[1]) / speed
    return float(inertia / fall) if fall > 0 else math.inf


def _sliding(rig: Rig, options: Any) -> Reasons:
    """Candidates (rad/s) for the rate that counts as sliding: above noise, within the limits.

    A ramp ends at four times that rate; then the load must be stopped.
    """
    if "sliding_rate" in options.model_fields_set:
        return {"as written": options.sliding_rate}
    vs, limits, sensors = rig.stribeck_velocity, rig.limits, rig.bench.sensors
    noise, count = 6.0 * sensors.gyro.noise, math.sqrt(3.0) * sensors.gyro.resolution
    seen = WORST_COUNT * sensors.encoder.resolution / LONGEST
    if rig.bench.rate_is_of_encoder:
        noise, count = 6.0 * sensors.encoder.noise / LONGEST, seen
    elif seen:
        count = min(count, seen)
    usual_rate = 0.3 * MILLIMETRE if is_linear() else 0.005
    wanted = {
        "six deviations of the gyro's noise": noise,
        f"what counts of a sensor show in {LONGEST:g} s": count,
        **({"a fifth of the Stribeck velocity": 0.2 * vs} if vs else {"a usual size": usual_rate}),
    }
    allowed = {
        share("rate", SLIDING): SLIDING * limits.rate,
        "what half of the angle limit leaves to stop": 0.5 * limits.angle / RUN_OUT,
    }
    why = min(allowed, key=lambda reason: allowed[reason])
    least = max(noise, count, stop_rate(0.0, rig.rate_step) / STOP_FACTOR)
    if allowed[why] < least:
        raise ValueError(
            f"within its limits a load slides at {rate_text(allowed[why], '.2g')} at most; the "
            f"sensors resolve {rate_text(least, '.2g')} (six deviations of the gyro's noise, or "
            "counts): raise the limits of angle or rate, or write sliding_rate"
        )
    return wanted if max(wanted.values()) <= allowed[why] else {why: allowed[why]}


def _reach(rig: Rig, options: Any, sliding: float) -> float:
    """Largest start angle (rad) of a ramp, with room for creep, sliding and stop."""
    limit, creep = rig.limits.angle, 2.0 * (rig.presliding or 0.0)
    if creep > 0.5 * limit and "positions" not in options.model_fields_set:
        raise ValueError(
            f"a load creeps {angle_text(creep, '.2g')} before friction gives way, more than half "
            f"of the angle limit of {angle_text(limit, '.2g')}: raise it, or write positions"
        )
    return max(min(usual(45), 0.75 * limit, limit - RUN_OUT * sliding - creep), 0.0)


def presliding(options: Any, bench: Bench) -> Mapping[str, ChosenValue]:
    """Displacements around the presliding angle."""
    memory = Rig(bench).presliding
    if memory is None:
        return {}
    choices = Choices(options)
    sizes = tuple(nice(part * memory, "rad") for part in (0.125, 0.25, 0.5, 1.0, 2.0))
    choices.take("amplitudes", sizes, f"an eighth to twice Ts/σ0 of {angle_text(memory, '.2g')}")
    return choices.told
