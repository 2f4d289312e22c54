"""The pilot of a friction map: a few speeds that decide the others.

The pilot's speeds are spread evenly over those of the plain map. Its runs settle for as long as
they measure, for nobody knows friction yet, and are points of the map where that was long enough.
What follows has the rest of `points`, between the same slowest and fastest speed
(`velocity_map_choice`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from campaign.estimate import Window
from campaign.experiments.friction_map.runs import (
    ROUNDING,
    Run,
    VelocityMapOptions,
    map_speeds,
    map_trials,
    plan_run,
    run_requests,
    settled_angle,
    warm_ups,
    windows_of,
)
from campaign.experiments.interface import TrialData
from campaign.experiments.shared.rig import Rig
from campaign.physics.bench import Bench
from campaign.trial import NONE_MORE, Most, TrialRequest
from campaign.units import angle_text

SPEEDS = 10
"""of a pilot: twice as many as Equation 4.6 has parameters."""
FEWEST = 2 * SPEEDS
"""points of a map with a pilot: as many after it as in it."""
REVERSAL = "reversal"
"""Window of a pilot's run: from the turn until the way back is settled. No other run has one."""


class PilotedMapOptions(VelocityMapOptions):
    """Options of a friction-velocity map, which may have a pilot."""

    pilot: bool = False
    """Run 10 of the `points` first. The friction that they show decides at which speeds between
    slowest and fastest the others tell most of it, and whether these settle and measure longer.
    `repeat` repeats the 10, and not what follows."""


def pilot_speeds(options: VelocityMapOptions) -> tuple[float, ...]:
    """Speeds of the pilot (rad/s), rising: among those of the plain map, as evenly as these are.

    Raises ValueError for options that leave nothing to be chosen.
    """
    if options.speeds:
        raise ValueError("a pilot chooses speeds: write slowest and fastest instead of speeds")
    if options.points < FEWEST:
        raise ValueError(f"a map with a pilot has at least {FEWEST} points, {SPEEDS} of them in it")
    grid = map_speeds(options)
    places = np.round(np.linspace(0, len(grid) - 1, SPEEDS)).astype(int)
    return tuple(grid[place] for place in places)


def trials(options: PilotedMapOptions, bench: Bench) -> Iterator[TrialRequest]:
    """The planned trials: the whole map, or its pilot."""
    if not options.pilot:
        yield from map_trials(options, bench)
        return
    yield from warm_ups(options)
    rig = Rig(bench)
    for number, speed in enumerate(pilot_speeds(options)):
        run = pilot_run(plan_run(speed, options))
        turn = Window(REVERSAL, run.leg, run.window_of(-1)[0])
        for request in run_requests(run, options, rig, number):
            windows = (*request.windows, turn)
            yield replace(request, note=f"pilot; {request.note}", windows=windows)


def pilot_run(run: Run) -> Run:
    """The same, with what is settled in its second half at most."""
    settle = max(run.settle, 0.5 * run.cruise)
    room = run.cruise - settle
    if run.window <= room:
        return replace(run, settle=settle)
    return replace(run, settle=settle, window=room, rule="half of the run")


def most(options: PilotedMapOptions, bench: Bench) -> Most:
    """What follows a pilot at most: every trial as long as max_time allows."""
    if not options.pilot:
        return NONE_MORE
    count = (options.points - SPEEDS) * max(1, len(options.start_angles))
    duration = 2.0 * (options.rest + options.max_time) + options.rest
    samples = int(duration * options.sample_rate) + 1
    return Most(count, count * duration, count * samples)


def settled_enough(group: Sequence[TrialData], notes: list[str]) -> list[TrialData]:
    """The runs of a map without those of its pilot that settled for less than what followed does.

    What became of the pilot, and what was left out, is told in `notes`.
    """
    first = [item for item in group if REVERSAL in windows_of(item.trial)]
    then = [item for item in group if REVERSAL not in windows_of(item.trial)]
    if not first:
        return then
    if not then:
        notes.append("Nothing followed the pilot: the map is that of the pilot alone.")
        return first
    notes += dict.fromkeys(item.trial.note.partition("; window")[0] for item in then)
    needed = min(settled_angle(item.trial) for item in then)
    kept = [item for item in first if settled_angle(item.trial) >= needed * (1.0 - ROUNDING)]
    if short := len(first) - len(kept):
        notes.append(
            f"{short} of {len(first)} runs of the pilot are no points of the map: they settled for "
            f"less than the {angle_text(needed, '.2g')} of those that followed."
        )
    return [*kept, *then]
