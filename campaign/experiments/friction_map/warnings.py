"""Warnings of the plan of a friction-velocity map.

Except for the number of speeds they depend on the bench: without its friction there are none.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from campaign.estimation.ripple import FASTEST, LEAST_PERIODS
from campaign.estimation.stribeck import PARAMETERS
from campaign.estimation.velocity_map import FAR, FEWEST_BELOW
from campaign.experiments.friction_map.runs import (
    Run,
    VelocityMapOptions,
    map_speeds,
    plan_run,
    settling_of_runs,
    speed_range,
)
from campaign.experiments.shared.rig import Rig
from campaign.physics.bench import Bench
from campaign.physics.true_values import stribeck_parameters
from campaign.units import angle_text, rate_text

LEAST_RUNS = 2
"""Fewest runs that show a ripple of known period, for its removal from all points."""


def map_warnings(options: VelocityMapOptions, bench: Bench) -> Iterator[str]:
    """Warnings, without a full stop, on a map planned with these options."""
    runs = [plan_run(speed, options) for speed in sorted(set(map_speeds(options)))]
    yield from _too_few(runs)
    if getattr(options, "pilot", False):  # it decides speeds and settling of the other runs
        return
    yield from _extrapolated(runs, bench)
    yield from _settling(runs, bench)
    yield from _ripple(runs, options, bench)


def _too_few(runs: Sequence[Run]) -> Iterator[str]:
    if len(runs) <= len(PARAMETERS):
        yield (
            f"{len(runs)} speeds cannot determine the {len(PARAMETERS)} parameters of the Stribeck "
            f"curve and their scatter: {len(PARAMETERS) + 1} are the fewest; some ten more give "
            "useful intervals"
        )


def _extrapolated(runs: Sequence[Run], bench: Bench) -> Iterator[str]:
    """Warn of few speeds below the larger of two Stribeck velocities, and of none far above it."""
    known = [stribeck_parameters(bench, sign) for sign in (1.0, -1.0)]
    velocity = max(each.get("stribeck_velocity", 0.0) for each in known)
    below = sum(run.speed < velocity for run in runs)
    if velocity > 0 and below < FEWEST_BELOW:
        yield (
            f"{below} of {len(runs)} speeds are below the Stribeck velocity of "
            f"{rate_text(velocity)}: static_torque is extrapolated; run {FEWEST_BELOW} or "
            f"more below it, from {rate_text(0.1 * velocity)} on"
        )
    far = FAR * velocity
    if far > 0 and not any(run.speed > far for run in runs):
        yield (
            f"no speed is above {FAR:g} times the Stribeck velocity, {rate_text(far)}: "
            "coulomb_torque is extrapolated; run one or more above that"
        )


def _settling(runs: Sequence[Run], bench: Bench) -> Iterator[str]:
    where, advice = settling_of_runs(Rig(bench), [(r.speed, r.settle * r.speed) for r in runs])
    if advice:
        yield f"at {where} runs settle for too short an angle: {advice}"


def _ripple(runs: Sequence[Run], options: VelocityMapOptions, bench: Bench) -> Iterator[str]:
    """Warn of a ripple that windows and starts do not average, and that the analysis cannot remove:
    too few runs are long and slow enough to show it.
    """
    period = Rig(bench).ripple_period
    if period is None or len(set(options.start_angles)) > 1:
        return
    short = [run.speed for run in runs if run.window * run.speed < period]
    slow = [run for run in runs if run.speed < FASTEST * period]
    showing = [run for run in slow if run.settled * run.speed >= LEAST_PERIODS * period]
    if not short or len(showing) >= LEAST_RUNS:
        return
    span = f"a period of friction's ripple, {angle_text(period)}"
    if options.max_travel < period and not options.spread_starts:
        yield (
            f"max_travel of {angle_text(options.max_travel)} is shorter than {span}: every run "
            "sees it at one place; raise it, or write two start_angles half a period apart"
        )
        return
    yield (
        f"at {speed_range(short)} windows are shorter than {span}, and it cannot be taken out: of "
        f"the runs below {rate_text(FASTEST * period)} {len(showing)} span one, and {LEAST_RUNS} "
        "have to; raise max_travel or max_time, or write two start_angles half a period apart"
    )
