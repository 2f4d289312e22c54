"""Default options of a velocity map for its bench, each with a reason."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from campaign.experiments.interface import ChosenValue
from campaign.experiments.shared.default_options import overcome_friction, stands_still, usual
from campaign.experiments.shared.rig import MOST, Rig
from campaign.experiments.shared.rounded_choices import Choices, nice, share
from campaign.physics.bench import Bench
from campaign.physics.complete import limits_of, require
from campaign.units import angle_text

SETTLED = 10.0
"""Ts / sigma0 after which friction's memory is below 1e-4 of Ts: exp(-10) = 5e-5."""
TURNED = 1.1
"""Factor on the reversal angle of the integral, because chosen values are rounded down."""
UNKNOWN_LOOP = 1.0
"""Settling time (s) of an unknown rate loop: ten time constants of a loop of 1.6 Hz."""
RAMP = 0.5
"""Time (s) from rest to the fastest speed of a map."""
MINUTE = 60.0
"""Longest run (s) of a map, one way."""
SLOWEST = 0.1
"""Largest ratio of the slowest to the fastest speed, so that the map shows a curve."""
FEW = 5.0
"""Factor on `SLOWEST` if the loop is too weak to reverse friction at lower speeds."""
ROUNDED = 1.1
"""Factor on the time that a run needs: rounding removes up to a twentieth."""
SPEEDS = 40
"""Speeds of a map: the fit needs some ten, the rest shows where the curve leaves the model."""


def velocity_map(options: Any, bench: Bench) -> Mapping[str, ChosenValue]:
    """Travel, ramps, settling, windows, speeds and times of a friction-velocity map."""
    require(bench, ("limits",), "a plan of runs at constant speed")
    rig, limits, choices = Rig(bench), limits_of(bench), Choices(options)
    overcome_friction(rig)
    stands_still(rig)
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
    reversal_text = (
        f"{SETTLED:.0f} times Ts/σ0 of {angle_text(memory, '.2g')}, once the loop's "
        f"integral has reversed in {angle_text(turned, '.2g')}"
    )
    known = bench.friction and {reversal_text: SETTLED * memory + TURNED * turned}
    slow = {} if own else {"half of the travel at slow speeds": 0.5 * longest * SLOWEST * fastest}
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
            "the slowest speed settles": max(20.0, ROUNDED * (needed + 2 * slowest / acceleration)),
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
    """As many moves out and back as fit into a trial, each of two runs (s) and two rests."""
    rest = choices.options.rest
    most = int((MOST * duration - rest) / (2.0 * (run + rest)))
    usual_number = choices.options.warm_up_cycles
    why = "a usual number" if most >= usual_number else f"within {share('duration', MOST)}"
    choices.take("warm_up_cycles", min(most, usual_number), why)


def _longest_run(duration: float, rest: float) -> float:
    """Longest run (s) of a map, one way: a trial has two runs and three rests.

    Raises ValueError if the limit of duration leaves no time for a run.
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
    """Lowest rate (rad/s), from the curve's bend, sensor noise and counts, loop and time."""
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
        "the loop reverses friction while it settles": turning,
        "it settles within a minute": (settle + 0.5 * window) / longest,
    }
    why = max(reasons, key=lambda reason: reasons[reason])
    most = max(most, min(turning, FEW * most))
    return float(choices.take("slowest", nice(min(reasons[why], most), "deg/s", up=True), why))


def _settling(rig: Rig, options: Any) -> tuple[float, str]:
    """Settling time (s) of runs at constant speed, and its reason."""
    if "settle_time" in options.model_fields_set:
        return float(options.settle_time), "as written"
    if rig.loop_time is None:
        return UNKNOWN_LOOP, "a usual size; the rate loop is not described"
    return max(0.3, rig.loop_time), "ten time constants of the loop, at least 0.3 s"
