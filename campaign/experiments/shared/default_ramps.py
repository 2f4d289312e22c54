"""Default options of torque ramps and presliding for a bench."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from campaign.axis_kind import is_linear
from campaign.estimation.relative_rate import LONGEST, STOP_FACTOR, WORST_COUNT, stop_rate
from campaign.experiments.interface import ChosenValue
from campaign.experiments.shared.default_options import (
    DEG,
    MILLIMETRE,
    PEAK,
    overcome_friction,
    usual,
)
from campaign.experiments.shared.rig import MOST, SLOW, Rig
from campaign.experiments.shared.rounded_choices import Choices, Reasons, nice, share
from campaign.physics.bench import Bench
from campaign.physics.complete import control_rate, limits_of
from campaign.physics.steady_friction import steady_friction
from campaign.units import angle_text, rate_text

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


def breakaway(options: Any, bench: Bench) -> Mapping[str, ChosenValue]:
    """Positions, height and slope of torque ramps, and what counts as sliding."""
    rig, limits, choices = Rig(bench), limits_of(bench), Choices(options)
    overcome_friction(rig)
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
            f"within its limits a load slides at {rate_text(allowed[why], '.2g')} at most, and "
            f"the sensors resolve {rate_text(least, '.2g')} (six deviations of the gyro's noise, "
            "or counts): raise the limits of angle or rate, or write sliding_rate"
        )
    return wanted if max(wanted.values()) <= allowed[why] else {why: allowed[why]}


def _reach(rig: Rig, options: Any, sliding: float) -> float:
    """How far from zero (rad) a ramp may begin: it creeps, gives way, and has to be stopped."""
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
