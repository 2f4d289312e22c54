"""Options that a test does not write, as they suit its bench, each with the reason.

An experiment names one of these functions as its `fit`. They know the rig as it is described, not
as it is: where friction is not described they take what the limits allow, and say so.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from campaign.axis_kind import is_linear
from campaign.experiments.interface import Chosen
from campaign.experiments.shared.choices import Choices, Reasons, nice, share
from campaign.experiments.shared.rig import MOST, SLOW, Rig
from campaign.identification.relative_rate import LONGEST, STOP_FACTOR, WORST_COUNT, stop_rate
from campaign.physics.bench import Bench
from campaign.physics.complete import control_rate, inertia_of, limits_of, require
from campaign.physics.steady_friction import steady_friction
from campaign.units import angle_here, rate_here

DEG = math.pi / 180.0
MILLIMETRE = 1e-3
NO_ROOM = "there is no room to move: the position is at the limit of angle, or beyond it"
SETTLED = 10.0
"""Ts / sigma0 after which friction's memory is below 1e-4 of Ts: exp(-10) = 5e-5."""
TURNED = 1.1
"""times what an integral takes to turn round: what is chosen is rounded down."""
UNKNOWN_LOOP = 1.0
"""s to settle where nobody says how fast the rate loop is: ten time constants of one of 1.6 Hz."""
RAMP = 0.5
"""s from rest to the fastest speed of a map."""
MINUTE = 60.0
"""s that a run of a map takes at most, one way."""
WARM_UP_CYCLES = 3
SLOWEST = 0.1
"""of the fastest speed of a map, at most: its slowest, so that it is a curve."""
FEW = 5.0
"""times that, where the loop is too weak to turn friction round at lower speeds."""
SPEEDS = 40
"""of a map: the fit needs some ten, the rest shows where the curve is not the model's."""
SWEPT = 40
"""frequencies, evenly in their logarithm."""
RAMP_TIME = 30.0
"""s, of a torque ramp up to breakaway, at most: slow against friction's own rates."""
RAMP_PACES = 400.0
"""times that sliding takes to grow e-fold, up to breakaway: its friction is then 1 % below Ts, and
largest within some ten of them before the ramp ends."""
PACE_SAMPLES = 40.0
"""in which sliding grows e-fold, at least: enough for a polynomial through them."""
SLIDING = 0.1
"""of the rate limit, at most: a rate that counts as sliding."""
RUN_OUT = 4.0
"""s; times the rate that counts as sliding, room behind a ramp for the load to be stopped in."""
PEAK = 1.8
"""times the static torque: where a ramp or a torque sine ends."""


def usual(degrees: float) -> float:
    """A usual size (SI): what is a degree where axes turn is a millimetre where they travel."""
    return degrees * (MILLIMETRE if is_linear() else DEG)


def velocity_map(options: Any, bench: Bench) -> Mapping[str, Chosen]:
    """Travel, ramps, settling, windows, speeds and times of a friction-velocity map."""
    require(bench, ("limits",), "a plan of runs at constant speed")
    rig, limits, choices = Rig(bench), limits_of(bench), Choices(options)
    _overcome_friction(rig)
    _stands_still(rig)
    allowed = _longest_run(limits.duration, options.rest)
    longest = min(MINUTE, allowed)
    own = options.speeds
    cruise = 0.7 * rig.rate_left
    acceleration = choices.least(
        "acceleration",
        "deg/s^2",
        {
            f"the fastest speed in {RAMP:g} s": cruise / RAMP,
            "half of what torque and friction leave": 0.5 * rig.acceleration(0.7 * limits.rate),
        },
    )
    settling, settles = _settling(rig, options)
    whole = cruise * (cruise / acceleration + settling + options.window_time)
    travel = choices.least(
        "max_travel",
        "deg",
        {"what the fastest speed takes": whole, share("angle", 0.8): 1.6 * limits.angle},
    )
    fastest = (
        max(own)
        if own
        else choices.least(
            "fastest",
            "deg/s",
            {
                "its ramps take half of a run": 0.25 * acceleration * longest,
                f"{share('rate', 0.7)}, less six deviations of its noise": cruise,
                "the travel leaves room to settle and measure": _fastest(
                    travel, acceleration, max(1.0, settling + 0.5)
                ),
            },
        )
    )
    room = max(min(travel / fastest, longest - fastest / acceleration) - fastest / acceleration, 0)
    settle_time = choices.least(
        "settle_time",
        "s",
        {
            settles: settling,
            "what the fastest speed leaves": max(room - 0.5, 0.5 * room),
        },
    )
    memory = rig.presliding or 0.0
    undescribed = {"a usual size; friction is not described": usual(0.75)}
    turned = rig.unwinding(0.0)
    told = (
        f"{SETTLED:.0f} times Ts/σ0 of {angle_here(memory, '.2g')}, once the loop's "
        f"integral has turned round in {angle_here(turned, '.2g')}"
    )
    known = bench.friction and {told: SETTLED * memory + TURNED * turned}
    slow = {} if own else {"half of what slow speeds turn": 0.5 * longest * SLOWEST * fastest}
    settle = choices.least(
        "settle_angle",
        "deg",
        {"a quarter of the travel": 0.25 * travel, **slow, **(known or undescribed)},
    )
    period = rig.ripple_period
    wide = {"a period of the ripple": 1.05 * period} if period else {"a usual size": usual(5)}
    window = choices.least("window_angle", "deg", {"half of the travel": 0.5 * travel, **wide})
    choices.sample_rate(rig)
    if own:
        slowest = min(own)
    else:
        turning = rig.turned_within(max(settle - SETTLED * memory, 0.0) / TURNED)
        slowest = _slowest(rig, choices, settle, window, longest, turning, SLOWEST * fastest)
    needed = max((settle + window) / slowest, settle_time + options.window_time)
    max_time = choices.least(
        "max_time",
        "s",
        {
            "the slowest speed settles": max(20.0, needed + 2 * slowest / acceleration),
            "a minute": MINUTE,
            "what the limit of duration leaves a run": allowed,
        },
    )
    warm = choices.least("warm_up_speed", "deg/s", {"half of the fastest speed": 0.5 * fastest})
    run = min(max_time, travel / warm + warm / acceleration)
    _warm_up_cycles(choices, run, limits.duration)
    if not own:
        choices.take("points", SPEEDS, "the fit needs some ten")
    return choices.told


def _warm_up_cycles(choices: Choices, run: float, duration: float) -> None:
    """As many moves out and back, of two runs (s) and two rests each, as a trial may last."""
    rest = choices.options.rest
    most = int((MOST * duration - rest) / (2.0 * (run + rest)))
    if most < WARM_UP_CYCLES:
        choices.take("warm_up_cycles", most, f"what fits into {share('duration', MOST)}")
    else:
        choices.take("warm_up_cycles", WARM_UP_CYCLES, "a usual number")


def _overcome_friction(rig: Rig) -> None:
    """ValueError where the drive cannot move the load at all."""
    if (rig.static_torque or 0.0) >= MOST * rig.torque:
        raise ValueError(
            f"the limits of torque and current leave {rig.torque:.3g} N·m, and friction holds "
            f"{rig.static_torque:.3g} N·m: nothing would move; raise them"
        )


def _stands_still(rig: Rig) -> None:
    """ValueError where one count of the rate's sensor makes the loop ask for all of the torque."""
    controller, per_ampere = rig.bench.controller, rig.bench.torque_per_current
    if controller is None or controller.rate is None or per_ampere is None:
        return
    asked = per_ampere * controller.rate.proportional * rig.rate_step
    if asked >= rig.torque:
        raise ValueError(
            f"its loop answers one count of the rate's sensor with {asked:.3g} N·m, and the limits "
            f"leave {rig.torque:.3g} N·m: lower controller.rate.proportional, or raise "
            "controller.relative_rate_filter"
        )


def _longest_run(duration: float, rest: float) -> float:
    """How long (s) a run of a map may take, one way: two and three rests are a trial.

    Raises ValueError where the limit of duration leaves it none.
    """
    longest = 0.5 * (MOST * duration - 3.0 * rest)
    if longest <= 0:
        raise ValueError(
            f"the limit of duration, {duration:.3g} s, leaves no time for a run out and back with "
            f"three rests of {rest:.3g} s; raise it, or shorten rest"
        )
    return longest


def _fastest(travel: float, acceleration: float, steady: float) -> float:
    """Rate (rad/s) that is held for `steady` (s) between two ramps: v^2 / a + v t = travel."""
    return 0.5 * acceleration * (math.sqrt(steady**2 + 4 * travel / acceleration) - steady)


def _slowest(
    rig: Rig,
    choices: Choices,
    settle: float,
    window: float,
    longest: float,
    turning: float,
    most: float,
) -> float:
    """Lowest rate (rad/s): where the curve bends, above the gyro's noise, in the time there is."""
    vs = rig.stribeck_velocity
    bend = (
        {"a thirtieth of the Stribeck velocity": vs / 30} if vs else {"a usual size": usual(0.05)}
    )
    reasons = {
        **bend,
        "fifty times the gyro's noise in a second": 50
        * rig.rate_noise
        / math.sqrt(rig.sample_rate),
        "thirty counts of the encoder, or three of the gyro": rig.slowest_seen(longest),
        "the loop turns friction round while it settles": turning,
        "it settles within a minute": (settle + 0.5 * window) / longest,
    }
    why = max(reasons, key=lambda reason: reasons[reason])
    most = max(most, min(turning, FEW * most))
    return float(choices.take("slowest", nice(min(reasons[why], most), "deg/s", up=True), why))


def breakaway(options: Any, bench: Bench) -> Mapping[str, Chosen]:
    """Positions, height and slope of torque ramps, and what counts as sliding."""
    rig, limits, choices = Rig(bench), limits_of(bench), Choices(options)
    _overcome_friction(rig)
    sliding = _sliding(rig, options)
    ends = stop_rate(max(sliding.values()), rig.rate_step)
    reach = _reach(rig, options, ends / STOP_FACTOR)
    positions = tuple(nice(p, "deg", 3) for p in np.linspace(-reach, reach, 10))
    if reach < 45 * DEG:
        choices.take("positions", positions, f"ten, within {share('angle', 0.75)}")
    static = rig.static_torque
    drive = {share("torque", MOST): MOST * rig.torque}
    friction = {} if static is None else {f"{PEAK:g} times the static torque": PEAK * static}
    peak = choices.least("peak_torque", "N m", {**friction, **drive})
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

    J over the slope of friction; infinite where it does not fall, or nobody says how.
    """
    speed, inertia = rig.stribeck_velocity, rig.bench.axis.inertia
    if speed is None or inertia is None:
        return math.inf
    dry, viscous = steady_friction(rig.bench, np.array([SLOW, speed]))
    fall = (dry[0] - dry[1] - viscous[1]) / speed
    return float(inertia / fall) if fall > 0 else math.inf


def _settling(rig: Rig, options: Any) -> tuple[float, str]:
    """How long (s) runs at constant speed settle, and why that long."""
    if "settle_time" in options.model_fields_set:
        return float(options.settle_time), "as written"
    if rig.loop_time is None:
        return UNKNOWN_LOOP, "a usual size; the rate loop is not described"
    return max(0.3, rig.loop_time), "ten time constants of the loop, at least 0.3 s"


def _sliding(rig: Rig, options: Any) -> Reasons:
    """Rate (rad/s) that counts as sliding: above the gyro's noise, and within the limits.

    A ramp ends at four times that, and then the load still has to be stopped.
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
            f"within its limits a load slides at {rate_here(allowed[why], '.2g')} at most, and "
            f"the sensors resolve {rate_here(least, '.2g')} (six deviations of the gyro's noise, "
            "or counts): raise the limits of angle or rate, or write sliding_rate"
        )
    return wanted if max(wanted.values()) <= allowed[why] else {why: allowed[why]}


def _reach(rig: Rig, options: Any, sliding: float) -> float:
    """How far from zero (rad) a ramp may begin: it creeps, gives way, and has to be stopped."""
    limit, creep = rig.limits.angle, 2.0 * (rig.presliding or 0.0)
    if creep > 0.5 * limit and "positions" not in options.model_fields_set:
        raise ValueError(
            f"a load creeps {angle_here(creep, '.2g')} before friction gives way, more than half "
            f"of the angle limit of {angle_here(limit, '.2g')}: raise it, or write positions"
        )
    return max(min(usual(45), 0.75 * limit, limit - RUN_OUT * sliding - creep), 0.0)


def frequency_response(options: Any, bench: Bench) -> Mapping[str, Chosen]:
    """Amplitudes within the limits, and frequencies from where they fit to where the loop ends."""
    rig, limits, choices = Rig(bench), limits_of(bench), Choices(options)
    amplitude, torque = options.amplitude, options.torque
    if options.loop == "closed":
        _stands_still(rig)
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
        static = rig.static_torque
        friction = {} if static is None else {f"{PEAK:g} times the static torque": PEAK * static}
        drive = {share("torque", MOST): MOST * rig.torque}
        torque = choices.least("torque", "N m", {**friction, **drive})
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
    told = f"from {low:.2g} Hz ({why}) to {highest:.3g} Hz ({top})"
    choices.take("frequencies", tuple(swept), told)
    return choices.told


def base_motion(options: Any, bench: Bench) -> Mapping[str, Chosen]:
    """Acceleration of a sinusoidal base motion whose swing and rate the bench can follow."""
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
    """Frequency (Hz) of a sine whose cycles last `longest` (s) at most: fewer of them, or faster.

    One cycle to settle and two that are measured are the fewest.
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


def step_response(options: Any, bench: Bench) -> Mapping[str, Chosen]:
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


def presliding(options: Any, bench: Bench) -> Mapping[str, Chosen]:
    """Displacements around the presliding angle."""
    memory = Rig(bench).presliding
    if memory is None:
        return {}
    choices = Choices(options)
    sizes = tuple(nice(part * memory, "rad") for part in (0.125, 0.25, 0.5, 1.0, 2.0))
    choices.take("amplitudes", sizes, f"an eighth to twice Ts/σ0 of {angle_here(memory, '.2g')}")
    return choices.told
