"""Default options for a bench, each with a reason.

An experiment names one of these functions as its `fit`. They know the rig as it is described, not
as it is: where friction is not described they take what the limits allow, and say so. Maps and
ramps have files of their own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from campaign.axis_kind import is_linear
from campaign.experiments.interface import ChosenValue
from campaign.experiments.shared.rig import MOST, Rig
from campaign.experiments.shared.rounded_choices import Choices, nice, share
from campaign.physics.bench import Bench
from campaign.physics.complete import control_rate, inertia_of, limits_of
from campaign.physics.limits import worst_friction

DEG = math.pi / 180.0
"""rad"""
MILLIMETRE = 1e-3
"""m"""
NO_ROOM = "there is no room to move: the position is at the limit of angle, or beyond it"
SWEPT = 40
"""frequencies, evenly in their logarithm."""
ROOM = 0.5
"""of the torque, for friction that is not described, noise, and what the loop overshoots."""
SAMPLES = 100
"""a cycle: of 20 the 19th harmonic folds onto the fundamental, and turned it by 0.1 to 0.2 deg."""
PEAK = 1.8
"""times the static torque: where a ramp or a torque sine ends."""


def usual(degrees: float) -> float:
    """A usual size (SI): what is a degree where axes turn is a millimetre where they travel."""
    return degrees * (MILLIMETRE if is_linear() else DEG)


def overcome_friction(rig: Rig) -> None:
    """ValueError where the drive cannot move the load at all."""
    if (rig.static_torque or 0.0) >= MOST * rig.torque:
        raise ValueError(
            f"the limits of torque and current leave {rig.torque:.3g} N·m, and friction holds "
            f"{rig.static_torque:.3g} N·m: nothing would move; raise them"
        )


def stands_still(rig: Rig) -> None:
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


def frequency_response(options: Any, bench: Bench) -> Mapping[str, ChosenValue]:
    """Amplitudes within the limits, and frequencies from where they fit to where the loop ends."""
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
